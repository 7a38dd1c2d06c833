// Lamps as they are seen in flat mirrors: what such an image brings to a place is the light of the lamp at the mirror
// image of the place, as far as the way passes the mirror and nothing lies on it. So a lamp is looked for where its
// image is, as direct light is, while rays into all directions find small lamps seldom, and those without a size never.
// Images of images are not looked for: rays find those. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/solver/lamps/lamp_ball.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/patches/lights.h"
#include "server/solver/rays/flat_mirrors.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"

namespace radiosity::solver {

class LampImages {
 public:
  /// More images than these are not looked for: mirrors are the largest then, and of too many lamps there are none.
  static constexpr std::size_t kMostImages = 64;

  /// Lamps that shine with less, all channels, are so large, or so faint, that rays find them better. `area`: of all
  /// surfaces, unit box squared.
  [[nodiscard]] static float leastEmission(std::span<const LightPolygon> polygons, double area);

  /// Images of these lamps, which may be dark. Null: there is no flat mirror, or no lamp, or there are too many.
  [[nodiscard]] static std::shared_ptr<const LampImages> find(const scene::PatchScene& patches,
                                                              const std::vector<Side>& sides,
                                                              std::shared_ptr<const LeafRays> rays,
                                                              std::shared_ptr<const SpecularLeaves> mirrors,
                                                              std::span<const LightPolygon> polygons,
                                                              std::span<const PunctualLights::Source> sources);

  /// A lamp, by index, in a mirror.
  struct Image {
    std::uint32_t lamp = 0, plane = 0;
    std::uint64_t key = 0;  ///< stays with both while neither changes
  };
  [[nodiscard]] const std::vector<Image>& images() const { return images_; }
  /// Polygons come first, and then sources, but for those of the sky.
  [[nodiscard]] std::size_t lampCount() const { return polygons_.size() + sources_.size(); }
  /// Emission or intensity of each lamp, of the same lights as those of find().
  [[nodiscard]] static std::vector<glm::vec3> lightOf(std::span<const LightPolygon> polygons,
                                                      std::span<const PunctualLights::Source> sources);
  /// Lamps that are seen in the mirror there are looked for as images.
  [[nodiscard]] bool isIn(std::uint32_t value) const { return flat_->planeOf(value) != FlatMirrors::kNoPlane; }

  /// False: nothing within `radius` of `centre` (unit box) sees the image.
  [[nodiscard]] bool maySee(const Image& image, const glm::dvec3& centre, double radius) const;

  /// One point of the lamp, seen from a place by way of the mirror, for an emission or intensity of one.
  struct Look {
    double weight = 0.0;   ///< what it brings to the place without mirror and obstacles, of a polygon but for a factor
    glm::dvec3 seen{0.0};  ///< of that, what the mirror reflects and nothing hides
  };
  /// `shading`: normal that light counts for, unit length. `at`: uniform in [0, 1)^2.
  [[nodiscard]] Look look(const Image& image, const LeafRays::Place& place, const glm::dvec3& shading,
                          const glm::dvec2& at) const;

  /// What looks tell together.
  struct Looks {
    std::uint32_t count = 0, seen_count = 0;
    double weight = 0.0;
    glm::dvec3 seen{0.0};

    void add(const Look& look) {
      ++count;
      seen_count += look.seen != glm::dvec3(0.0) ? 1 : 0;
      weight += look.weight;
      seen += look.seen;
    }
  };
  /// By looks from these places: of a polygon its form factor, which is exact, times the part that is seen. `shading`:
  /// null for the normals of the places.
  [[nodiscard]] glm::dvec3 irradiance(const Image& image, const Looks& looks, std::span<const LeafRays::Place> places,
                                      const glm::dvec3* shading = nullptr) const;

 private:
  LampImages() = default;
  /// The way from a place to a point of a lamp that no mirror is between, and what it brings.
  struct Unhidden {
    glm::dvec3 way{0.0};
    double weight = 0.0;
  };
  [[nodiscard]] Unhidden unhidden(std::uint32_t lamp, const LeafRays::Place& place, const glm::dvec3& shading,
                                  const glm::dvec2& at) const;
  [[nodiscard]] static LeafRays::Place behind(const FlatMirrors::Plane& plane, const LeafRays::Place& place);

  std::shared_ptr<const LeafRays> rays_;
  std::shared_ptr<const SpecularLeaves> mirrors_;
  std::shared_ptr<const FlatMirrors> flat_;
  std::vector<LightPolygon> polygons_;
  std::vector<PunctualLights::Source> sources_;
  std::vector<LampBall> balls_;  ///< by lamp
  std::vector<Image> images_;
};

}  // namespace radiosity::solver
