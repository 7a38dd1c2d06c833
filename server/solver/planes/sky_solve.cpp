#include "server/solver/planes/sky_solve.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/packing.hpp>
#include <glm/vec4.hpp>
#include <numbers>

#include "common/parallel.h"
#include "server/solver/math/sampling.h"
#include "server/solver/math/sky_cells.h"
#include "server/solver/planes/plane_rays.h"

namespace radiosity::solver {
namespace {

constexpr std::uint64_t kRaysOfHalf = std::uint64_t{1} << 22;
constexpr std::uint64_t kLeastRays = 4, kMostRays = 256;
constexpr std::size_t kLeavesAPart = 64;
/// Sweeps end where none changes the sum of light by more than this part of it.
constexpr double kSettled = 1e-5;
constexpr int kMostSweeps = 1000;

/// A colour of channels up to 1, in steps of 1/1023.
std::uint32_t packed(const glm::dvec3& colour) { return glm::packUnorm3x10_1x2(glm::vec4(colour, 0.0F)); }
glm::vec3 unpacked(std::uint32_t bits) { return glm::vec3(glm::unpackUnorm3x10_1x2(bits)); }

/// One of the two halves.
class Half {
 public:
  Half(const PlaceLight& light, std::uint64_t key)
      : light_(light),
        count_(light.reflectance().size()),
        rays_(static_cast<std::uint32_t>(
            std::clamp(kRaysOfHalf / std::max<std::uint64_t>(1, count_), kLeastRays, kMostRays))),
        from_sky_(count_, glm::vec3(0.0F)),
        irradiance_(count_, glm::vec3(0.0F)) {
    ends_.assign(count_ * rays_, LeafRays::kNothing);
    if (light_.rays().hasTints()) tints_.assign(ends_.size(), packed(glm::dvec3(1.0)));
    inParts([&](std::size_t value) { castRays(static_cast<std::uint32_t>(value), mixKeys(key, value)); });
  }

  [[nodiscard]] const std::vector<glm::vec3>& solve() {
    irradiance_ = from_sky_;
    std::vector<glm::vec3> radiosity(count_), next(count_);
    double before = total();
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
      for (std::size_t v = 0; v < count_; ++v) radiosity[v] = light_.reflectance()[v] * irradiance_[v];
      for (const auto& leaf : light_.passing()) radiosity[leaf.to] += leaf.of(irradiance_);
      inParts([&](std::size_t value) { next[value] = from_sky_[value] + gathered(value, radiosity); });
      irradiance_.swap(next);
      const double now = total();
      if (!(std::abs(now - before) > kSettled * now)) break;
      before = now;
    }
    return irradiance_;
  }

 private:
  template <typename Work>
  void inParts(const Work& work) const {
    inTurns((count_ + kLeavesAPart - 1) / kLeavesAPart, [&](std::size_t part) {
      const auto end = std::min(count_, (part + 1) * kLeavesAPart);
      for (auto value = part * kLeavesAPart; value < end; ++value) work(value);
    });
  }

  void castRays(std::uint32_t value, std::uint64_t key) {
    const auto& rays = light_.rays();
    if (!(rays.areaOf(value) > 0.0)) return;
    const Sobol4 draws(key);
    glm::dvec3 sky(0.0);
    for (std::uint32_t k = 0; k < rays_; ++k) {
      const auto draw = draws(k);
      const auto from = rays.placeOn(value, {draw.z, draw.w});
      LeafRays::Place end;
      LeafRays::Panes panes;
      const auto seen =
          rays.see(from, cosineDirection(from.normal, draw.x, draw.y), mixKeys(key, k), end, nullptr, &panes);
      if (panes.count > 0) tints_[std::size_t{value} * rays_ + k] = packed(panes.tint);
      if (LeafRays::isSky(seen))
        sky += panes.tint * light_.skyAt(seen - LeafRays::kSky);
      else
        ends_[std::size_t{value} * rays_ + k] = seen;
    }
    from_sky_[value] = glm::vec3(sky / static_cast<double>(rays_));
  }

  [[nodiscard]] glm::vec3 gathered(std::size_t value, const std::vector<glm::vec3>& radiosity) const {
    glm::vec3 sum(0.0F);
    for (std::uint32_t k = 0; k < rays_; ++k) {
      const auto seen = ends_[value * rays_ + k];
      if (seen != LeafRays::kNothing)
        sum += tints_.empty() ? radiosity[seen] : unpacked(tints_[value * rays_ + k]) * radiosity[seen];
    }
    return sum / static_cast<float>(rays_);
  }

  [[nodiscard]] double total() const {
    double sum = 0.0;
    for (const auto& light : irradiance_) sum += static_cast<double>(light.x + light.y + light.z);
    return sum;
  }

  const PlaceLight& light_;
  std::size_t count_;
  std::uint32_t rays_;
  std::vector<std::uint32_t> ends_;  ///< leaf values, kNothing where light comes from none
  std::vector<std::uint32_t>
      tints_;  ///< by ray: packed(), of coloured glass that it went through; empty: there is none
  std::vector<glm::vec3> from_sky_, irradiance_;
};

}  // namespace

SkySolution solveUnderSky(const PlaceLight& light, const scene::PatchScene& patches, std::uint64_t seed) {
  SkySolution solution;
  solution.irradiance.assign(patches.nodeCount(), glm::vec3(0.0F));
  solution.difference = solution.irradiance;
  for (std::uint64_t h = 0; h < 2; ++h) {
    Half half(light, mixKeys(mixKeys(seed, 0x534B59ULL), h));
    const auto& found = half.solve();
    for (const auto& side : light.sides()) {
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
        const auto node = side.first_node + leaf;
        solution.irradiance[node] += 0.5F * found[side.first_value + leaf];
        solution.difference[node] += (h == 0 ? 1.0F : -1.0F) * found[side.first_value + leaf];
      }
    }
  }
  return solution;
}

double horizontalIlluminance(const PlaceLight& light) {
  double sum = 0.0;
  for (std::uint32_t cell = 0; cell < SkyCells::kHalf; ++cell) {
    const auto at = SkyCells::extentOf(cell);
    const double top = at.height + at.extent;
    sum += luminous(light.skyAt(cell)) / std::numbers::pi * at.width * 0.5 * (top * top - at.height * at.height);
  }
  return sum;
}

}  // namespace radiosity::solver
