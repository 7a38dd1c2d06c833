// What leaves get of lamps by way of metal and glass, which rays from the leaves seldom find there: in flat mirrors as
// of images; where other things reflect as well, all of it by paths from the lamps. Owned by LeafGather; one thread
// outside of the calls.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/solver/reflected/caustic_light.h"
#include "server/solver/reflected/imaged_light.h"

namespace radiosity::solver {

class MirroredLamps {
 public:
  struct Lamps {
    ImagedLight::Lamps images, sources;  ///< of lamps, and of lights that are no surfaces
    CausticLight::Lamps caustics;        ///< of lamps; where there are some, there are no `images`
    [[nodiscard]] bool any() const { return images.images || sources.images || caustics.paths; }
  };

  /// `sides` are to outlive it. `most_bytes`: for each of the three.
  MirroredLamps(const std::vector<Side>& sides, const std::shared_ptr<const LeafRays>& rays, std::uint64_t seed,
                std::size_t most_bytes);

  /// As of ImagedLight and CausticLight.
  void begin(Lamps lamps, const LeafShading* shading);
  bool advance(double seconds);
  [[nodiscard]] bool isBehind() const;
  [[nodiscard]] std::uint64_t raysFor(const Lamps& lamps) const;
  /// There was no room for some of it: lamps are to be found anew.
  [[nodiscard]] bool hasNoRoomForImages() const { return images_.isGivenUp() || sources_.isGivenUp(); }
  [[nodiscard]] bool hasNoRoomForCaustics() const { return caustics_.isGivenUp(); }
  [[nodiscard]] bool hasNoRoomFor(const Lamps& lamps) const {
    return (hasNoRoomForImages() && (lamps.images.images || lamps.sources.images)) ||
           (hasNoRoomForCaustics() && lamps.caustics.paths);
  }
  /// About so many times as many looks at images, and as many paths; 1 and less: as they are.
  bool refine(double looks, double paths);

  /// Null: no lamp is looked for in flat mirrors; and no path is followed from any. Then rays find what they find.
  [[nodiscard]] const LampImages* images() const { return images_.images(); }
  [[nodiscard]] const CausticPaths* caustics() const { return caustics_.paths(); }
  [[nodiscard]] bool any() const { return images_.images() || sources_.images() || caustics_.paths(); }

  /// Adds what leaves get by leaf value, of images of lights that are no surfaces, and of lamps, and of caustics; and
  /// by number of `shading`, of all.
  void addSourcesTo(std::size_t half, std::vector<glm::vec3>& irradiance) const { sources_.addTo(half, irradiance); }
  void addImagesTo(std::size_t half, std::vector<glm::vec3>& irradiance) const { images_.addTo(half, irradiance); }
  void addCausticsTo(std::size_t half, std::vector<glm::vec3>& irradiance) const { caustics_.addTo(half, irradiance); }
  void addShadedTo(std::size_t half, std::vector<glm::vec3>& irradiance) const;

  /// How finely was looked, for checkpoints.
  using Times = std::array<std::uint32_t, 3>;
  [[nodiscard]] Times times() const { return {images_.times(), sources_.times(), caustics_.times()}; }
  void setTimes(const Times& times);
  [[nodiscard]] static bool areTimes(const Times& times);

 private:
  ImagedLight images_, sources_;
  CausticLight caustics_;
  std::uint32_t leaf_count_ = 0;
};

}  // namespace radiosity::solver
