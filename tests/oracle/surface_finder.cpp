#include "tests/oracle/surface_finder.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "tests/oracle/embree_ray.h"
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
    Query query{};
    query.self = this;
    query.normal = normal;
    rtcInitIntersectContext(&query.context);
    query.context.filter = &Impl::weigh;
    auto ray = embreeRay(rays_.toUnit(point) + normal * kReach, -normal, 2.0 * kReach);
    rtcIntersect1(rays_.handle(), &query.context, &ray);
    return query.best;
  }

 private:
  /// Embree hands the context to the filter; the best until now goes behind it.
  struct Query {
    RTCIntersectContext context;
    const Impl* self;
    glm::dvec3 normal;
    std::optional<SurfaceHit> best;
    double distance;  ///< of the best from the point
  };

  static void weigh(const RTCFilterFunctionNArguments* arguments) {
    auto& query = *reinterpret_cast<Query*>(arguments->context);
    for (unsigned i = 0; i < arguments->N; ++i) {
      if (arguments->valid[i] != -1) continue;
      arguments->valid[i] = 0;  // goes on to the next
      const auto triangle = RTCHitN_primID(arguments->hit, arguments->N, i);
      const SurfaceHit hit{triangle, static_cast<double>(RTCHitN_u(arguments->hit, arguments->N, i)),
                           static_cast<double>(RTCHitN_v(arguments->hit, arguments->N, i)),
                           glm::dot(query.self->normals_[triangle], query.normal) < 0.0};
      const double distance = std::abs(static_cast<double>(RTCRayN_tfar(arguments->ray, arguments->N, i)) - kReach);
      if (!better(hit, distance, query)) continue;
      query.best = hit;
      query.distance = distance;
    }
  }

  [[nodiscard]] static bool better(const SurfaceHit& hit, double distance, const Query& query) {
    if (!query.best) return true;
    if (hit.back != query.best->back) return query.best->back;
    if (std::abs(distance - query.distance) < kSamePlace) return hit.triangle < query.best->triangle;
    return distance < query.distance;
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
