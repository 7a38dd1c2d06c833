#include "server/gpu/view_window.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace radiosity::gpu {
namespace {

/// Directions this far from the middle (cosine) are too far for a pyramid.
constexpr float kWidest = 0.35F;
/// Planes steeper than this leave out next to nothing; rad from the middle.
constexpr float kSteepest = 1.4F;

/// What of a box is before a plane, as points whose hull holds it.
void addBox(const scene::ChangedBox& box, const solver::HemicubeFrame& eye, std::vector<glm::vec3>& directions) {
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
  float low = 1e30F, high = -1e30F;
  void add(float tangent) {
    low = std::min(low, tangent);
    high = std::max(high, tangent);
  }
  [[nodiscard]] float largest() const { return std::max(std::abs(low), std::abs(high)); }
};

}  // namespace

std::optional<ViewWindow> windowAround(const solver::HemicubeFrame& eye, std::span<const glm::vec3> points,
                                       std::span<const scene::ChangedBox> boxes, float margin_rad) {
  thread_local std::vector<glm::vec3> directions;
  directions.clear();
  for (const auto& point : points) directions.push_back(point - eye.origin);
  for (const auto& box : boxes) addBox(box, eye, directions);
  glm::vec3 sum(0.0F);
  for (auto& d : directions) {
    const float length = glm::length(d);
    if (!(length > 0.0F)) return std::nullopt;
    d /= length;
    sum += d;
  }
  if (!(glm::length(sum) > 0.0F)) return std::nullopt;
  const glm::vec3 axis = glm::normalize(sum);
  // Most things stand upright, and so does a pyramid that fits them.
  const glm::vec3 helper = std::abs(axis.y) < 0.9F ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0);
  const glm::vec3 right = glm::normalize(glm::cross(helper, axis)), up = glm::cross(axis, right);
  Extent across, along;
  for (const auto& d : directions) {
    const float depth = glm::dot(d, axis);
    if (depth < kWidest) return std::nullopt;
    across.add(glm::dot(d, right) / depth);
    along.add(glm::dot(d, up) / depth);
  }
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

}  // namespace radiosity::gpu
