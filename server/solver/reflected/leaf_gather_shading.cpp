// Gathered light for shading normals: of the same rays, so that not one more is cast.
#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "common/parallel.h"
#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_gather.h"
#include "server/solver/reflected/shaded_rays.h"

namespace radiosity::solver {
namespace {

/// Of light that comes from all around: what is much darker than that for the geometric normal is noise.
constexpr float kMostPart = 4.0F;

}  // namespace

void LeafGather::addShadedRays(std::size_t half, std::uint32_t value, std::uint32_t number, ShadedRays& rays) const {
  const std::uint32_t count = sights_.counts()[value];
  rays.beginLeaf(count, glm::dvec3(shading_->normal(number)));
  if (count < 2) return;
  sights_.visitRays(half, value, [&](const LeafRays::Place& place, const glm::dvec3& direction, std::uint32_t) {
    rays.addRay(place.normal, direction);
  });
}

void LeafGather::sumShaded(std::size_t half, std::uint32_t value, std::uint32_t leaf, const ShadedRays::Leaf& of,
                           std::span<const ShadedRays::Weights> weights, ShadedLight& light) const {
  if (of.count == 0) return;
  const auto& radiosity = halves_[half].radiosity;
  std::array<double, 3> sum{};
  std::array<std::array<float, 4>, 3> weighed{};  // by channel: four lanes, which need no more than what is noise
  std::size_t ray = 0;
  for (const auto end : sights_.seen(half, value)) {
    const auto& seen = radiosity[end];
    const auto& codes = weights[ray++];
    const std::array<float, 4> weight{static_cast<float>(codes[0]), static_cast<float>(codes[1]),
                                      static_cast<float>(codes[2]), static_cast<float>(codes[3])};
    for (std::size_t c = 0; c < 3; ++c) {
      sum[c] += static_cast<double>(seen[c]);
      for (std::size_t k = 0; k < 4; ++k) weighed[c][k] += weight[k] * seen[c];
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const double mean = sum[c] / of.count;
    light.part[0][c][leaf] = static_cast<float>(mean);
    for (std::size_t k = 0; k < 4; ++k)
      light.part[1 + k][c][leaf] = static_cast<float>(of.unit * static_cast<double>(weighed[c][k]) + of.mean[k] * mean);
  }
}

void LeafGather::weighShading(std::size_t half, std::size_t number) {
  const auto& shaded = shading_->sides()[number];
  const auto& side = sides_[shaded.side];
  ShadedLight light;
  for (auto& part : light.part)
    for (auto& channel : part) channel.assign(side.leaf_count, 0.0F);
  ShadedRays made;
  auto& rays = keeps_shaded_rays_ ? shaded_rays_[half][number] : made;
  const bool is_known = !rays.empty();
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    if (!keeps_shaded_rays_) rays.clear();
    if (!is_known) addShadedRays(half, side.first_value + leaf, shaded.first + leaf, rays);
    const auto& of = rays.leaf(keeps_shaded_rays_ ? leaf : 0);
    sumShaded(half, side.first_value + leaf, leaf, of, rays.weights(of), light);
  }
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

/// From the second light over the same rays on, where there is room: a solve that gets more rays with each has no use
/// for it.
void LeafGather::keepShadedRays() {
  if (keeps_shaded_rays_ || !std::exchange(has_shaded_, true)) return;
  std::size_t leaves = 0, rays = 0;
  for (const auto& shaded : shading_->sides()) {
    const auto& side = sides_[shaded.side];
    leaves += side.leaf_count;
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) rays += sights_.counts()[side.first_value + leaf];
  }
  const auto taken = leastBytes() + sights_.bytes() + 2 * ShadedRays::bytes(leaves, rays);
  if (taken > most_bytes_) return;
  for (auto& half : shaded_rays_) {
    half.resize(shading_->sides().size());
    for (std::size_t i = 0; i < half.size(); ++i) {
      const auto& side = sides_[shading_->sides()[i].side];
      std::size_t of_side = 0;
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) of_side += sights_.counts()[side.first_value + leaf];
      half[i].reserve(side.leaf_count, of_side);
    }
  }
  keeps_shaded_rays_ = true;
}

void LeafGather::forgetShadedRays() {
  has_shaded_ = keeps_shaded_rays_ = false;
  shaded_rays_ = {};
}

/// While what leaves send, in the mean of the halves, is there still, and how it was smoothed.
void LeafGather::weighShading() {
  shaded_part_ = {};
  if (shading_ == nullptr || shading_->empty()) return;
  for (auto& half : shaded_part_) half.assign(shading_->size(), glm::vec3(1.0F));
  keepShadedRays();
  inTurns(2 * shading_->sides().size(), [&](std::size_t part) { weighShading(part % 2, part / 2); });
}

}  // namespace radiosity::solver
