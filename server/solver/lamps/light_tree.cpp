#include "server/solver/lamps/light_tree.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>
#include <utility>

#include "common/clones.h"

namespace radiosity::solver {
namespace {

/// A node is cut at one of so many places along its longest side.
constexpr std::uint32_t kBins = 16;
/// Bounds of sines and cosines lie so far beside what rounding leaves of them: no light that shines is left out.
constexpr float kSpare = 1e-4F;
/// Of the largest child: what bounds say of another may be far too little, and few draws of great weight are worse than
/// a few in vain.
constexpr float kLeastShare = 0.01F;
/// Squares of distances that are no less, so that nothing is divided by 0.
constexpr float kTiny = 1e-24F;
constexpr double kBelowOne = 0x1.fffffffffffffp-1;

float sineOf(float cosine) { return std::sqrt(std::max(0.0F, 1.0F - cosine * cosine)); }

/// Whether a + b is more than half a turn, and the cosine of that.
std::pair<bool, float> cosineOfSum(float cos_a, float sin_a, float cos_b, float sin_b) {
  return {sin_a * cos_b + cos_a * sin_b < 0.0F, cos_a * cos_b - sin_a * sin_b};
}

struct Cone {
  glm::vec3 axis;
  float cosine;
};

/// Around both; below a cosine of 0 nothing is gained by knowing it.
Cone join(const Cone& a, const Cone& b) {
  if (a.cosine < 0.0F || b.cosine < 0.0F) return {a.axis, -1.0F};
  const auto sum = a.axis + b.axis;
  const float length = glm::length(sum);
  if (!(length > 1e-3F)) return {a.axis, -1.0F};
  const auto axis = sum / length;
  const auto widest = [&](const Cone& cone) {
    const float between = std::min(1.0F, glm::dot(axis, cone.axis));
    const auto [beyond, cosine] = cosineOfSum(between, sineOf(between), cone.cosine, sineOf(cone.cosine));
    return beyond ? -1.0F : cosine;
  };
  return {axis, std::min(widest(a), widest(b))};
}

}  // namespace

struct LightTree::Half {
  std::uint32_t first = 0, end = 0;  ///< into order_
  std::size_t child = 0;             ///< the first of two; 0: it is one light
  Bounds bounds;
};

LightTree::LightTree(std::vector<LightPolygon> lights, std::span<const float> strengths)
    : lights_(std::move(lights)), strengths_(strengths.begin(), strengths.end()), order_(lights_.size()) {
  for (std::uint32_t i = 0; i < lights_.size(); ++i) {
    middles_.emplace_back(lights_[i].ball());
    flux_before_.push_back(flux_);
    flux_ += lights_[i].area * strength(i);
  }
  std::iota(order_.begin(), order_.end(), 0U);
  if (lights_.empty()) return;
  std::vector<Half> halves{{0, static_cast<std::uint32_t>(order_.size()), 0, around(order_)}};
  for (std::size_t at = 0; at < halves.size(); ++at) split(halves, at);
  (void)addNode(halves, 0);
  order_ = {};
  middles_ = {};
}

LightTree::Bounds LightTree::around(std::span<const std::uint32_t> lights) const {
  Bounds bounds;
  bounds.low = glm::vec3(HUGE_VALF), bounds.high = glm::vec3(-HUGE_VALF);
  Cone cone{lights_[lights.front()].normal, 1.0F};
  double flux = 0.0;
  for (const auto i : lights) {
    const auto& light = lights_[i];
    for (std::uint32_t k = 0; k < light.corner_count; ++k) {
      bounds.low = glm::min(bounds.low, light.corners[k]);
      bounds.high = glm::max(bounds.high, light.corners[k]);
    }
    cone = join(cone, {light.normal, 1.0F});
    flux += light.area * strength(i);
    bounds.largest = std::max(bounds.largest, static_cast<float>(light.area));
  }
  bounds.axis = cone.axis;
  bounds.cosine = lights.size() > 1 ? std::max(-1.0F, cone.cosine - kSpare) : cone.cosine;
  bounds.flux = static_cast<float>(flux);
  return bounds;
}

/// Where flux times the surface of the bounds, summed over both parts, is least. An eighth of the lights at least lies
/// on either side, so that depth is bounded.
void LightTree::split(std::vector<Half>& halves, std::size_t at) {
  const auto [first, end] = std::pair(halves[at].first, halves[at].end);
  const auto count = end - first;
  if (count == 1) return;
  const std::span order(order_.data() + first, count);
  glm::vec3 low(HUGE_VALF), high(-HUGE_VALF);
  for (const auto i : order) low = glm::min(low, middles_[i]), high = glm::max(high, middles_[i]);
  const auto size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
    return middles_[a][axis] != middles_[b][axis] ? middles_[a][axis] < middles_[b][axis] : a < b;
  });
  const auto cost = [](const Bounds& bounds) {
    const auto d = bounds.high - bounds.low;
    const float turned = bounds.cosine < 0.0F ? 2.0F : 1.0F - 0.5F * bounds.cosine;  // wider cones tell less
    return bounds.flux * (d.x * d.y + d.y * d.z + d.z * d.x) * turned;
  };
  const auto least = std::max(1U, count / 8);
  Half left, right;
  float lowest = HUGE_VALF;
  for (std::uint32_t bin = 1; bin < kBins; ++bin) {
    const auto cut = std::clamp(static_cast<std::uint32_t>(std::uint64_t{bin} * count / kBins), least, count - least);
    const auto before = around(order.first(cut)), after = around(order.subspan(cut));
    if (const float here = cost(before) + cost(after); here < lowest || bin == 1) {
      lowest = here;
      left = {first, first + cut, 0, before};
      right = {first + cut, end, 0, after};
    }
  }
  halves[at].child = halves.size();
  halves.push_back(left);
  halves.push_back(right);
}

