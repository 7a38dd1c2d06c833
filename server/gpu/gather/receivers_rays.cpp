// What Receivers ask rays.
#include <algorithm>
#include <bit>
#include <glm/geometric.hpp>
#include <new>

#include "common/log.h"
#include "server/gpu/gather/receivers.h"
#include "server/solver/math/sampling.h"

namespace radiosity::gpu {
namespace {

/// So many sheets that one can see through a ray passes; the next counts as one that it does not.
constexpr std::size_t kMostSheets = 256;

/// Partial opacity stops a way or not, by chance.
class Opacity final : public geometry::SeeThrough {
 public:
  explicit Opacity(std::shared_ptr<const scene::PatchScene> patches) : patches_(std::move(patches)) {}

  [[nodiscard]] bool passes(std::uint32_t triangle, float u, float v, const glm::vec3& direction,
                            std::uint64_t key) const override {
    const auto texelOf = [&](std::size_t k) {
      return patches_->vertices[patches_->indices[3 * std::size_t{triangle} + k]].texel;
    };
    const auto texel = texelOf(0) + u * (texelOf(1) - texelOf(0)) + v * (texelOf(2) - texelOf(0));
    return passesAt(*patches_, triangle, texel, direction, key);
  }

  [[nodiscard]] static bool passesAt(const scene::PatchScene& patches, std::uint32_t triangle, const glm::vec2& texel,
                                     const glm::vec3& direction, std::uint64_t key) {
    const auto stopped = static_cast<double>(patches.stoppedAt(triangle, texel, direction));
    return solver::uniformFromKey(solver::mixKeys(key, triangle)) >= stopped;
  }

 private:
  std::shared_ptr<const scene::PatchScene> patches_;
};

}  // namespace

const geometry::RayScene& Receivers::rays() const {
  std::call_once(rays_->made, [this] { rays_->scene = makeRays(); });
  return rays_->scene;
}

geometry::RayScene Receivers::makeRays() const {
  std::vector<bool> see_through;
  if (!patches_->opacity.empty()) {
    for (const auto surface : patches_->triangle_surface)
      see_through.push_back(patches_->surfaces[surface].see_through);
  }
  // One thread: workers are as many as there are cores.
  auto built = geometry::RayScene::build(corners_, 1, see_through, std::make_shared<Opacity>(patches_));
  if (!built) {
    log::error("what lights see cannot be looked for: {}", built.error().text());
    throw std::bad_alloc();
  }
  return std::move(*built);
}

glm::vec2 Receivers::texelAt(const scene::TriangleFrame& frame, const glm::vec3& point) {
  const glm::dvec3 du(frame.du), dv(frame.dv), way = glm::dvec3(point) - glm::dvec3(frame.origin);
  const double uu = glm::dot(du, du), uv = glm::dot(du, dv), vv = glm::dot(dv, dv);
  const double u = glm::dot(way, du), v = glm::dot(way, dv), under = uu * vv - uv * uv;
  return {(u * vv - v * uv) / under, (v * uu - u * uv) / under};
}

bool Receivers::absorbs(const geometry::Ray& ray, const geometry::Hit& hit) const {
  if (absorbs(hit.triangle, !hit.front)) return true;
  const auto& surface = patches_->surfaces[patches_->triangle_surface[hit.triangle]];
  const auto first = surface.first_node[hit.front ? 0 : 1];
  const auto texel = texelAt(patches_->triangles[hit.triangle], ray.origin + hit.t * ray.direction);
  const auto within = [](float at, std::uint32_t count) {
    return at > 0.0F ? static_cast<std::uint32_t>(std::min(at, static_cast<float>(count - 1)))
                     : 0U;  // also of no number
  };
  const auto x = within(texel.x, surface.width), y = within(texel.y, surface.height);
  const auto areaOf = [&](std::uint32_t leaf) { return patches_->node_area[first + leaf]; };
  const auto here = y * surface.width + x;
  if (areaOf(here) > 0.0F) return false;
  if (patches_->leaves[surface.first_leaf + here].beneath) return false;  // what covers it is lit
  const auto lift = (hit.front ? kLift : -kLift) * patches_->triangles[hit.triangle].normal;
  const auto from = ray.origin + hit.t * ray.direction + lift;
  for (auto ny = y - std::min(y, 1U); ny < std::min(y + 2, surface.height); ++ny) {
    for (auto nx = x - std::min(x, 1U); nx < std::min(x + 2, surface.width); ++nx) {
      const auto beside = ny * surface.width + nx;
      const auto& leaf = patches_->leaves[surface.first_leaf + beside];
      if (areaOf(beside) <= 0.0F || leaf.triangle == scene::kNone) continue;
      const auto& frame = patches_->triangles[leaf.triangle];
      const auto to = frame.origin + leaf.texel.x * frame.du + leaf.texel.y * frame.dv + lift;
      if (rays().open({from, to - from, 1.0F})) return false;
    }
  }
  return true;
}

std::uint64_t Receivers::wayKey(std::uint64_t look, const glm::vec3& from) const {
  return patches_->opacity.empty() ? 0 : solver::mixKeys(look, placeKey(from));
}

std::uint64_t Receivers::placeKey(const glm::vec3& place) {
  const auto bits = [](float value) { return std::uint64_t{std::bit_cast<std::uint32_t>(value)}; };
  return solver::mixKeys(bits(place.x) << 32U | bits(place.y), bits(place.z));
}

bool Receivers::isBlocked(const Ray& ray) const {
  const auto from = ray.at + kLift * ray.normal, way = ray.at + ray.reach * ray.way - from;
  return !rays().open({from, way, 1.0F - 2.0F * kLift / glm::length(way)});
}

void Receivers::nearest(std::span<const geometry::Ray> rays, std::uint64_t key, std::span<geometry::Hit> hits) const {
  this->rays().nearest(rays, hits);
  if (patches_->opacity.empty()) return;
  for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = goOn(hits[i], rays[i], solver::mixKeys(key, i));
}

geometry::Hit Receivers::goOn(const geometry::Hit& first, const geometry::Ray& ray, std::uint64_t key) const {
  std::vector<std::uint32_t> passed;
  auto hit = first;
  for (; hit.found() && passed.size() < kMostSheets; hit = rays().nearest(ray, passed)) {
    if (!patches_->surfaces[patches_->triangle_surface[hit.triangle]].see_through) break;
    const auto texel = texelAt(patches_->triangles[hit.triangle], ray.origin + hit.t * ray.direction);
    if (!Opacity::passesAt(*patches_, hit.triangle, texel, ray.direction, key)) break;
    passed.push_back(hit.triangle);
  }
  return hit;
}

}  // namespace radiosity::gpu
