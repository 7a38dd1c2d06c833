// What probes see in all directions: rays that are cast once and remember which leaf, or which part of the sky, sends
// light along them. Whatever the light is by then, a sum over them is its spherical harmonics. Immutable once made; any
// thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "server/solver/probes/spherical_harmonics.h"
#include "server/solver/surface/mirror_walk.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// Coefficients of incident radiance, and the variance of each, by channel.
struct ProbeSums {
  std::array<glm::dvec3, kHarmonics> mean{}, variance{};
};

/// What lies around a probe; unit box.
struct ProbeSight {
  static constexpr std::size_t kLobes = 6;  ///< about +X, -X, +Y, -Y, +Z, -Z
  /// Distance to the nearest surface, and its square, as means over directions that count by the square of their cosine
  /// with the axis of a lobe. Where nothing is met it is kFarthest.
  std::array<float, kLobes> distance{}, square{};
  float nearest = 0.0F;  ///< of all rays
  float backs = 0.0F;    ///< part of all directions in which backs of surfaces are met

  static constexpr float kFarthest = 4.0F;  ///< farther than the unit box is wide
};

class ProbeRays {
 public:
  /// Independent of each other; their scatter tells the variance.
  static constexpr std::uint32_t kRounds = 8;

  /// `places`: unit box. `rays`: of a probe, a multiple of kRounds and geometry::kPacket. The same key gives the same
  /// bits, whatever the number of threads. Cost: these rays, and those that mirrors reflect, on all cores; 8 bytes a
  /// ray, and as many for each mirror on its way, 20 where mirrors or coloured glass take light. Where that would be
  /// more than `most_ends` ends of rays, half as many rays are cast, down to kLeastRays; each try costs at most as
  /// many. Throws what interrupts the task (task.h), and std::bad_alloc.
  ProbeRays(const PlaceLight& light, std::span<const glm::dvec3> places, std::uint32_t rays, std::uint64_t key,
            std::size_t most_ends = kMostEnds);

  /// 640 MiB where mirrors take light.
  static constexpr std::size_t kMostEnds = std::size_t{1} << 25;
  static constexpr std::uint32_t kLeastRays = 64;
  /// False: mirrors make too many ends even of kLeastRays; nothing is kept, and only this may be asked.
  [[nodiscard]] bool areWithinBounds() const { return rays_ > 0; }
  [[nodiscard]] std::size_t probeCount() const { return sights_.size(); }
  [[nodiscard]] const ProbeSight& sightOf(std::size_t probe) const { return sights_[probe]; }
  /// False: rays go other ways than these in the mirrors and the glass that `light` has.
  [[nodiscard]] bool fits(const PlaceLight& light) const { return mirror_key_ == mirrorKeyOf(light); }

  /// Radiance that arrives along rays, by what they remember; w: what the sum of its channels is off by, one standard
  /// deviation of either sign.
  using Radiance = std::vector<glm::vec4>;
  /// Of the same scene, lit in whatever way. O(leaves).
  [[nodiscard]] static Radiance radianceOf(const PlaceLight& light);
  /// What arrives at a probe but for lamps' direct light. The variance has two parts: the scatter of rounds, and what
  /// the radiance is off by: the mean square over all coefficients, which are as likely to be off, shared out by
  /// channel as the light is. O(rays), some 15 ns each.
  [[nodiscard]] ProbeSums gather(std::size_t probe, const Radiance& radiance) const;

 private:
  struct Part;  ///< of probes that are traced together
  [[nodiscard]] bool cast(const PlaceLight& light, std::span<const glm::dvec3> places, std::uint64_t key,
                          std::size_t most_ends);
  void trace(const PlaceLight& light, const glm::dvec3& place, std::uint64_t key, Part& part) const;
  void traceRound(const PlaceLight& light, const glm::dvec3& place, std::uint64_t key, Part& part,
                  ProbeSight& sight) const;
  [[nodiscard]] std::array<glm::dvec4, kHarmonics> gatherRound(std::size_t number, const Radiance& radiance) const;
  void keep(std::vector<Part> parts);
  [[nodiscard]] static std::uint64_t mirrorKeyOf(const PlaceLight& light);

  std::uint32_t rays_ = 0;
  std::uint64_t mirror_key_ = 0;
  std::vector<ProbeSight> sights_;
  // By ray, or by leaf on the way of one: its ends.
  std::vector<std::uint32_t> from_;       ///< into Radiance
  std::vector<std::uint32_t> direction_;  ///< packed
  std::vector<glm::vec3> part_;           ///< what is left of the light; empty: all of it, everywhere
  std::vector<std::uint64_t> first_;      ///< of these, by probe and round; one more at the end
};

}  // namespace radiosity::solver
