#include "server/scene/leaf_spots.h"

#include <cmath>

namespace radiosity::scene {
namespace {

/// Halves them, across and up in turn, so that each part of the order is a part of the leaf.
void orderByPlace(const LeafSpots::Lattice& lattice, std::span<LeafSpots::Place> places, int axis = 0) {
  if (places.size() < 2) return;
  const auto half = static_cast<std::ptrdiff_t>(places.size() / 2);
  const auto isBefore = [&](const LeafSpots::Place& a, const LeafSpots::Place& b) {
    const auto p = latticePoint(a.number, lattice.points), q = latticePoint(b.number, lattice.points);
    return p[axis] < q[axis];  // no two are equal
  };
  std::nth_element(places.begin(), places.begin() + half, places.end(), isBefore);
  orderByPlace(lattice, places.first(static_cast<std::size_t>(half)), 1 - axis);
  orderByPlace(lattice, places.subspan(static_cast<std::size_t>(half)), 1 - axis);
}

}  // namespace

float LeafSpots::Lattice::apart() const {
  return 0.72F * std::max(size.x, size.y) / std::sqrt(static_cast<float>(points));
}

std::uint32_t LeafSpots::add(const Lattice& lattice, std::span<Place> places, bool in_one_frame) {
  orderByPlace(lattice, places);
  List list{lattice, static_cast<std::uint32_t>(places.size()), static_cast<std::uint32_t>(numbers_.size())};
  if (!in_one_frame) list.first_triangle = static_cast<std::uint32_t>(triangles_.size());
  for (const auto& place : places) {
    numbers_.push_back(place.number);
    if (!in_one_frame) triangles_.push_back(place.triangle);
  }
  lists_.push_back(list);
  return static_cast<std::uint32_t>(lists_.size() - 1);
}

std::size_t LeafSpots::bytes() const {
  return lists_.size() * sizeof(List) + numbers_.size() * sizeof(numbers_[0]) +
         triangles_.size() * sizeof(triangles_[0]);
}

void LeafSpots::shrinkToFit() {
  visitParts(*this, [](auto& part) { part.shrink_to_fit(); });
}

namespace {

std::array<glm::vec2, kLeafLattice> spotsOfFull() {
  const LeafSpots::Lattice lattice{.points = kLeafLattice};
  std::vector<LeafSpots::Place> places(kLeafLattice);
  for (std::uint32_t i = 0; i < kLeafLattice; ++i) places[i].number = static_cast<std::uint16_t>(i);
  orderByPlace(lattice, places);
  std::array<glm::vec2, kLeafLattice> spots;
  for (std::size_t i = 0; i < kLeafLattice; ++i) spots[i] = lattice.at(places[i].number);
  return spots;
}

}  // namespace

const std::array<glm::vec2, kLeafLattice> kSpotsOfFull = spotsOfFull();

}  // namespace radiosity::scene
