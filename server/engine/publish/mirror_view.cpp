#include "server/engine/publish/mirror_view.h"

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <optional>

#include "common/parallel.h"
#include "common/task.h"
#include "server/gpu/picture/view_geometry.h"
#include "server/gpu/picture/view_sky.h"
#include "server/solver/math/microfacets.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/passing.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"
#include "server/solver/surface/lamp_glints.h"
#include "server/solver/surface/tinted_rays.h"

namespace radiosity::engine {
namespace {

/// Rays through a pixel, and how far off its corner: so that edges in mirrors are smooth.
constexpr std::array<glm::dvec2, 4> kOffsets{{{0.375, 0.125}, {0.875, 0.375}, {0.125, 0.625}, {0.625, 0.875}}};
/// Directions that a rough mirror is looked at in by each of these.
constexpr std::uint32_t kDirections = 8;
/// Backs of single-sided faces are not drawn: a ray goes on behind so many.
constexpr int kMostBacks = 16;

class MirrorView {
 public:
  MirrorView(const scene::Camera& camera, const MirrorScene& scene)
      : scene_(scene),
        camera_(camera.world),
        eye_((glm::dvec3(camera.world[3]) - scene.patches->centre) / scene.patches->scale),
        sides_(solver::makeSides(*scene.patches)),
        mirrors_(solver::SpecularLeaves::find(sides_, scene.materials, scene.patches->surfaces)) {
    if (!mirrors_) return;
    glints_ = solver::LampGlints(solver::findLightPolygons(*scene.patches, sides_, scene.materials.emission));
    rays_ = std::make_shared<const solver::LeafRays>(*scene.patches, sides_);
    tinted_.emplace(rays_);
    for (const auto& side : sides_) {
      const auto emission = scene.materials.emission.side(side.number);
      const auto reflectance = scene.materials.reflectance.side(side.number);
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
        own_.push_back(emission[leaf]);
        lamps_.push_back(side.gathered ? emission[leaf] : glm::vec3(0.0F));
        reflectance_.push_back(reflectance[leaf]);
        irradiance_.push_back(scene.irradiance[side.first_node + leaf]);
      }
    }
    addPassed(scene);
  }

  [[nodiscard]] bool isNeeded() const { return mirrors_ != nullptr; }

  /// Through a place of the picture, in half widths and heights of it at a distance of one.
  [[nodiscard]] glm::vec3 through(const glm::dvec2& at, std::uint64_t key) const {
    const auto direction = glm::normalize(glm::dmat3(camera_) * glm::dvec3(at, -1.0));
    solver::LeafRays::Place from, end;
    from.position = eye_;
    solver::LeafRays::Panes panes;
    auto value = rays_->see(from, direction, key, end, nullptr, &panes);
    for (int back = 0; back < kMostBacks && value == solver::LeafRays::kNothing; ++back) {
      from.position = end.position;
      from.triangle = end.triangle;
      value = rays_->see(from, direction, key, end, nullptr, &panes);
    }
    if (value >= own_.size() || !mirrors_->has(value)) return glm::vec3(0.0F);
    const double roughness = mirrors_->roughness(value);
    const std::uint32_t count = roughness > 0.0 ? kDirections : 1;
    glm::vec3 sum(0.0F);
    for (std::uint32_t i = 0; i < count; ++i) sum += reflected(end, value, direction, solver::mixKeys(key, i));
    return glm::vec3(panes.tint) * (sum / static_cast<float>(count));
  }

 private:
  /// What translucent surfaces let through.
  void addPassed(const MirrorScene& scene) {
    const auto areas = solver::leafAreas(*scene.patches, sides_);
    for (const auto& leaf : solver::passingLeaves(scene.materials.transmittance, sides_, areas))
      own_[leaf.to] += leaf.of(irradiance_);
  }