/// Of the largest of its descendants, by flux.
std::uint32_t LightTree::addNode(const std::vector<Half>& halves, std::size_t at) {
  std::vector<std::size_t> children{at};
  while (children.size() < kChildren) {
    const auto largest = std::ranges::max_element(
        children, {}, [&](std::size_t c) { return halves[c].child != 0 ? halves[c].bounds.flux : -1.0F; });
    const auto first = halves[*largest].child;
    if (first == 0) break;
    *largest = first;
    children.push_back(first + 1);
  }
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  for (std::size_t k = 0; k < children.size(); ++k) {
    const auto& half = halves[children[k]];
    const auto child = half.child == 0 ? kLight | order_[half.first] : addNode(halves, children[k]);
    auto& node = nodes_[index];
    const auto middle = 0.5F * (half.bounds.low + half.bounds.high), size = half.bounds.high - half.bounds.low;
    node.x[k] = middle.x, node.y[k] = middle.y, node.z[k] = middle.z;
    node.radius_square[k] = 0.25F * glm::dot(size, size);
    node.axis_x[k] = half.bounds.axis.x, node.axis_y[k] = half.bounds.axis.y, node.axis_z[k] = half.bounds.axis.z;
    node.cosine[k] = half.bounds.cosine;
    node.sine[k] = sineOf(half.bounds.cosine);
    node.half_x[k] = 0.5F * size.x, node.half_y[k] = 0.5F * size.y, node.half_z[k] = 0.5F * size.z;
    node.largest[k] = half.bounds.largest;
    node.flux[k] = half.bounds.flux;
    node.child[k] = child;
  }
  return index;
}

