// What an edit of light does to the sides of double-sided surfaces (lit_sides.h).
#include <algorithm>
#include <new>
#include <utility>

#include "common/log.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/shading/lit_sides.h"
#include "server/scene/values/material_of.h"

namespace radiosity::scene {
namespace {

std::vector<Bvh::Triangle> trianglesOf(const PatchScene& patches) {
  std::vector<Bvh::Triangle> triangles(patches.triangles.size());
  for (std::size_t i = 0; i < patches.indices.size(); ++i)
    triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
  return triangles;
}

/// The surfaces of `patches` under the light of `scene`.
SideScene sideSceneOf(const PatchScene& patches, const Scene& scene, const Sky& sky) {
  SideScene sides;
  sides.lights = lightsInUnitBox(scene, patches.centre, patches.scale);
  sides.sky = sky;
  sides.triangles = trianglesOf(patches);
  const Emitters emitters(scene, patches.cuts);
  sides.emits.resize(patches.triangles.size());
  for (const Surface& surface : patches.surfaces) {
    sides.groups.push_back({surface.first_triangle, surface.triangle_count, surface.instance,
                            materialOf(scene, surface).double_sided, passesLight(materialOf(scene, surface)),
                            static_cast<double>(surface.width) * surface.height});
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t)
      sides.emits[t] = emitters.shines(surface.instance, patches.triangle_source[t]);
  }
  return sides;
}

/// Whether `next` has a lamp, a light or a sky where `before` had none.
bool shinesAnew(const Scene& before, const Sky& sky_before, const Scene& next, const Sky& sky_next) {
  const auto kindled = [](const glm::vec3& was, const glm::vec3& is) { return !isBright(was) && isBright(is); };
  for (const bool above : {true, false})
    if (!isBright(sky_before, above) && isBright(sky_next, above)) return true;
  if (sky_next.sun && sky_next.sun != sky_before.sun && isBright(sky_next.sun->illuminance)) return true;
  for (std::size_t m = 0; m < next.materials.size(); ++m) {
    const auto was = m < before.materials.size() ? before.materials[m].emission : glm::vec3(0.0F);
    if (kindled(was, next.materials[m].emission)) return true;
  }
  return std::ranges::any_of(next.lights, [&](const PunctualLight& light) {
    return isBright(light.intensity) && std::ranges::none_of(before.lights, [&](PunctualLight old) {
             const bool shone = isBright(old.intensity);
             old.intensity = light.intensity;
             return shone && old == light;
           });
  });
}

}  // namespace

geometry::RayScene raySceneOf(std::span<const geometry::Triangle> triangles) {
  auto built = geometry::RayScene::build(triangles);
  if (!built) {
    log::error("light on sides cannot be looked for: {}", built.error().text());
    throw std::bad_alloc();
  }
  return std::move(*built);
}

geometry::RayScene raySceneOf(const PatchScene& patches) { return raySceneOf(trianglesOf(patches)); }

bool isLeftCoarse(const Scene& scene, const PatchScene& patches, const Surface& surface) {
  const double texel = patches.texel / static_cast<double>(scene.instances[surface.instance].texel_scale);
  return surface.width == 1 && surface.height == 1 &&
         static_cast<double>(surface.texel_area) > kCoarse * texel * texel && materialOf(scene, surface).double_sided;
}

bool reachesDarkSides(const PatchScene& patches, const Scene& before, const Sky& sky_before, const Scene& next,
                      const Sky& sky_next, const TreeAtHand& tree) {
  std::vector<std::array<bool, 2>> asked(patches.surfaces.size(), {false, false});
  bool any = false;
  for (std::size_t s = 0; s < asked.size(); ++s) {
    const Surface& surface = patches.surfaces[s];
    if (!materialOf(next, surface).double_sided) continue;
    asked[s][0] = isLeftCoarse(next, patches, surface) &&
                  !patches.cuts.isHidden(surface.instance, patches.triangle_source[surface.first_triangle]);
    asked[s][1] = surface.shows_back && surface.first_node[1] == kNone;  // nobody sees what is sealed
    any |= asked[s][0] || asked[s][1];
  }
  if (!any || !shinesAnew(before, sky_before, next, sky_next)) return false;
  const auto sides = sideSceneOf(patches, next, sky_next);
  // Photons find what a lamp lights; only the sky and the sun send none.
  const auto isSun = [](const PunctualLight& light) { return light.kind == LightKind::kDirectional; };
  const bool far = isBright(sky_next, true) || isBright(sky_next, false) || std::ranges::any_of(sides.lights, isSun);
  const auto at_hand = tree ? tree() : nullptr;
  const auto light =
      lightOnSides(sides, asked, far ? LookFor::kPhotonsAndPaths : LookFor::kPhotonsAlone, at_hand.get());
  for (std::size_t s = 0; s < asked.size(); ++s)
    for (std::size_t side = 0; side < 2; ++side)
      if (asked[s][side] && light[s][side] == SideLight::kLit) return true;
  return false;
}

}  // namespace radiosity::scene
