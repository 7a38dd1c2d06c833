#include "server/geometry/facing_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace radiosity::scene {
namespace {

constexpr std::uint32_t kFacesALeaf = 4;

}  // namespace

float FacingTree::chordOf(float cosine) { return std::sqrt(2.0F * (1.0F - cosine)) + 1e-3F; }

FacingTree::FacingTree(std::span<const Item> items) : order_(items.size()) {
  if (items.empty()) return;
  std::iota(order_.begin(), order_.end(), 0U);
  nodes_.push_back({{}, 0, static_cast<std::uint32_t>(items.size()), 0});
  for (std::size_t n = 0; n < nodes_.size(); ++n) divide(n, items);
}

void FacingTree::divide(std::size_t n, std::span<const Item> items) {
  const auto first = nodes_[n].first, count = nodes_[n].count;
  Reach reach, middles;
  glm::vec3 sizes(0.0F);
  for (auto i = first; i < first + count; ++i) {
    const Item& item = items[order_[i]];
    const auto middle = 0.5F * (item.low + item.high);
    reach.add(item);
    middles.add({middle, middle, item.normal});
    sizes += item.high - item.low;
  }
  nodes_[n].reach = reach;
  if (count <= kFacesALeaf) return;
  // Walls that lie through each other are parted across them: along them all halves would reach as far.
  const auto place = middles.high - middles.low - sizes / static_cast<float>(count);
  const auto turn = middles.normal_high - middles.normal_low;
  const std::array<float, 6> extent{place.x, place.y, place.z, turn.x, turn.y, turn.z};
  const auto axis = static_cast<int>(std::ranges::max_element(extent) - extent.begin());
  const auto along = [&](std::uint32_t i) {
    return axis < 3 ? items[i].low[axis] + items[i].high[axis] : items[i].normal[axis - 3];
  };
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count,
                   [&](std::uint32_t a, std::uint32_t b) { return along(a) < along(b); });
  nodes_[n].child = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back({{}, first, count / 2, 0});
  nodes_.push_back({{}, first + count / 2, count - count / 2, 0});
}

}  // namespace radiosity::scene
