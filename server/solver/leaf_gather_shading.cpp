// Gathered light for shading normals: of the same rays, so that not one more is cast.
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/parallel.h"
#include "server/solver/halves.h"
#include "server/solver/leaf_gather.h"

namespace radiosity::solver {
namespace {

/// Of light that comes from all around: what is much darker than that for the geometric normal is noise.
constexpr float kMostPart = 4.0F;

/// A ray counts by the tangent of its angle, without bound towards the horizon, so that few rays would make most of
/// the noise. Below a slope that falls with their number they count as if at it, and all for so much more that light
/// which changes evenly from one horizon to the other is right in the mean.
struct Slopes {
  double least, scale;

  explicit Slopes(std::size_t rays) : least(0.5 / std::sqrt(static_cast<double>(rays))) {
    const double limit = std::acos(least), sine = std::sin(limit);
    const double counted = 0.5 * limit - 0.25 * std::sin(2.0 * limit) + (1.0 - sine * sine * sine) / (3.0 * least);
    scale = 0.25 * std::numbers::pi / counted;
  }
  [[nodiscard]] glm::dvec3 along(const glm::dvec3& direction, const glm::dvec3& normal) const {
    const double cosine = glm::dot(direction, normal);
    return (scale / std::max(cosine, least)) * (direction - cosine * normal);
  }
};

}  // namespace

/// Rays lie as dense as cosines with the geometric normal, which what they bring is to be divided by, and multiplied by
/// those with the shading normal. Light that is the same from everywhere is known without that; how it differs is what
/// the rays tell.
void LeafGather::sumShaded(std::size_t half, std::uint32_t value, std::uint32_t leaf, const glm::dvec3& normal,
                           ShadedLight& light) const {
  const std::size_t count = sights_.counts()[value];
  if (count < 2) return;
  const auto& radiosity = halves_[half].radiosity;
  glm::dvec3 mean(0.0);
  for (const auto end : sights_.seen(half, value))
    mean += glm::dvec3(radiosity[end][0], radiosity[end][1], radiosity[end][2]);
  mean /= static_cast<double>(count);
  const Slopes slopes(count);
  std::array<glm::dvec3, 3> even{}, differs{};  // by axis
  glm::dvec3 below(0.0);
  double below_even = 0.0;
  sights_.visitRays(half, value, [&](const LeafRays::Place& place, const glm::dvec3& direction, std::uint32_t end) {
    const auto seen = glm::dvec3(radiosity[end][0], radiosity[end][1], radiosity[end][2]), differing = seen - mean;
    const auto across = slopes.along(direction, place.normal);
    for (int axis = 0; axis < 3; ++axis) {
      even[static_cast<std::size_t>(axis)] += place.normal[axis] * seen;
      differs[static_cast<std::size_t>(axis)] += across[axis] * differing;
    }
    const double facing = glm::dot(normal, place.normal);
    below += std::max(0.0, -(facing + glm::dot(normal, across))) * differing;
    below_even += 0.5 * (1.0 - facing);
  });
  const auto n = static_cast<double>(count);
  const auto put = [&](std::size_t part, const glm::dvec3& of) {
    for (std::size_t c = 0; c < 3; ++c) light.part[part][c][leaf] = static_cast<float>(of[static_cast<int>(c)]);
  };
  put(0, mean);
  for (std::size_t axis = 0; axis < 3; ++axis) put(1 + axis, even[axis] / n + differs[axis] / (n - 1.0));
  put(ShadedLight::kBelow, below_even / n * mean + below / (n - 1.0));
}

void LeafGather::weighShading(std::size_t half, const LeafShading::ShadedSide& shaded) {
  const auto& side = sides_[shaded.side];
  ShadedLight light;
  for (auto& part : light.part)
    for (auto& channel : part) channel.assign(side.leaf_count, 0.0F);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
    sumShaded(half, side.first_value + leaf, leaf, glm::dvec3(shading_->normal(shaded.first + leaf)), light);
  for (auto& part : light.part) smoother_->apply(shaded.side, {part[0].data(), part[1].data(), part[2].data()});
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto& normal = shading_->normal(shaded.first + leaf);
    if (normal == glm::vec3(0.0F)) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto of = [&](std::size_t part) { return light.part[part][c][leaf]; };
      const float arrives = normal.x * of(1) + normal.y * of(2) + normal.z * of(3) + of(ShadedLight::kBelow);
      if (of(0) > 0.0F)
        shaded_part_[half][shaded.first + leaf][static_cast<int>(c)] = std::clamp(arrives / of(0), 0.0F, kMostPart);
    }
  }
}

/// While what leaves send, in the mean of the halves, is there still, and how it was smoothed.
void LeafGather::weighShading() {
  shaded_part_ = {};
  if (shading_ == nullptr || shading_->empty()) return;
  for (auto& half : shaded_part_) half.assign(shading_->size(), glm::vec3(1.0F));
  const auto sides = shading_->sides();
  inTurns(2 * sides.size(), [&](std::size_t part) { weighShading(part % 2, sides[part / 2]); });
}

}  // namespace radiosity::solver
