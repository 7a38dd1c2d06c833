// The reference: irradiance by path tracing, with its own visibility and its own sampling, accumulated in
// double. Unbiased: paths end by Russian roulette only. Light leaves and arrives at the fronts of single-sided
// triangles; their backs absorb.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

/// Where irradiance is wanted: the mean over the area of some triangles (a texel), or at a point (one triangle with
/// three equal corners).
struct Footprint {
  struct Piece {
    std::array<glm::dvec3, 3> corners{};
    glm::dvec3 normal{0.0};  ///< unit; light arrives on this side
    /// Of the scene, that this is a part of: what lies under an earlier one in its plane is left out.
    std::uint32_t triangle = kNoTriangle;
    /// At the corners: irradiance is for this normal, as engines shade; the surface itself still hides what is below
    /// its plane. 0, or one that turns away: as `normal`.
    std::array<glm::dvec3, 3> shading{};
  };
  std::vector<Piece> pieces;

  [[nodiscard]] static Footprint at(const glm::dvec3& point, const glm::dvec3& normal);
  [[nodiscard]] double area() const;
};

struct Irradiance {
  glm::dvec3 mean_lux{0.0};
  glm::dvec3 standard_error{0.0};
  /// Of the footprint's area: the rest is buried, lies under an earlier face, or is cut out, and is left out.
  double visible_fraction = 1.0;
  /// Of the footprint's area: where models are open, so that it has no answer whether it is buried (burial.h).
  double undecided_fraction = 0.0;
  /// Of the paths' first rays: those that end on backs of single-sided triangles, and those that leave the scene.
  double back_fraction = 0.0, open_fraction = 0.0;
};

struct PathOptions {
  std::uint32_t samples = 1024;  ///< paths for each footprint, rounded up to a multiple of 8
  std::uint64_t seed = 1;
  unsigned threads = 0;          ///< 0: all cores. The result does not depend on it.
  bool leave_out_buried = true;  ///< and what lies under earlier faces
};

class PathTracer {
 public:
  /// Keeps its own copy of the triangles.
  explicit PathTracer(const TriangleScene& scene);
  ~PathTracer();
  PathTracer(const PathTracer&) = delete;
  PathTracer& operator=(const PathTracer&) = delete;

  [[nodiscard]] std::vector<Irradiance> irradiance(std::span<const Footprint> footprints,
                                                   const PathOptions& options) const;

  /// Whether the point lies inside another solid (burial.h).
  [[nodiscard]] bool buried(const glm::dvec3& point, const glm::dvec3& normal) const;

 private:
  class Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace radiosity::oracle
