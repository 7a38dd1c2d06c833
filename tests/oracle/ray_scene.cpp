#include "tests/oracle/ray_scene.h"

#include <cmath>
#include <numeric>

namespace radiosity::oracle {
namespace {

/// Boxes are so much wider than what they hold: rounding of doubles.
constexpr double kRounding = 1e-13;

}  // namespace

RayScene::RayScene(std::span<const Triangle> triangles) : order_(triangles.size()) {
  measure(triangles);
  std::vector<Corners> corners;
  std::vector<glm::dvec3> middles;
  for (const auto& triangle : triangles) {
    const auto a = toUnit(triangle.corners[0]), b = toUnit(triangle.corners[1]), c = toUnit(triangle.corners[2]);
    corners.push_back({a, b - a, c - a});
    middles.push_back((a + b + c) / 3.0);
  }
  std::iota(order_.begin(), order_.end(), 0U);
  corners_ = corners;
  if (!triangles.empty()) build(0, static_cast<std::uint32_t>(triangles.size()), middles);
  for (std::size_t at = 0; at < order_.size(); ++at) corners_[at] = corners[order_[at]];
}

void RayScene::measure(std::span<const Triangle> triangles) {
  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high(-low);
  for (const auto& triangle : triangles) {
    for (const auto& corner : triangle.corners) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  if (triangles.empty()) return;
  centre_ = 0.5 * (low + high);
  const auto size = high - low;
  scale_ = 2.0 / std::max({size.x, size.y, size.z});
}

/// Cut where triangles times surface are least, at one of thirteen places along the longest side of their middles; in
/// halves where they lie in one place. An eighth is left on either side, so that depth is bounded. `corners_` are in
/// the order of the file until all is built.
void RayScene::build(std::uint32_t first, std::uint32_t end, std::span<const glm::dvec3> middles) {
  const auto index = nodes_.size();
  const std::span order(order_.data() + first, end - first);
  const auto boxOf = [&](std::span<const std::uint32_t> some) {
    std::array<glm::dvec3, 2> box{glm::dvec3(HUGE_VAL), glm::dvec3(-HUGE_VAL)};
    for (const auto t : some) {
      const auto& [a, ab, ac] = corners_[t];
      for (const auto& corner : {a, a + ab, a + ac}) box = {glm::min(box[0], corner), glm::max(box[1], corner)};
    }
    return box;
  };
  const auto [low, high] = boxOf(order);
  nodes_.push_back({{low - kRounding, high + kRounding}, first, end - first});
  if (end - first <= kLeaf) return;
  glm::dvec3 least(HUGE_VAL), most(-HUGE_VAL);
  for (const auto t : order) least = glm::min(least, middles[t]), most = glm::max(most, middles[t]);
  const auto size = most - least;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return middles[a][axis] != middles[b][axis] ? middles[a][axis] < middles[b][axis] : a < b;
  });
  const auto cost = [&](std::span<const std::uint32_t> some) {
    const auto box = boxOf(some);
    const auto d = box[1] - box[0];
    return (d.x * d.y + d.y * d.z + d.z * d.x) * static_cast<double>(some.size());
  };
  constexpr std::size_t kPlaces = 16;
  std::size_t middle = order.size() / 2;
  double lowest = HUGE_VAL;
  for (std::size_t place = 2; place + 1 < kPlaces && size[axis] > 0.0; ++place) {
    const auto cut = std::max<std::size_t>(1, place * order.size() / kPlaces);
    const double here = cost(order.first(cut)) + cost(order.subspan(cut));
    if (here < lowest) lowest = here, middle = cut;
  }
  const auto cut = first + static_cast<std::uint32_t>(middle);
  build(first, cut, middles);
  nodes_[index].first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[index].count = 0;
  build(cut, end, middles);
}

bool RayScene::blocked(const glm::dvec3& from, const glm::dvec3& way) const {
  bool met_any = false;
  visit(from, way, 1.0, [&](const Met&) { return met_any = true; });
  return met_any;
}

}  // namespace radiosity::oracle
