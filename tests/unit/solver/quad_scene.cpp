#include "tests/unit/solver/quad_scene.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <thread>

#include "server/solver/math/sampling.h"

namespace radiosity::test {
namespace {

/// A point of a lamp that touches a leaf sends it more than 64 bits hold: what is sent in one go stays below a
/// thousandth of those, so that sums stay within.
std::int64_t wholeFlux(double flux) {
  constexpr double kMost = 0x1p53;
  return std::llround(std::isfinite(flux) ? std::clamp(flux, -kMost, kMost) : kMost);
}

/// Of one side.
void addNodes(const Quad& quad, const scene::Surface& surface, scene::PatchScene& patches) {
  for (std::uint32_t level = 0; level < surface.level_count; ++level) {
    const auto grid = scene::levelGrid(quad.width, quad.height, level);
    for (std::uint32_t y = 0; y < grid.height; ++y) {
      for (std::uint32_t x = 0; x < grid.width; ++x) {
        const auto leaves = (std::min((x + 1) << level, quad.width) - (x << level)) *
                            (std::min((y + 1) << level, quad.height) - (y << level));
        patches.node_area.push_back(surface.texel_area * static_cast<float>(leaves));
      }
    }
  }
}

void addQuad(const Quad& quad, QuadScene& out) {
  auto& patches = *out.patches;
  const auto s = static_cast<std::uint32_t>(patches.surfaces.size());
  scene::Surface surface;
  surface.width = quad.width;
  surface.height = quad.height;
  surface.level_count = scene::levelCount(quad.width, quad.height);
  surface.first_node = {static_cast<std::uint32_t>(patches.node_area.size()), scene::kNone};
  surface.first_leaf = static_cast<std::uint32_t>(patches.leaves.size());
  surface.first_triangle = static_cast<std::uint32_t>(patches.triangles.size());
  surface.triangle_count = 2;
  surface.planar = true;
  surface.material = s;
  const glm::vec3 cross = glm::cross(quad.du, quad.dv), normal = glm::normalize(cross);
  surface.texel_area = glm::length(cross) / static_cast<float>(quad.width * quad.height);
  const auto first = static_cast<std::uint32_t>(patches.vertices.size());
  const auto w = static_cast<float>(quad.width), h = static_cast<float>(quad.height);
  for (const glm::vec2 c : {glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(1, 1), glm::vec2(0, 1)}) {
    patches.vertices.push_back({quad.origin + c.x * quad.du + c.y * quad.dv, s, glm::vec2(c.x * w, c.y * h), normal});
  }
  for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) patches.indices.push_back(first + i);
  for (int t = 0; t < 2; ++t) {
    patches.triangles.push_back({quad.origin, quad.du / w, quad.dv / h, normal});
    patches.triangle_surface.push_back(s);
  }
  for (std::uint32_t leaf = 0; leaf < quad.width * quad.height; ++leaf) {
    patches.leaves.push_back(
        {glm::vec2(static_cast<float>(leaf % quad.width) + 0.5F, static_cast<float>(leaf / quad.width) + 0.5F),
         surface.first_triangle, true});
  }
  addNodes(quad, surface, patches);
  if (quad.transmittance != glm::vec3(0.0F)) {
    surface.first_node[1] = static_cast<std::uint32_t>(patches.node_area.size());
    addNodes(quad, surface, patches);
  }
  patches.surfaces.push_back(surface);
}

}  // namespace

namespace {

glm::vec3 cosineDirection(const solver::HemicubeFrame& frame, const glm::dvec4& u) {
  const glm::vec3 n = frame.normal, a = frame.tangent, b = glm::cross(n, a);
  const double radius = std::sqrt(u.x), angle = 2.0 * std::numbers::pi * u.y;
  return a * static_cast<float>(radius * std::cos(angle)) + b * static_cast<float>(radius * std::sin(angle)) +
         n * static_cast<float>(std::sqrt(1.0 - u.x));
}

}  // namespace

namespace {

struct LitSide {
  const scene::Surface& surface;
  std::size_t face;
};
std::vector<LitSide> litSides(const scene::PatchScene& patches) {
  std::vector<LitSide> sides;
  for (const auto& surface : patches.surfaces)
    for (std::size_t face = 0; face < 2; ++face)
      if (surface.first_node[face] != scene::kNone) sides.push_back({surface, face});
  return sides;
}

}  // namespace