/// By child: flux over the square of the distance, times the greatest cosines that may be there, at the receiver and at
/// a light. Angles are widened by that under which the child is seen, so that it is more than 0 wherever any light of
/// the child shines at the receiver. Written to be vectorised.
RADIOSITY_CLONES void LightTree::importance(const Node& node, const glm::vec3& position, const glm::vec3& normal,
                                            float* of_child) {
  const float px = position.x, py = position.y, pz = position.z, nx = normal.x, ny = normal.y, nz = normal.z;
  const auto larger = [](float a, float b) { return a > b ? a : b; };
  const auto smaller = [](float a, float b) { return a < b ? a : b; };
  for (std::size_t k = 0; k < kChildren; ++k) {
    const float x = node.x[k] - px, y = node.y[k] - py, z = node.z[k] - pz;
    const float radius = node.radius_square[k], square = larger(x * x + y * y + z * z, kTiny);
    const float scale = 1.0F / std::sqrt(square);
    const float sin_seen = smaller(1.0F, std::sqrt(radius) * scale + kSpare);
    const float cos_seen = std::sqrt(larger(0.0F, 1.0F - sin_seen * sin_seen));
    const float cos_at = larger(-1.0F, smaller(1.0F, (nx * x + ny * y + nz * z) * scale));
    const float sin_at = std::sqrt(larger(0.0F, 1.0F - cos_at * cos_at));
    const float arrives = cos_at > cos_seen ? 1.0F : cos_at * cos_seen + sin_at * sin_seen;
    const float along = node.axis_x[k] * x + node.axis_y[k] * y + node.axis_z[k] * z;
    const float cos_out = larger(-1.0F, smaller(1.0F, -along * scale));
    const float sin_out = std::sqrt(larger(0.0F, 1.0F - cos_out * cos_out));
    const float beyond =
        node.sine[k] * cos_seen + node.cosine[k] * sin_seen;  // sine of a sum: below 0 past a half turn
    const float sum = node.cosine[k] * cos_seen - node.sine[k] * sin_seen;
    const float cos_spread = beyond < 0.0F ? -1.0F : sum;
    const float sin_spread = beyond < 0.0F ? 0.0F : beyond;
    const float leaves = cos_out > cos_spread ? 1.0F : cos_out * cos_spread + sin_out * sin_spread;
    const float outside = larger(arrives, 0.0F) * larger(leaves, 0.0F);
    const float angles = square <= radius ? 1.0F : outside;
    of_child[k] = node.flux[k] * angles / larger(square, radius);
  }
}

LightTree::Draw LightTree::draw(const glm::vec3& position, const glm::vec3& normal, double u) const {
  Draw draw{scene::kNone, 1.0};
  if (nodes_.empty()) return draw;
  std::uint32_t at = 0;
  while ((at & kLight) == 0) {
    std::array<float, kChildren> share;
    importance(nodes_[at], position, normal, share.data());
    float largest = 0.0F;
    double sum = 0.0;
    for (const float s : share) largest = std::max(largest, s);
    if (!(largest > 0.0F)) return {};
    for (float& s : share) {
      if (s > 0.0F) s = std::max(s, kLeastShare * largest);
      sum += static_cast<double>(s);
    }
    double left = u * sum;
    std::size_t chosen = kChildren;
    for (std::size_t k = 0; k < kChildren; ++k) {
      if (!(share[k] > 0.0F)) continue;
      chosen = k;
      if (left < static_cast<double>(share[k])) break;
      left -= static_cast<double>(share[k]);
    }
    const auto chance = static_cast<double>(share[chosen]);
    draw.chance *= chance / sum;
    u = std::clamp(left / chance, 0.0, kBelowOne);
    at = nodes_[at].child[chosen];
  }
  draw.light = at & ~kLight;
  return draw;
}

bool LightTree::findNear(const glm::vec3& position, float form_factor, std::size_t most,
                         std::vector<std::uint32_t>& lights) const {
  lights.clear();
  std::vector<std::uint32_t> waiting;
  if (!nodes_.empty()) waiting.push_back(0);
  while (!waiting.empty()) {
    const Node& node = nodes_[waiting.back()];
    waiting.pop_back();
    for (std::size_t k = 0; k < kChildren; ++k) {
      const float x = std::max(0.0F, std::abs(node.x[k] - position.x) - node.half_x[k]);
      const float y = std::max(0.0F, std::abs(node.y[k] - position.y) - node.half_y[k]);
      const float z = std::max(0.0F, std::abs(node.z[k] - position.z) - node.half_z[k]);
      const float square = x * x + y * y + z * z;
      if (!(node.largest[k] > form_factor * std::numbers::pi_v<float> * square)) continue;
      if ((node.child[k] & kLight) == 0) {
        waiting.push_back(node.child[k]);
        continue;
      }
      if (lights.size() == most) return false;
      lights.push_back(node.child[k] & ~kLight);
    }
  }
  return true;
}

std::uint32_t LightTree::byFlux(double& u) const {
  const double at = u * flux_;
  const auto after = std::ranges::upper_bound(flux_before_, at);
  const auto light = static_cast<std::uint32_t>(after - flux_before_.begin()) - 1;
  u = std::clamp((at - flux_before_[light]) / (lights_[light].area * strength(light)), 0.0, kBelowOne);
  return light;
}

}  // namespace radiosity::solver
