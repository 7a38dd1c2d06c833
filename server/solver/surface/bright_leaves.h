// Leaves that send far more light than most, such as the outside of a lamp's shade and what the sun shines on: places
// look for those, since rays in all directions seldom meet them. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"

namespace radiosity::solver {

class BrightLeaves {
 public:
  /// `radiosity`: lm/m^2, by leaf value; `mirrors` may be null. Nothing where those that are so bright send next to
  /// nothing together. O(leaves).
  [[nodiscard]] static std::optional<BrightLeaves> find(const scene::PatchScene& patches, const LeafRays& rays,
                                                        std::span<const glm::vec3> radiosity,
                                                        const SpecularLeaves* mirrors);

  /// A place of one of them, drawn by flux: `u` draws the leaf, `at` where on it, both in [0, 1).
  [[nodiscard]] LeafRays::Place draw(const LeafRays& rays, double u, const glm::dvec2& at) const;
  /// Chance of a place there to be drawn, by area (unit box); 0 on all other leaves. Of leaves of which a part is
  /// hidden spots are drawn, which stand for that.
  [[nodiscard]] double density(std::uint32_t value) const { return density_[value]; }

 private:
  BrightLeaves() = default;

  std::vector<float> density_;  ///< by leaf value
  std::vector<std::uint32_t> values_;
  std::vector<double> up_to_;  ///< chance of these and all before
};

/// Samples of two ways to find what shines at a place: rays by the cosine, and looks at places of BrightLeaves. What
/// either finds is weighed by what both would find it with (Veach and Guibas 1995, the balance heuristic).
struct SampleCounts {
  std::uint32_t rays = 0, looks = 0;

  /// Of the radiosity at a place `distance` away: what one sample brings, irradiance. The cosines are those of the
  /// direction with the normals of the receiver, geometric and shading, and with that of the place.
  [[nodiscard]] double weight(double cosine, double shading, double leaves, double distance, double density) const;
};

}  // namespace radiosity::solver
