#include "server/engine/lit/scene_change.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <span>
#include <utility>

#include "server/scene/shading/emitters.h"
#include "server/scene/shading/opacity.h"
#include "server/scene/shading/specular.h"

namespace radiosity::engine {
namespace {

using scene::AlphaMode;
using scene::Material;
using scene::Scene;
using scene::TextureUse;

/// The same picture in the same place; textures are numbered anew by every import.
bool sameTexture(const Scene& a, TextureUse use_a, const Scene& b, TextureUse use_b) {
  const bool none_a = use_a.texture == scene::kNone, none_b = use_b.texture == scene::kNone;
  if (none_a || none_b) return none_a == none_b;
  const auto &in_a = a.textures.element(use_a.texture), &in_b = b.textures.element(use_b.texture);
  if (in_a != in_b && *in_a != *in_b) return false;
  use_a.texture = use_b.texture = 0;
  return use_a == use_b;
}

/// All that decides how much passes, and of which colour. Factors by themselves, since those of metal are 1 as often as
/// not, whatever the textures say.
bool samePassage(const Scene& a, const Material& m, const Scene& b, const Material& n) {
  if (m.transmission <= 0.0F && n.transmission <= 0.0F) return true;
  return m.transmission == n.transmission && m.base_color == n.base_color && m.attenuation == n.attenuation &&
         m.metallic == n.metallic && m.specular == n.specular &&
         sameTexture(a, m.transmission_texture, b, n.transmission_texture) &&
         sameTexture(a, m.base_color_texture, b, n.base_color_texture) &&
         sameTexture(a, m.metallic_texture, b, n.metallic_texture) &&
         sameTexture(a, m.specular_texture, b, n.specular_texture);
}

/// Which sides a surface has, and where one can see through it.
bool sameShape(const Scene& a, const Material& m, const Scene& b, const Material& n) {
  if (m.double_sided != n.double_sided || m.alpha_mode != n.alpha_mode || m.isTranslucent() != n.isTranslucent() ||
      !samePassage(a, m, b, n) || scene::isSeeThrough(m) != scene::isSeeThrough(n) ||
      scene::glassFace(m) != scene::glassFace(n))
    return false;
  if (m.alpha_mode == AlphaMode::kOpaque) return true;
  return m.alpha == n.alpha && m.alpha_cutoff == n.alpha_cutoff &&
         sameTexture(a, m.base_color_texture, b, n.base_color_texture);
}

/// Of what reflects as a mirror does; nothing else depends on it.
bool sameGloss(const Scene& a, const Material& m, const Scene& b, const Material& n) {
  if (!scene::isSpecular(m) && !scene::isSpecular(n)) return true;
  return m.roughness == n.roughness && m.ior == n.ior && sameTexture(a, m.roughness_texture, b, n.roughness_texture);
}

/// Of what passes on light diffusely.
bool samePassing(const Scene& a, const Material& m, const Scene& b, const Material& n) {
  return m.diffuse_transmission == n.diffuse_transmission &&
         m.diffuse_transmission_color == n.diffuse_transmission_color &&
         sameTexture(a, m.diffuse_transmission_texture, b, n.diffuse_transmission_texture) &&
         sameTexture(a, m.diffuse_transmission_color_texture, b, n.diffuse_transmission_color_texture);
}

bool sameShading(const Scene& a, const Material& m, const Scene& b, const Material& n) {
  return m.base_color == n.base_color && m.transmission == n.transmission && m.attenuation == n.attenuation &&
         m.metallic == n.metallic && m.specular == n.specular && sameGloss(a, m, b, n) && m.emission == n.emission &&
         samePassing(a, m, b, n) && sameTexture(a, m.base_color_texture, b, n.base_color_texture) &&
         sameTexture(a, m.metallic_texture, b, n.metallic_texture) &&
         sameTexture(a, m.specular_texture, b, n.specular_texture) &&
         sameTexture(a, m.emissive_texture, b, n.emissive_texture);
}

/// Whether surfaces may begin or cease to emit; which pixels they show of another texture is not looked at.
bool maySwitch(const Scene& a, const Material& m, const Scene& b, const Material& n) {
  if (mayEmit(m) != mayEmit(n)) return true;
  return mayEmit(m) && !sameTexture(a, m.emissive_texture, b, n.emissive_texture);
}

/// Where they both are hidden it does not matter where they are.
bool sameInstance(const scene::Instance& a, const scene::Instance& b) {
  if (a.visible || b.visible) return a == b;
  return a.node == b.node && a.primitive == b.primitive;
}

/// By material: whether a visible surface is made of it.
std::vector<bool> usedMaterials(const Scene& scene) {
  std::vector<bool> used(scene.materials.size(), false);
  for (const auto& instance : scene.instances) {
    const auto material = scene.primitives[instance.primitive].material;
    if (instance.visible && material < used.size()) used[material] = true;
  }
  return used;
}

/// An instance's node and primitive.
using Placed = std::pair<std::uint32_t, std::uint32_t>;

/// Whether one of these is placed more than once. Of several instances of one node, each has a place of its own beside
/// the node's.
bool haveFellows(std::vector<Placed> some, const Scene& scene) {
  if (some.empty()) return false;
  std::ranges::sort(some);
  some.erase(std::unique(some.begin(), some.end()), some.end());
  const auto all = std::ranges::count_if(scene.instances, [&](const scene::Instance& instance) {
    return std::ranges::binary_search(some, Placed(instance.node, instance.primitive));
  });
  return static_cast<std::size_t>(all) > some.size();
}

}  // namespace

SceneChange changeBetween(const Scene& before, const Scene& after) {
  SceneChange change;
  change.geometry =
      before.primitives != after.primitives || !std::ranges::equal(before.instances, after.instances, sameInstance);
  if (change.geometry) return change;
  const auto used = usedMaterials(before);
  const auto both = std::min(before.materials.size(), after.materials.size());
  for (std::uint32_t m = 0; m < both; ++m) {
    const auto &old_one = before.materials[m], &new_one = after.materials[m];
    if (!used[m]) continue;
    if (!sameShape(before, old_one, after, new_one)) {
      change.geometry = true;
      return change;
    }
    if (!sameShading(before, old_one, after, new_one)) change.materials.push_back(m);
    if (maySwitch(before, old_one, after, new_one)) change.switched.push_back(m);
  }
  return change;
}

/// Of what a switched surface lies on, or under, one of the two is covered somewhere, and their bounds meet.
bool mayUncover(const scene::PatchScene& patches, const std::vector<std::uint32_t>& switched) {
  if (switched.empty()) return false;
  std::vector<bool> is_covered(patches.surfaces.size(), false);
  const auto surfaceOf = [&](std::uint32_t leaf) {
    const auto after = std::ranges::upper_bound(patches.surfaces, leaf, {}, &scene::Surface::first_leaf);
    return static_cast<std::size_t>(after - patches.surfaces.begin() - 1);
  };
  for (const auto& covered : patches.covered) is_covered[surfaceOf(covered.leaf)] = true;
  for (std::size_t s = 0; s < patches.surfaces.size(); ++s) {
    const auto& surface = patches.surfaces[s];
    const auto leaves = std::span(patches.leaves).subspan(surface.first_leaf, surface.width * surface.height);
    if (std::ranges::any_of(leaves, &scene::LeafPoint::beneath)) is_covered[s] = true;
  }
  const auto meet = [](const scene::Surface& a, const scene::Surface& b) {
    constexpr float kMargin = 1e-5F;  // unit box: faces no farther apart lie on each other
    return glm::all(glm::lessThanEqual(a.bounds_min, b.bounds_max + kMargin)) &&
           glm::all(glm::lessThanEqual(b.bounds_min, a.bounds_max + kMargin));
  };
  std::vector<std::size_t> covered;
  for (std::size_t s = 0; s < is_covered.size(); ++s)
    if (is_covered[s]) covered.push_back(s);
  if (covered.empty()) return false;
  for (std::size_t s = 0; s < patches.surfaces.size(); ++s) {
    const auto& surface = patches.surfaces[s];
    if (std::ranges::find(switched, surface.material) == switched.end()) continue;
    for (const auto t : covered) {
      if (s == t || meet(surface, patches.surfaces[t])) return true;
    }
  }
  return false;
}

bool onlyNodesMoved(const Scene& before, const Scene& after) {
  if (before.primitives != after.primitives || before.instances.size() != after.instances.size()) return false;
  std::vector<Placed> moved;
  for (std::size_t i = 0; i < before.instances.size(); ++i) {
    auto instance = before.instances[i];
    if (instance.world != after.instances[i].world) moved.emplace_back(instance.node, instance.primitive);
    instance.world = after.instances[i].world;
    if (instance != after.instances[i]) return false;
  }
  if (haveFellows(std::move(moved), before)) return false;
  const auto used = usedMaterials(before);
  const auto both = std::min(before.materials.size(), after.materials.size());
  for (std::size_t m = 0; m < both; ++m) {
    if (used[m] && !sameShape(before, before.materials[m], after, after.materials[m])) return false;
  }
  return true;
}

}  // namespace radiosity::engine
