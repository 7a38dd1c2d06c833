// Where a patch lies as a polygon: the rectangle of a node cut by its surface's outline.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::solver {

/// A convex polygon in texel coordinates, counter-clockwise; at most eight corners.
struct TexelPolygon {
  std::array<glm::dvec2, 8> corner{};
  std::uint32_t count = 0;

  [[nodiscard]] double area() const;
  /// A point of it: (u, v) in [0, 1)^2, uniform in area, stratification kept within each of the triangles of its fan.
  [[nodiscard]] glm::dvec2 point(double u, double v) const;
};

/// Outlines of the planar surfaces that are convex with at most four corners. For others a node's whole rectangle
/// counts.
class Outlines {
 public:
  explicit Outlines(const scene::PatchScene& patches);

  /// The node's rectangle, cut by the outline of its surface.
  [[nodiscard]] TexelPolygon node(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const;

 private:
  struct Outline {
    std::array<glm::dvec2, 4> corner{};
    std::uint32_t count = 0;  // 0: the whole rectangle
  };
  static Outline of(const scene::PatchScene& patches, const scene::Surface& surface);
  const scene::PatchScene& patches_;
  std::vector<Outline> outline_;  // by surface
};

}  // namespace radiosity::solver
