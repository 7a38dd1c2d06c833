// Which triangle of a file is seen at a point of a surface, as an engine finds it that rasterizes what faces it: the
// front there; where there is none, a back. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

struct SurfaceHit {
  std::uint32_t triangle = 0;
  double u = 0.0, v = 0.0;  ///< weights of its second and third corner
  bool back = false;        ///< it turns its back
};

class SurfaceFinder {
 public:
  /// Keeps what it needs of the triangles.
  explicit SurfaceFinder(const TriangleScene& scene);
  ~SurfaceFinder();
  SurfaceFinder(const SurfaceFinder&) = delete;
  SurfaceFinder& operator=(const SurfaceFinder&) = delete;

  /// Of the triangles within a ten-thousandth of the scene's size the nearest that faces `normal`, the earliest of
  /// those in one place; else the nearest that turns away. A look from in front, so that what lies just before the
  /// point, or just behind, is not taken for it.
  [[nodiscard]] std::optional<SurfaceHit> find(const glm::dvec3& point, const glm::dvec3& normal) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace radiosity::oracle
