// The part of what a point sees that is of interest: a pyramid. After an edit of geometry only the ways that pass the
// change are looked along again, and most of the scene need not be drawn. Plain values, any thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>

#include "server/gpu/cull/hemicube_views.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

/// Directions d with dot(planes[k], d) >= 0 for all four.
struct ViewWindow {
  std::array<glm::vec3, 4> planes{};

  /// Whether all of a box (centre relative to the eye, half its extent) lies outside.
  [[nodiscard]] bool excludes(const glm::vec3& centre, const glm::vec3& extent) const {
    for (const auto& plane : planes) {
      if (glm::dot(plane, centre) + glm::dot(extent, glm::abs(plane)) < 0.0F) return true;
    }
    return false;
  }
};

/// The pyramid around points and boxes, and as much more on all sides as lies within `margin_rad`; of boxes, what is
/// before the hemicube's plane. Nothing: they lie too far apart for a pyramid to leave out much.
[[nodiscard]] std::optional<ViewWindow> windowAround(const solver::HemicubeFrame& eye,
                                                     std::span<const glm::vec3> points,
                                                     std::span<const scene::ChangedBox> boxes, float margin_rad);

/// Pixels of one row of a hemicube's image (layout of hemicube_weights.h) whose samples lie in the window: [first,
/// end). The image has 3 N rows.
struct PixelSpan {
  std::uint32_t first, end;
};
[[nodiscard]] PixelSpan pixelsInside(const ViewWindow& window, const solver::HemicubeFrame& frame,
                                     std::uint32_t resolution, std::uint32_t row);

/// Of a face's pixels, those that hold all that lie in the window and their neighbours: columns and rows of the image,
/// [first, end).
struct PixelRectangle {
  glm::uvec2 first{0}, end{0};
};
[[nodiscard]] PixelRectangle pixelsAround(const ViewWindow& window, const solver::HemicubeFrame& frame,
                                          std::uint32_t resolution, std::size_t face);

}  // namespace radiosity::gpu
