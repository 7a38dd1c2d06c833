// How much a leaf sees of a light polygon, from places of its own: for the few leaves at the edges of shadows that
// points shared by all leaves leave unsure. Immutable; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "server/solver/patches/lights.h"
#include "server/solver/rays/leaf_rays.h"

namespace radiosity::solver {

class LightSight {
 public:
  /// Points of the light that a place looks at, and how many places look at others.
  static constexpr std::size_t kPoints = 32, kSets = 8;

  LightSight(std::shared_ptr<const LeafRays> rays, const LightPolygon& light, std::uint64_t seed);

  /// Irradiance for a radiosity of one, as a link is: mean over a leaf that has area, from so many places of it. Places
  /// and points are Sobol's, scrambled half by half, and leaf by leaf. Nothing where the plane of the leaf cuts the
  /// light, or that of the light the leaf. Surfaces that one can see through hide all. Single precision; a few
  /// microseconds a place.
  [[nodiscard]] std::optional<float> link(std::uint32_t value, std::size_t half, std::uint32_t places) const;

 private:
  std::shared_ptr<const LeafRays> rays_;
  const LightPolygon light_;
  std::uint64_t seed_;
  std::array<std::array<LeafRays::Points, kSets>, 2> points_;  ///< by half
};

}  // namespace radiosity::solver