  [[nodiscard]] glm::vec3 reflected(const solver::LeafRays::Place& at, std::uint32_t value, const glm::dvec3& direction,
                                    std::uint64_t key) const {
    const solver::RayEnd met{value, at, direction, key};
    const auto glint = glm::vec3(glints_.look(*tinted_, *mirrors_, met)) * static_cast<float>(std::numbers::inv_pi);
    const auto reflection =
        solver::reflectByMicrofacets(at.normal, direction, mirrors_->roughness(value), solver::mixKeys(key, 1));
    glm::vec3 part(1.0F);
    for (const double edge : reflection.edges()) part *= mirrors_->reflectance(value, static_cast<float>(edge));
    solver::LeafRays::Place end;
    solver::LeafRays::Panes panes;
    const auto seen = rays_->see(at, reflection.direction, key, end, nullptr, &panes);
    part *= glm::vec3(panes.tint);
    if (solver::LeafRays::isSky(seen)) return glint + part * gpu::skyRadiance(scene_.sky, reflection.direction);
    if (seen == solver::LeafRays::kNothing) return glint;
    auto radiosity = radiosityAt(end, seen);
    if (reflection.count == 1 && lamps_[seen] != glm::vec3(0.0F)) {  // looks at lamps find some of that
      const double weight = glints_.weightOf(*mirrors_, met, {seen, end, reflection.direction, key}, lamps_[seen]);
      radiosity -= static_cast<float>(1.0 - weight) * lamps_[seen];
    }
    return glint + part * radiosity * static_cast<float>(std::numbers::inv_pi);
  }

  [[nodiscard]] glm::vec3 radiosityAt(const solver::LeafRays::Place& place, std::uint32_t value) const {
    const auto arrives = place.value == value ? irradianceAt(place) : irradiance_[value];
    return own_[value] + reflectance_[value] * arrives;
  }

  /// As a lookup in the lightmap has it: between the middles of leaves.
  [[nodiscard]] glm::vec3 irradianceAt(const solver::LeafRays::Place& place) const {
    const auto value = place.value;
    const auto& side = rays_->sideOf(value);
    const glm::dvec2 last(side.width - 1, side.height - 1);
    const auto at = glm::clamp(rays_->texelOf(place) - 0.5, glm::dvec2(0.0), last);
    const auto low = glm::floor(at), part = at - low;
    glm::dvec3 sum(0.0);
    double weights = 0.0;
    for (std::uint32_t k = 0; k < 4; ++k) {
      const auto x = std::min(static_cast<std::uint32_t>(low.x) + k % 2, side.width - 1);
      const auto y = std::min(static_cast<std::uint32_t>(low.y) + k / 2, side.height - 1);
      const auto beside = side.first_value + y * side.width + x;
      if (rays_->areaOf(beside) <= 0.0) continue;
      const double weight = (k % 2 == 1 ? part.x : 1.0 - part.x) * (k / 2 == 1 ? part.y : 1.0 - part.y);
      sum += weight * glm::dvec3(irradiance_[beside]);
      weights += weight;
    }
    return weights > 0.0 ? glm::vec3(sum / weights) : irradiance_[value];
  }

  const MirrorScene& scene_;
  glm::dmat4 camera_;
  glm::dvec3 eye_;
  std::vector<solver::Side> sides_;
  std::shared_ptr<const solver::SpecularLeaves> mirrors_;
  std::shared_ptr<const solver::LeafRays> rays_;
  std::optional<solver::TintedRays> tinted_;  ///< these
  solver::LampGlints glints_;
  /// By leaf value; `own_`: all but what is reflected, and `lamps_`: of that what glints are looked for of.
  std::vector<glm::vec3> irradiance_, reflectance_, own_, lamps_;
};

}  // namespace

void addMirrors(gpu::ViewPicture& picture, const scene::Camera& camera, const MirrorScene& scene) {
  if (!scene.hasMirrors()) return;
  const MirrorView view(camera, scene);
  if (!view.isNeeded()) return;
  const int width = picture.image.width, height = picture.image.height;
  const auto half = gpu::halfView(camera, width, height);
  inTurns(static_cast<std::size_t>(height), [&](std::size_t y) {
    interruptionPoint();
    for (int x = 0; x < width; ++x) {
      const auto i = y * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      if (picture.cover[i] <= 0.0F) continue;
      glm::vec3 sum(0.0F);
      for (std::size_t k = 0; k < kOffsets.size(); ++k) {
        const auto at = (glm::dvec2(x, y) + kOffsets[k]) / glm::dvec2(width, height);
        sum += view.through({(2.0 * at.x - 1.0) * half.x, (1.0 - 2.0 * at.y) * half.y}, solver::mixKeys(i, k));
      }
      picture.image.pixels[i] += sum / static_cast<float>(kOffsets.size());
    }
  });
}

}  // namespace radiosity::engine
