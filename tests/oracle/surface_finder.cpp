#include "tests/oracle/surface_finder.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "tests/oracle/ray_scene.h"

namespace radiosity::oracle {
namespace {

// Lengths in the box of size 2.
constexpr double kReach = 2e-4;
constexpr double kSamePlace = 1e-6;

}  // namespace

class SurfaceFinder::Impl {
 public:
  explicit Impl(const TriangleScene& scene) : rays_(scene.triangles) {
    normals_.reserve(scene.triangles.size());
    for (const auto& triangle : scene.triangles) normals_.push_back(triangle.normal);
  }

  [[nodiscard]] std::optional<SurfaceHit> find(const glm::dvec3& point, const glm::dvec3& normal) const {
    std::optional<SurfaceHit> best;
    double best_distance = 0.0;
    const auto weigh = [&](const RayScene::Met& met) {
      const SurfaceHit hit{met.triangle, met.u, met.v, glm::dot(normals_[met.triangle], normal) < 0.0};
      const double distance = std::abs(met.distance - kReach);
      if (!best || better(hit, distance, *best, best_distance)) {
        best = hit;
        best_distance = distance;
      }
      return false;  // goes on to the next
    };
    rays_.visit(rays_.toUnit(point) + normal * kReach, -normal, 2.0 * kReach, weigh);
    return best;
  }

 private:
  [[nodiscard]] static bool better(const SurfaceHit& hit, double distance, const SurfaceHit& best,
                                   double best_distance) {
    if (hit.back != best.back) return best.back;
    if (std::abs(distance - best_distance) < kSamePlace) return hit.triangle < best.triangle;
    return distance < best_distance;
  }

  RayScene rays_;
  std::vector<glm::dvec3> normals_;
};

SurfaceFinder::SurfaceFinder(const TriangleScene& scene) : impl_(std::make_unique<Impl>(scene)) {}
SurfaceFinder::~SurfaceFinder() = default;

std::optional<SurfaceHit> SurfaceFinder::find(const glm::dvec3& point, const glm::dvec3& normal) const {
  return impl_->find(point, normal);
}

}  // namespace radiosity::oracle
