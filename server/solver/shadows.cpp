#include "server/solver/shadows.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace radiosity::solver {
namespace {

/// What lies this little (unit box) before a plane may be rounding: it is seen from there.
constexpr float kInFront = -5e-7F;
/// A leaf of a curved surface may reach so much farther than the frame of one of its triangles tells.
constexpr float kCurved = 2.0F;
/// Half a pixel's diagonal, in widths of a pixel, and room for rounding.
constexpr float kHalfDiagonal = 0.7072F;

scene::ChangedBox nothing() { return {glm::vec3(1e30F), glm::vec3(-1e30F)}; }

void include(scene::ChangedBox& box, const glm::vec3& centre, float radius) {
  box.low = glm::min(box.low, centre - radius);
  box.high = glm::max(box.high, centre + radius);
}

}  // namespace

Shadows::Shadows(const scene::PatchScene& patches, const std::vector<Side>& sides, GeometryChange change)
    : patches_(patches),
      sides_(sides),
      change_(std::move(change)),
      all_(change_.boxes),
      side_altered_(sides.size(), false),
      ball_(patches.nodeCount()) {
  auto altered = nothing();
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const Side& side = sides_[s];
    enclose(side);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      if (!change_.altered[side.first_value + leaf]) continue;
      side_altered_[s] = true;
      const auto& ball = ball_[side.first_node + leaf];
      if (ball.radius >= 0.0F) include(altered, ball.centre, ball.radius);
    }
  }
  if (altered.low.x <= altered.high.x) all_.push_back(altered);
}

/// Balls around the nodes of a side, from the leaves up.
void Shadows::enclose(const Side& side) {
  const auto& surface = patches_.surfaces[side.surface];
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto triangle = patches_.leaves[surface.first_leaf + leaf].triangle;
    if (triangle == scene::kNone) continue;
    const auto& frame = patches_.triangles[triangle];
    const float x = static_cast<float>(leaf % side.width) + 0.5F, y = static_cast<float>(leaf / side.width) + 0.5F;
    ball_[side.first_node + leaf] = {
        frame.origin + x * frame.du + y * frame.dv,
        (surface.planar ? 0.5F : 0.5F * kCurved) * (glm::length(frame.du) + glm::length(frame.dv))};
  }
  for (std::uint32_t level = 1; level < side.level_count; ++level) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto below = scene::levelGrid(side.width, side.height, level - 1);
    for (std::uint32_t y = 0; y < grid.height; ++y) {
      for (std::uint32_t x = 0; x < grid.width; ++x) {
        auto box = nothing();
        for (std::uint32_t cy = 2 * y; cy < std::min(2 * y + 2, below.height); ++cy) {
          for (std::uint32_t cx = 2 * x; cx < std::min(2 * x + 2, below.width); ++cx) {
            const auto& child = ball_[side.first_node + below.offset + cy * below.width + cx];
            if (child.radius >= 0.0F) include(box, child.centre, child.radius);
          }
        }
        if (box.low.x > box.high.x) continue;
        ball_[side.first_node + grid.offset + y * grid.width + x] = {0.5F * (box.low + box.high),
                                                                     0.5F * glm::distance(box.low, box.high)};
      }
    }
  }
}

bool Shadows::sees(const glm::vec3& point, const glm::vec3& normal) const {
  return std::ranges::any_of(all_, [&](const scene::ChangedBox& box) {
    const glm::vec3 farthest(normal.x > 0.0F ? box.high.x : box.low.x, normal.y > 0.0F ? box.high.y : box.low.y,
                             normal.z > 0.0F ? box.high.z : box.low.z);
    return glm::dot(normal, farthest - point) > kInFront;
  });
}

void Shadows::mark(std::uint32_t s, std::uint32_t level, std::uint32_t x, std::uint32_t y, const Ways& ways,
                   std::vector<std::uint8_t>& marks, bool& any) const {
  const Side& side = sides_[s];
  const auto grid = scene::levelGrid(side.width, side.height, level);
  const Ball& ball = ball_[side.first_node + grid.offset + y * grid.width + x];
  if (ball.radius < 0.0F || glm::dot(ways.normal, ball.centre - ways.point) < -ball.radius) return;
  const auto meets = [&](const Way& way) {  // a segment and a box (Kay and Kajiya 1986)
    const glm::vec3 d = ball.centre - way.from;
    float first = 0.0F, last = 1.0F;
    for (int axis = 0; axis < 3; ++axis) {
      const float inverse = 1.0F / (std::abs(d[axis]) > 1e-20F ? d[axis] : 1e-20F);
      const float a = (way.low[axis] - ball.radius - way.from[axis]) * inverse;
      const float b = (way.high[axis] + ball.radius - way.from[axis]) * inverse;
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    return first <= last;
  };
  if (std::ranges::none_of(ways.each, meets)) return;
  if (level == 0) {
    marks[side.first_value + y * side.width + x] = 1;
    any = true;
    return;
  }
  const auto below = scene::levelGrid(side.width, side.height, level - 1);
  for (std::uint32_t cy = 2 * y; cy < std::min(2 * y + 2, below.height); ++cy) {
    for (std::uint32_t cx = 2 * x; cx < std::min(2 * x + 2, below.width); ++cx)
      mark(s, level - 1, cx, cy, ways, marks, any);
  }
}

void Shadows::find(std::span<const glm::vec3> points, const glm::vec3& normal, float radius, std::uint32_t resolution,
                   Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const {
  Ways ways{{}, points.front(), normal};
  for (const auto& point : points) {
    for (const auto& box : change_.boxes) {
      const auto far = glm::max(glm::abs(box.low - point), glm::abs(box.high - point));
      // A pixel is 2 / N wide at a depth of one.
      const float beside = radius + 2.0F * kHalfDiagonal / static_cast<float>(resolution) * glm::length(far);
      ways.each.push_back({point, box.low - beside, box.high + beside});
    }
  }
  scratch.marks.resize(change_.altered.size(), 0);
  runs.clear();
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const Side& side = sides_[s];
    bool any = false;
    mark(s, side.level_count - 1, 0, 0, ways, scratch.marks, any);
    if (!any && !side_altered_[s]) continue;
    const std::size_t first_run = runs.size();
    for (std::uint32_t v = side.first_value; v < side.first_value + side.leaf_count; ++v) {
      if (scratch.marks[v] == 0 && !change_.altered[v]) continue;
      scratch.marks[v] = 0;
      const bool joins = runs.size() > first_run && runs.back().first + runs.back().count == v;
      if (!joins) runs.push_back({v, 0});
      ++runs.back().count;
    }
  }
}

}  // namespace radiosity::solver
