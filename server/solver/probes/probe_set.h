// The probes of one grid: what they remember of the scene, and their light whenever that has changed. Owned by whoever
// tells it to others; one thread outside of the calls.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/solver/probes/probe_lamps.h"
#include "server/solver/probes/probe_rays.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// Unit box. Probe (x, y, z) is number x + counts[0] (y + counts[1] z).
struct ProbeLattice {
  glm::dvec3 first{0.0};
  std::array<glm::dvec3, 3> steps{};
  std::array<std::uint32_t, 3> counts{1, 1, 1};

  [[nodiscard]] std::size_t probeCount() const { return std::size_t{counts[0]} * counts[1] * counts[2]; }
  [[nodiscard]] std::array<std::uint32_t, 3> cellOf(std::size_t probe) const;
  [[nodiscard]] std::size_t numberOf(const std::array<std::uint32_t, 3>& cell) const;
  [[nodiscard]] glm::dvec3 placeOf(std::size_t probe) const;
};

/// Coefficients of the radiance that arrives, nits x sr, in the order of harmonicsOf(), and their standard errors.
struct ProbeLight {
  std::array<glm::vec3, kHarmonics> light{}, error{};
  /// 0: measured there. n: it is inside a solid, or behind walls, and has the mean of the probes beside it of lower n.
  /// kUnfilled: no probe of the grid is measured, and it is black.
  std::uint32_t ring = 0;

  static constexpr std::uint32_t kUnfilled = ~std::uint32_t{0};
};

class ProbeSet {
 public:
  /// A probe is measured where rays meet backs in at most so much of all directions; solids have backs all around.
  static constexpr float kMostBacks = 0.25F;
  /// Rays of a probe: kMostRays, or, of many probes, as many as make kRaysInAll, but kLeastRays.
  static constexpr std::uint32_t kMostRays = 256, kLeastRays = ProbeRays::kLeastRays;
  static constexpr std::size_t kRaysInAll = std::size_t{1} << 24;
  [[nodiscard]] static std::uint32_t raysFor(std::size_t probes);

  /// ProbeRays and ProbeLamps of the grid. `in_all`: probes of all grids, which share the memory that either may take.
  /// Throws what interrupts the task (task.h), and std::bad_alloc.
  ProbeSet(const PlaceLight& light, const ProbeLattice& lattice, std::uint32_t rays, std::uint64_t key,
           std::size_t in_all);
  /// Of one grid alone.
  ProbeSet(const PlaceLight& light, const ProbeLattice& lattice, std::uint32_t rays, std::uint64_t key)
      : ProbeSet(light, lattice, rays, key, lattice.probeCount()) {}
  /// False: mirrors send the least number of rays on too often; no light can be told.
  [[nodiscard]] bool isWithinBounds() const { return rays_.areWithinBounds(); }

  /// False: `light` is of the same scene, but what mirrors and glass do in it is not what the rays remember.
  [[nodiscard]] bool fits(const PlaceLight& light) const { return rays_.fits(light); }
  /// `light`: of the same scene, lit in whatever way, that fits. The same bits as those of a new set. Cost: looks at
  /// lamps that are new or were moved, and a pass over all rays, on all cores.
  /// `systematic`: part of all light that the solve may be off by, alike everywhere, as its halves do not tell: of each
  /// channel, this part of a coefficient, or of what coefficients are as root mean square, is in its error.
  [[nodiscard]] std::vector<ProbeLight> light(const PlaceLight& light, double systematic = 0.0);

  [[nodiscard]] const ProbeSight& sightOf(std::size_t probe) const { return rays_.sightOf(probe); }
  /// Groups of lamps that probes looked at so far.
  [[nodiscard]] std::uint64_t lampsTaken() const { return lamps_.taken(); }

 private:
  ProbeLattice lattice_;
  ProbeRays rays_;
  ProbeLamps lamps_;
};

/// Gives probes whose ring is kUnfilled the mean of those of the 26 around them that have light, by the inverse square
/// of their distance; ring by ring from those that were measured. O(probes).
void fillProbes(const ProbeLattice& lattice, std::vector<ProbeLight>& probes);

}  // namespace radiosity::solver
