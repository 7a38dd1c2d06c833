#include "server/scene/burial/finer_places.h"

#include <glm/geometric.hpp>
#include <vector>

namespace radiosity::scene {
namespace {

/// Texels. The lattices' own steps are 0.12 and 0.13, and 0.058 and 0.06, 0.07 and 0.074, 0.086. Of what an edge or a
/// corner hides 0.2 places are taken for what they are not, in the mean; in one step alone, without those beside, and
/// for as many questions, 0.5, and strips of a tenth along the leaf's rim lost a tenth.
constexpr double kAround = 0.11, kBeside = 0.09, kTogether = 0.14;

using Around = std::vector<std::vector<std::uint8_t>>;

/// Of each of so many points, those of others that are within reach; itself is none of them.
Around findAround(std::uint32_t of, std::uint32_t points, double reach) {
  Around around(of);
  for (std::uint32_t one = 0; one < of; ++one) {
    for (std::uint32_t i = 0; i < points; ++i) {
      if ((of != points || i != one) && glm::length(latticePoint(i, points) - latticePoint(one, of)) < reach)
        around[one].push_back(static_cast<std::uint8_t>(i));
    }
  }
  return around;
}

}  // namespace

std::span<const std::uint8_t> coarseAround(std::uint32_t finer) {
  static const Around around = findAround(kLeafLattice, kCoarsePlaces, kAround);
  return around[finer];
}

std::span<const std::uint8_t> finerAround(std::uint32_t finer) {
  static const Around around = findAround(kLeafLattice, kLeafLattice, kBeside);
  return around[finer];
}

std::span<const std::uint8_t> coarseBeside(std::uint32_t coarse) {
  static const Around around = findAround(kCoarsePlaces, kCoarsePlaces, kTogether);
  return around[coarse];
}

}  // namespace radiosity::scene