QuadScene makeQuadScene(const std::vector<Quad>& quads) {
  QuadScene out;
  out.patches = std::make_shared<scene::PatchScene>();
  for (const auto& quad : quads) addQuad(quad, out);
  out.materials.emission = out.materials.reflectance = scene::SideColours(*out.patches);
  const auto lets_through = [](const Quad& quad) { return quad.transmittance != glm::vec3(0.0F); };
  if (std::ranges::any_of(quads, lets_through)) out.materials.transmittance = scene::SideColours(*out.patches);
  std::size_t side = 0;
  for (const auto& quad : quads) {
    for (const auto end = side + (lets_through(quad) ? 2 : 1); side < end; ++side) {
      out.materials.emission.fill(side, quad.emission);
      out.materials.reflectance.fill(side, quad.reflectance);
      if (lets_through(quad)) out.materials.transmittance.fill(side, quad.transmittance);
    }
  }
  return out;
}

std::vector<Quad> cubeQuads(std::uint32_t leaves, const std::array<float, 6>& emission,
                            const std::array<float, 6>& reflectance) {
  const glm::vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), low(-0.5F), high(0.5F);
  std::vector<Quad> quads = {{low, z, x, leaves, leaves},      // y = -1/2, looks up: z x x = +y
                             {high, -x, -z, leaves, leaves},   // y = +1/2: (-x) x (-z) = x x z = -y
                             {low, x, y, leaves, leaves},      // z = -1/2: +z
                             {high, -y, -x, leaves, leaves},   // z = +1/2: y x x = -z
                             {low, y, z, leaves, leaves},      // x = -1/2: +x
                             {high, -z, -y, leaves, leaves}};  // x = +1/2: z x y = -x
  for (std::size_t i = 0; i < 6; ++i) {
    quads[i].emission = glm::vec3(emission[i]);
    quads[i].reflectance = glm::vec3(reflectance[i]);
  }
  return quads;
}

std::vector<Quad> openCube(std::size_t missing, float reflectance) {
  std::array<float, 6> all{};
  all.fill(reflectance);
  auto quads = cubeQuads(6, kDark, all);
  quads.erase(quads.begin() + static_cast<std::ptrdiff_t>(missing));
  return quads;
}

Result<void> RayTransport::setScene(std::shared_ptr<const scene::PatchScene> patches) {
  patches_ = std::move(patches);
  return {};
}

RayTransport::Hit RayTransport::cast(const glm::vec3& origin, const glm::vec3& direction) const {
  Hit nearest;
  nearest.distance = 1e30F;
  for (std::uint32_t s = 0; s < patches_->surfaces.size(); ++s) {
    const auto& surface = patches_->surfaces[s];
    const auto& frame = patches_->triangles[surface.first_triangle];
    const float towards = glm::dot(direction, frame.normal);
    const float t = glm::dot(frame.origin - origin, frame.normal) / towards;
    if (!(t > 1e-5F && t < nearest.distance)) continue;
    const glm::vec3 p = origin + t * direction - frame.origin;
    const glm::vec2 texel(glm::dot(p, frame.du) / glm::dot(frame.du, frame.du),
                          glm::dot(p, frame.dv) / glm::dot(frame.dv, frame.dv));
    const auto w = static_cast<float>(surface.width), h = static_cast<float>(surface.height);
    if (texel.x < 0.0F || texel.y < 0.0F || texel.x >= w || texel.y >= h) continue;
    nearest = {s, towards < 0.0F, texel, t};
  }
  return nearest;
}

/// Of the side that it is on; kNone: it has no leaves, or nothing was hit.
std::uint32_t RayTransport::nodeOf(const Hit& hit) const {
  if (hit.surface == scene::kNone) return scene::kNone;
  const auto& surface = patches_->surfaces[hit.surface];
  const auto first = surface.first_node[hit.front ? 0 : 1];
  if (first == scene::kNone) return first;
  return first + static_cast<std::uint32_t>(hit.texel.y) * surface.width + static_cast<std::uint32_t>(hit.texel.x);
}

