#include "server/scene/values/leaf_spots.h"

#include <cmath>
#include <glm/common.hpp>

namespace radiosity::scene {
namespace {

/// Halves them, across and up in turn.
void orderByPlace(std::uint32_t points, std::span<LeafSpots::Place> places, bool across = true) {
  if (places.size() < 2) return;
  const auto half = static_cast<std::ptrdiff_t>(places.size() / 2);
  const auto line = [&](const LeafSpots::Place& place) {  // no two are on one
    return across ? std::uint32_t{place.number} : latticeRow(place.number, points);
  };
  std::ranges::nth_element(places, places.begin() + half, {}, line);
  orderByPlace(points, places.first(static_cast<std::size_t>(half)), !across);
  orderByPlace(points, places.subspan(static_cast<std::size_t>(half)), !across);
}

}  // namespace

bool LeafSpots::isNear(std::uint32_t list, const glm::vec2& texel) const {
  constexpr float kSteps = 1.12F;  // to the farthest place between points, but at corners
  const auto view = of(list);
  const float reach = kSteps / std::sqrt(static_cast<float>(view.lattice.points));
  const auto size = glm::max(view.lattice.size, glm::vec2(1e-6F));
  const auto here = (texel - view.lattice.low) / size;
  for (std::uint32_t k = 0; k < countOf(list); ++k) {
    const auto way = latticePoint<glm::vec2>(view.numbers[k], view.lattice.points) - here;
    if (way.x * way.x + way.y * way.y < reach * reach) return true;
  }
  return false;
}

void LeafSpots::order(std::uint32_t points, std::span<Place> places) { orderByPlace(points, places); }

std::uint32_t LeafSpots::add(const Lattice& lattice, std::span<const Place> places, bool in_one_frame) {
  List list{lattice, static_cast<std::uint32_t>(places.size()), numbers_.size()};
  if (!in_one_frame) list.first_triangle = triangles_.size();
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
  orderByPlace(kLeafLattice, places);
  std::array<glm::vec2, kLeafLattice> spots;
  for (std::size_t i = 0; i < kLeafLattice; ++i) spots[i] = lattice.at(places[i].number);
  return spots;
}

}  // namespace

const std::array<glm::vec2, kLeafLattice> kSpotsOfFull = spotsOfFull();

}  // namespace radiosity::scene
