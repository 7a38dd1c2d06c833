#include "server/solver/lamps/light_sight.h"

#include <glm/geometric.hpp>
#include <span>
#include <utility>

#include "common/clones.h"
#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Ways end so far before the light (unit box): what it lies on is no nearer.
constexpr float kSpare = 2e-6F;

/// What all points would bring to a place, and those that are seen: cosines over squares of distances, all alike
/// scaled.
struct Brought {
  float all, seen;
};
RADIOSITY_CLONES Brought bringAll(const LeafRays::Points& points, const glm::vec3& from, const glm::vec3& normal,
                                  const glm::vec3& of_light, const std::int32_t* hidden) {
  constexpr std::size_t kLanes = 8;
  const float *px = points.x.data(), *py = points.y.data(), *pz = points.z.data();
  float all[kLanes] = {}, seen[kLanes] = {};
  for (std::size_t i = 0; i < points.x.size(); i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float x = px[i + k] - from.x, y = py[i + k] - from.y, z = pz[i + k] - from.z;
      const float square = x * x + y * y + z * z;
      const float arrives = x * normal.x + y * normal.y + z * normal.z;
      const float leaves = -(x * of_light.x + y * of_light.y + z * of_light.z);
      const float brings = arrives * leaves / (square * square);
      all[k] += brings;
      seen[k] += hidden[i + k] == 0 ? brings : 0.0F;
    }
  }
  Brought sum{0.0F, 0.0F};
  for (std::size_t k = 0; k < kLanes; ++k) {
    sum.all += all[k];
    sum.seen += seen[k];
  }
  return sum;
}

}  // namespace

LightSight::LightSight(std::shared_ptr<const LeafRays> rays, const LightPolygon& light, std::uint64_t seed)
    : rays_(std::move(rays)), light_(light), seed_(mixKeys(mixKeys(seed, 0x4c414d50ULL), light.key)) {
  for (std::size_t half = 0; half < 2; ++half) {
    const Sobol4 draws(mixKeys(seed_, half));
    for (std::uint32_t i = 0; i < kSets * kPoints; ++i) {
      const auto draw = draws(i);
      const auto point = light.point(draw.x, draw.y) + kSpare * light.normal;
      auto& set = points_[half][i / kPoints];  // each spread evenly, and all together
      set.x.push_back(point.x);
      set.y.push_back(point.y);
      set.z.push_back(point.z);
    }
  }
}

/// From each place the form factor, which is exact, times the part that is seen of what the points would bring.
std::optional<float> LightSight::link(std::uint32_t value, std::size_t half, std::uint32_t places) const {
  const Side& side = rays_->sideOf(value);
  const std::uint64_t leaf = std::uint64_t{side.key} << 32U | (value - side.first_value);
  const Sobol4 draws(mixKeys(mixKeys(seed_, leaf), half));
  const std::span corners(light_.corners.data(), light_.corner_count);
  std::array<std::int32_t, kPoints> hidden{};
  double sum = 0.0;
  for (std::uint32_t i = 0; i < places; ++i) {
    const auto draw = draws(i);
    const auto place = rays_->placeOn(value, {draw.x, draw.y});
    const auto form_factor = formFactorInFront(place.position, place.normal, corners);
    const bool before = glm::dot(place.position - glm::dvec3(corners[0]), glm::dvec3(light_.normal)) > 0.0;
    if (!before || form_factor.front < 1.0) return std::nullopt;
    const auto from = rays_->startOf(place), normal = glm::vec3(place.normal);
    const auto& points = points_[half][i % kSets];
    rays_->hide(from, points, hidden.data());
    const auto [all, seen] = bringAll(points, from, normal, light_.normal, hidden.data());
    if (!(all > 0.0F)) return std::nullopt;
    sum += form_factor.value * static_cast<double>(seen / all);
  }
  return static_cast<float>(sum / places);
}

}  // namespace radiosity::solver