void RayTransport::scatter(const solver::ScatterShot& shot, double scale, solver::FluxAccumulators& into) const {
  const auto key = solver::mixKeys(static_cast<std::uint64_t>(static_cast<std::int64_t>(shot.frame.origin.x * 1e6F)),
                                   static_cast<std::uint64_t>(static_cast<std::int64_t>(shot.frame.origin.y * 1e6F)));
  for (std::uint32_t i = 0; i < rays_; ++i) {
    const glm::dvec4 u = solver::sobol4(i, key);
    const glm::vec3 d = cosineDirection(shot.frame, u);
    const Hit hit = cast(shot.frame.origin, d);
    solver::Flux3 flux{};
    for (std::size_t c = 0; c < 3; ++c) flux[c] = std::llround(shot.flux[c] * scale / rays_);
    const auto node = nodeOf(hit);
    auto& target = hit.surface == scene::kNone ? into.escaped
                   : node == scene::kNone      ? into.backface
                                               : into.node[shot.half][node];
    for (std::size_t c = 0; c < 3; ++c) {
      target[c] += flux[c];
      if (node != scene::kNone) into.scattered[c] += flux[c];
    }
  }
}

/// What escapes, and what falls on backs, seen from the light points by cosine-distributed rays.
void RayTransport::countLost(const solver::GatherShot& shot, const solver::ShotBatch& batch, double light_area,
                             solver::FluxAccumulators& into) const {
  for (std::uint32_t k = 0; k < shot.point_count; ++k) {
    const auto& point = batch.points[shot.first_point + k];
    for (std::uint32_t i = 0; i < rays_; ++i) {
      const Hit hit = cast(point.origin, cosineDirection(point, solver::sobol4(i, k)));
      if (nodeOf(hit) != scene::kNone) continue;
      auto& target = hit.surface == scene::kNone ? into.escaped : into.backface;
      for (std::size_t c = 0; c < 3; ++c) {
        target[c] += std::llround(shot.radiosity[c] * light_area * batch.flux_scale / (rays_ * shot.point_count));
      }
    }
  }
}

void RayTransport::gather(const solver::GatherShot& shot, const solver::ShotBatch& batch,
                          solver::FluxAccumulators& into) const {
  glm::vec3 cross(0.0F);
  for (std::uint32_t k = 1; k + 1 < shot.corner_count; ++k)
    cross += glm::cross(shot.corners[k] - shot.corners[0], shot.corners[k + 1] - shot.corners[0]);
  const double light_area = 0.5 * static_cast<double>(glm::length(cross));
  countLost(shot, batch, light_area, into);
  for (const auto& [surface, face] : litSides(*patches_)) {
    const auto& frame = patches_->triangles[surface.first_triangle];
    const glm::vec3 normal = face == 0 ? frame.normal : -frame.normal;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const glm::vec2 texel(static_cast<float>(leaf % surface.width) + 0.5F,
                            static_cast<float>(leaf / surface.width) + 0.5F);
      const glm::vec3 p = frame.origin + texel.x * frame.du + texel.y * frame.dv;
      std::array<double, 2> factor{};
      for (std::uint32_t k = 0; k < shot.point_count; ++k) {
        const glm::vec3 to = batch.points[shot.first_point + k].origin - p;
        const float distance = glm::length(to);
        const float cosines = std::max(0.0F, glm::dot(to, normal)) * std::max(0.0F, -glm::dot(to, shot.normal));
        if (cosines <= 0.0F || cast(p, to / distance).distance < distance * 0.999F) continue;
        factor[2 * k >= shot.point_count ? 1 : 0] +=
            static_cast<double>(cosines / (distance * distance * distance * distance)) * light_area / std::numbers::pi;
      }
      const auto node = surface.first_node[face] + leaf;
      for (std::size_t c = 0; c < 3; ++c) {
        const double share = static_cast<double>(patches_->node_area[node]) * batch.flux_scale;
        if (shot.half != solver::kBothHalves) {
          const auto flux = wholeFlux(shot.radiosity[c] * (factor[0] + factor[1]) / shot.point_count * share);
          into.node[shot.half][node][c] += flux;
          into.gathered[c] += flux;
          continue;
        }
        for (std::size_t half = 0; half < 2; ++half) {  // each half of the points carries half of the radiosity
          const auto flux = wholeFlux(shot.radiosity[c] * factor[half] / shot.point_count * share);
          into.node[half][node][c] += flux;
          into.gathered[c] += flux;
        }
      }
    }
  }
}

