#include "server/gpu/cull/view_window.h"

#include <algorithm>
#include <cmath>
#include <glm/vec4.hpp>
#include <vector>

#include "common/clones.h"

namespace radiosity::gpu {
namespace {

/// Directions this far from the middle (cosine) are too far for a pyramid.
constexpr float kWidest = 0.35F;
/// Planes steeper than this leave out next to nothing; rad from the middle.
constexpr float kSteepest = 1.4F;

constexpr std::size_t kLanes = 8;

/// Directions from the eye, as many as fill all lanes.
struct Directions {
  std::vector<float> x, y, z;
  void clear() {
    for (auto* values : {&x, &y, &z}) values->clear();
  }
  void push_back(const glm::vec3& d) {
    x.push_back(d.x);
    y.push_back(d.y);
    z.push_back(d.z);
  }
  void fillLanes() {
    while (x.size() % kLanes != 0) push_back({x.back(), y.back(), z.back()});
  }
};

/// To length one. Returns their sum, and the square of the shortest length that was there.
RADIOSITY_CLONES glm::vec4 normalizeAll(float* x, float* y, float* z, std::size_t count) {
  float sum[3][kLanes] = {}, shortest[kLanes];
  for (float& square : shortest) square = 1e30F;
  for (std::size_t i = 0; i < count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float square = x[i + k] * x[i + k] + y[i + k] * y[i + k] + z[i + k] * z[i + k];
      const float part = 1.0F / std::sqrt(square);
      shortest[k] = square < shortest[k] ? square : shortest[k];
      sum[0][k] += x[i + k] *= part;
      sum[1][k] += y[i + k] *= part;
      sum[2][k] += z[i + k] *= part;
    }
  }
  glm::vec4 all(0.0F, 0.0F, 0.0F, 1e30F);
  for (std::size_t k = 0; k < kLanes; ++k) {
    all += glm::vec4(sum[0][k], sum[1][k], sum[2][k], 0.0F);
    all.w = std::min(all.w, shortest[k]);
  }
  return all;
}

struct PyramidAxes {
  glm::vec3 axis, right, up;
};

/// Least depth along the axis, and least and greatest tangents to the right and upwards, of directions of length one.
struct Spread {
  float depth = 1e30F, left = 1e30F, right = -1e30F, below = 1e30F, above = -1e30F;
};

RADIOSITY_CLONES void spreadOf(const PyramidAxes& axes, const float* x, const float* y, const float* z,
                               std::size_t count, Spread& spread) {
  const auto [a, r, u] = axes;
  float depth[kLanes], left[kLanes], right[kLanes], below[kLanes], above[kLanes];
  for (std::size_t k = 0; k < kLanes; ++k) {
    depth[k] = left[k] = below[k] = 1e30F;
    right[k] = above[k] = -1e30F;
  }
  for (std::size_t i = 0; i < count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float dx = x[i + k], dy = y[i + k], dz = z[i + k];
      const float d = dx * a.x + dy * a.y + dz * a.z;
      const float across = (dx * r.x + dy * r.y + dz * r.z) / d, along = (dx * u.x + dy * u.y + dz * u.z) / d;
      depth[k] = d < depth[k] ? d : depth[k];
      left[k] = across < left[k] ? across : left[k];
      right[k] = across > right[k] ? across : right[k];
      below[k] = along < below[k] ? along : below[k];
      above[k] = along > above[k] ? along : above[k];
    }
  }
  for (std::size_t k = 0; k < kLanes; ++k) {
    spread = {std::min(spread.depth, depth[k]), std::min(spread.left, left[k]), std::max(spread.right, right[k]),
              std::min(spread.below, below[k]), std::max(spread.above, above[k])};
  }
}

/// What of a box is before a plane, as points whose hull holds it.
void addBox(const scene::ChangedBox& box, const solver::HemicubeFrame& eye, Directions& directions) {
  std::array<glm::vec3, 8> corner{};
  float low = 1e30F, high = -1e30F;
  for (std::size_t c = 0; c < 8; ++c) {
    corner[c] = glm::vec3((c & 1U) != 0 ? box.high.x : box.low.x, (c & 2U) != 0 ? box.high.y : box.low.y,
                          (c & 4U) != 0 ? box.high.z : box.low.z) -
                eye.origin;
    low = std::min(low, glm::dot(corner[c], eye.normal));
    high = std::max(high, glm::dot(corner[c], eye.normal));
  }
  if (high <= 0.0F) return;
  for (const auto& c : corner) {
    const float height = glm::dot(c, eye.normal);
    if (height > 0.0F) directions.push_back(c);
    if (low < 0.0F) directions.push_back(c - height * eye.normal);
  }
}

/// Low and high tangent of the angle from the axis towards `across`.
struct Extent {
  float low, high;
  [[nodiscard]] float largest() const { return std::max(std::abs(low), std::abs(high)); }
};

}  // namespace

