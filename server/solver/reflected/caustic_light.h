// What leaves get of lamps by way of metal and glass, by paths that are followed from the lamps (CausticPaths), kept by
// lamp, so that an edit of light follows none again. Two independent halves. Owned by LeafGather; one thread outside of
// the calls.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "server/solver/lamps/caustic_paths.h"
#include "server/solver/reflected/leaf_shading.h"

namespace radiosity::solver {

class CausticLight {
 public:
  /// `most_bytes`: for all that it keeps; where more is needed all is given up.
  CausticLight(std::shared_ptr<const LeafRays> rays, std::uint64_t seed, std::size_t most_bytes)
      : rays_(std::move(rays)), seed_(seed), most_bytes_(most_bytes) {}

  struct Lamps {
    std::shared_ptr<const CausticPaths> paths;  ///< null: there are none
    std::vector<glm::vec3> light;               ///< emission of each
  };
  /// Follows these from now on. What is known of those that were there before stays known. `shading`: normals that
  /// light is told for, too, null for none; to outlive it. `leaves`: how many there are.
  void begin(Lamps lamps, const LeafShading* shading, std::uint32_t leaves);
  /// From then on about `times` as many paths are followed, a power of two, at most kMostTimes in all. False: so many
  /// are already.
  bool refine(double times);
  static constexpr std::uint32_t kMostTimes = 256;
  [[nodiscard]] std::uint32_t times() const { return times_; }
  void setTimes(std::uint32_t times) { times_ = times; }
  /// Goes on for about `seconds`, on all cores: until it is true. Where the cuts lie changes nothing. Throws
  /// std::bad_alloc.
  bool advance(double seconds);
  /// Rays that the paths take, about, that begin() would find nothing known of.
  [[nodiscard]] std::uint64_t raysFor(const Lamps& lamps, std::uint32_t leaves) const;
  /// They took too much memory: from then on none is followed.
  [[nodiscard]] bool isGivenUp() const { return is_given_up_; }
  /// More paths are asked for than were followed.
  [[nodiscard]] bool isBehind() const;
  /// After that; null: there are none.
  [[nodiscard]] const CausticPaths* paths() const { return lamps_.paths.get(); }

  /// Adds what leaves get, by leaf value, or for the normals of `shading`, by their number.
  void addTo(std::size_t half, std::vector<glm::vec3>& irradiance) const;
  void addShadedTo(std::size_t half, std::vector<glm::vec3>& irradiance) const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  /// The sum of what paths of a half bring to a leaf of an emission of one; irradiance times the number of paths.
  struct Leaf {
    std::uint32_t value = 0;
    std::uint32_t number = scene::kNone;  ///< of its shading normal
    glm::vec3 light{0.0F}, shaded{0.0F};
  };
  using Leaves = std::vector<Leaf>;
  struct OfLamp {
    std::uint64_t key = 0;
    std::uint32_t first = 0;         ///< paths of each half, of times() of one: those of when it was first seen
    std::uint32_t followed = 0;      ///< paths of each half
    std::array<Leaves, 2> leaves{};  ///< by value
    std::array<Leaves, 2> fresh{};   ///< in the order of paths, to be added to these; empty once all are followed
  };
  struct OpenLamp {
    std::size_t lamp = 0;
    CausticPaths::Starts starts;
  };
  [[nodiscard]] static std::uint32_t firstPathsOf(const CausticPaths& paths, std::size_t lamp, std::uint32_t leaves);
  [[nodiscard]] std::uint32_t wantedOf(const OfLamp& lamp) const { return lamp.first * times_; }
  [[nodiscard]] const OfLamp* findKnown(std::uint64_t key) const;
  void keepSpare();
  void followSome(OfLamp& known, const OpenLamp& open);
  [[nodiscard]] Leaves follow(const OpenLamp& open, std::size_t half, std::uint32_t first, std::uint32_t end) const;
  [[nodiscard]] Leaf broughtTo(const CausticPaths::Arrival& arrival) const;
  static void merge(Leaves& into, Leaves& fresh);
  void giveUp();

  std::shared_ptr<const LeafRays> rays_;
  std::uint64_t seed_;
  std::size_t most_bytes_;
  Lamps lamps_;
  const LeafShading* shading_ = nullptr;
  std::uint32_t times_ = 1;  ///< as many paths as at first
  bool is_given_up_ = false;
  std::optional<OpenLamp> open_;  ///< whose paths are being followed
  std::vector<OfLamp> known_;     ///< as the lamps are
  std::vector<OfLamp> spare_;     ///< of others, which may come back
};

}  // namespace radiosity::solver