template <typename Irradiance>
void RayTransport::light(const std::array<double, 3>& unit, const std::array<double, 3>& emitted, std::uint32_t half,
                         double scale, Irradiance irradiance, solver::FluxAccumulators& into) const {
  std::array<double, 3> caught{};
  for (const auto& [surface, face] : litSides(*patches_)) {
    const auto& frame = patches_->triangles[surface.first_triangle];
    const glm::vec3 normal = face == 0 ? frame.normal : -frame.normal;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const glm::vec2 texel(static_cast<float>(leaf % surface.width) + 0.5F,
                            static_cast<float>(leaf / surface.width) + 0.5F);
      const double e = irradiance(frame.origin + texel.x * frame.du + texel.y * frame.dv, normal);
      const auto node = surface.first_node[face] + leaf;
      for (std::size_t c = 0; c < 3; ++c) {
        const double flux = unit[c] * e * static_cast<double>(patches_->node_area[node]);
        into.node[half][node][c] += std::llround(flux * scale);
        into.gathered[c] += std::llround(flux * scale);
        caught[c] += flux;
      }
    }
  }
  for (std::size_t c = 0; c < 3; ++c) into.escaped[c] += std::llround((emitted[c] - caught[c]) * scale);
}

void RayTransport::point(const solver::PointShot& shot, double scale, solver::FluxAccumulators& into) const {
  const auto irradiance = [&](const glm::vec3& p, const glm::vec3& normal) {
    const glm::vec3 to = shot.frame.origin - p;
    const float distance = glm::length(to), cosine = glm::dot(to, normal) / distance;
    const float axis = -glm::dot(to, shot.frame.normal) / distance;
    if (cosine <= 0.0F || axis <= 0.0F || cast(p, to / distance).distance < distance) return 0.0;
    const float fade = std::clamp(axis * shot.cone_scale + shot.cone_offset, 0.0F, 1.0F);
    return static_cast<double>(fade * fade * cosine / (distance * distance));
  };
  light(shot.intensity, shot.emitted, shot.half, scale, irradiance, into);
}

void RayTransport::lamp(const solver::LampShot& shot, const solver::ShotBatch& batch,
                        solver::FluxAccumulators& into) const {
  const solver::Lamp lamp{shot.shape, std::span(batch.webs).subspan(shot.first_web, shot.web_size)};
  const auto irradiance = [&](const glm::vec3& p, const glm::vec3& normal) {
    double sum = 0.0;
    for (std::uint32_t k = 0; k < shot.receivers.count; ++k) {
      const auto point = solver::lampPoint(lamp, glm::dvec3(p), glm::dvec3(normal), glm::dvec2(shot.at[k]));
      if (!(point.brings > 0.0)) continue;
      const auto to = glm::vec3(point.position) - p;
      const float distance = glm::length(to);
      if (cast(p, to / distance).distance >= 0.999F * distance) sum += point.brings;
    }
    return sum / shot.receivers.count;
  };
  light(shot.intensity, shot.emitted, shot.half, batch.flux_scale, irradiance, into);
}

void RayTransport::parallel(const solver::ParallelShot& shot, const solver::ShotBatch& batch,
                            solver::FluxAccumulators& into) const {
  const auto irradiance = [&](const glm::vec3& p, const glm::vec3& normal) {
    double sum = 0.0;
    for (std::uint32_t v = shot.first_view; v < shot.first_view + shot.view_count; ++v) {
      const auto& direction = batch.views[v].direction;
      const float cosine = glm::dot(direction, normal);
      if (cosine > 0.0F && cast(p, direction).surface == scene::kNone) sum += static_cast<double>(cosine);
    }
    return sum;
  };
  light(shot.irradiance, shot.emitted, shot.half, batch.flux_scale, irradiance, into);
}

Result<solver::TransportCounters> RayTransport::run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) {
  std::this_thread::sleep_for(pause);
  for (const auto& shot : batch.scatter) scatter(shot, batch.flux_scale, into);
  for (const auto& shot : batch.gather) gather(shot, batch, into);
  for (const auto& shot : batch.point_lights) point(shot, batch.flux_scale, into);
  for (const auto& shot : batch.parallel) parallel(shot, batch, into);
  for (const auto& shot : batch.lamps) lamp(shot, batch, into);
  solver::TransportCounters counters;
  counters.point_images = batch.point_lights.size() + batch.lamps.size();
  counters.parallel_images = batch.views.size();
  counters.scatter_shots = batch.scatter.size();
  counters.gather_shots = batch.gather.size();
  for (const auto& shot : batch.gather) counters.gather_points += shot.point_count;  // a batch may hold others' points
  return counters;
}

}  // namespace radiosity::test
