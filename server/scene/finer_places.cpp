#include "server/scene/finer_places.h"

#include <array>
#include <glm/geometric.hpp>
#include <vector>

namespace radiosity::scene {
namespace {

/// Texels. The lattices' own steps are 0.12 and 0.13, and 0.058 and 0.06, 0.07 and 0.074, 0.086. Of what an edge or a
/// corner hides 0.2 places are taken for what they are not, in the mean; in one step alone, without those beside, and
/// for as many questions, 0.5, and strips of a tenth along the leaf's rim lost a tenth.
constexpr double kAround = 0.11, kBeside = 0.09;

using Around = std::array<std::vector<std::uint8_t>, kLeafLattice>;

Around findAround(std::uint32_t points, double reach) {
  Around around;
  for (std::uint32_t finer = 0; finer < kLeafLattice; ++finer) {
    for (std::uint32_t i = 0; i < points; ++i) {
      const double apart = glm::length(latticePoint(i, points) - latticePoint(finer, kLeafLattice));
      if (apart < reach && (apart > 0.0 || points != kLeafLattice))
        around[finer].push_back(static_cast<std::uint8_t>(i));
    }
  }
  return around;
}

}  // namespace

std::span<const std::uint8_t> coarseAround(std::uint32_t finer) {
  static const Around around = findAround(kCoarsePlaces, kAround);
  return around[finer];
}

std::span<const std::uint8_t> finerAround(std::uint32_t finer) {
  static const Around around = findAround(kLeafLattice, kBeside);
  return around[finer];
}

}  // namespace radiosity::scene