std::optional<ViewWindow> windowAround(const solver::HemicubeFrame& eye, std::span<const glm::vec3> points,
                                       std::span<const scene::ChangedBox> boxes, float margin_rad) {
  thread_local Directions directions;
  directions.clear();
  for (const auto& point : points) directions.push_back(point - eye.origin);
  for (const auto& box : boxes) addBox(box, eye, directions);
  if (directions.x.empty()) return std::nullopt;
  directions.fillLanes();
  auto &x = directions.x, &y = directions.y, &z = directions.z;
  const auto sum = normalizeAll(x.data(), y.data(), z.data(), x.size());
  if (!(sum.w > 0.0F) || !(glm::length(glm::vec3(sum)) > 0.0F)) return std::nullopt;
  const glm::vec3 axis = glm::normalize(glm::vec3(sum));
  // Most things stand upright, and so does a pyramid that fits them.
  const glm::vec3 helper = std::abs(axis.y) < 0.9F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0);
  const glm::vec3 right = glm::normalize(glm::cross(helper, axis)), up = glm::cross(axis, right);
  Spread spread;
  spreadOf({axis, right, up}, x.data(), y.data(), z.data(), x.size(), spread);
  if (!(spread.depth >= kWidest)) return std::nullopt;
  const Extent across{spread.left, spread.right}, along{spread.below, spread.above};
  ViewWindow window;
  // Far along the other way, the same angle from a plane through it is more angle about it.
  const auto planes = [&](const Extent& extent, const Extent& other, const glm::vec3& towards, std::size_t first) {
    const float margin = margin_rad * std::sqrt(1.0F + other.largest() * other.largest());
    const float high = std::min(std::atan(extent.high) + margin, kSteepest);
    const float low = std::max(std::atan(extent.low) - margin, -kSteepest);
    window.planes[first] = std::sin(high) * axis - std::cos(high) * towards;
    window.planes[first + 1] = std::cos(low) * towards - std::sin(low) * axis;
    return high < kSteepest && low > -kSteepest;
  };
  const bool narrow_across = planes(across, along, right, 0), narrow_along = planes(along, across, up, 2);
  if (!narrow_across || !narrow_along) return std::nullopt;
  return window;
}

PixelSpan pixelsInside(const ViewWindow& window, const solver::HemicubeFrame& frame, std::uint32_t resolution,
                       std::uint32_t row) {
  const auto axes = hemicubeAxes(frame);
  const auto [across, up] = latticePhase(frame.lattice);
  const auto size = static_cast<float>(resolution), half = 0.5F * size;
  const auto face = row < resolution ? 0 : 1 + (row - resolution) / (resolution / 2);
  const auto line = static_cast<float>(face == 0 ? row : (row - resolution) % (resolution / 2));
  const float height = (line + static_cast<float>(up)) / half;
  // Along a row the direction is start + column x step, in a plane at distance 1.
  const std::array<glm::vec3, 5> depth = {axes.normal, axes.tangent, -axes.tangent, axes.bitangent, -axes.bitangent};
  const auto& sideways = face == 1 || face == 2 ? axes.bitangent : axes.tangent;
  const auto rising = face == 0 ? (height - 1.0F) * axes.bitangent : height * axes.normal;
  const glm::vec3 step = sideways / half;
  const glm::vec3 start = depth[face] + rising + (static_cast<float>(across) / half - 1.0F) * sideways;
  float first = 0.0F, last = size - 1.0F;
  for (const auto& plane : window.planes) {
    const float at = glm::dot(plane, start), slope = glm::dot(plane, step);
    if (std::abs(slope) < 1e-12F) {
      if (at < 0.0F) return {0, 0};
    } else if (slope > 0.0F) {
      first = std::max(first, std::ceil(-at / slope));
    } else {
      last = std::min(last, std::floor(-at / slope));
    }
  }
  if (!(first <= last)) return {0, 0};
  return {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last) + 1};
}

PixelRectangle pixelsAround(const ViewWindow& window, const solver::HemicubeFrame& frame, std::uint32_t resolution,
                            std::size_t face) {
  const auto rows = face == 0 ? resolution : resolution / 2;
  const auto low = face == 0 ? 0 : resolution + (static_cast<std::uint32_t>(face) - 1) * (resolution / 2);
  PixelRectangle around{glm::uvec2(resolution, low + rows), glm::uvec2(0)};
  for (auto row = low; row < low + rows; ++row) {
    const auto inside = pixelsInside(window, frame, resolution, row);
    if (inside.first == inside.end) continue;
    around.first = {std::min(around.first.x, inside.first), std::min(around.first.y, row)};
    around.end = {std::max(around.end.x, inside.end), row + 1};
  }
  if (around.end.x == 0) return {};
  around.first = {around.first.x - std::min(around.first.x, 1U), std::max(around.first.y, low + 1) - 1};
  around.end = {std::min(around.end.x + 1, resolution), std::min(around.end.y + 1, low + rows)};
  return around;
}

}  // namespace radiosity::gpu
