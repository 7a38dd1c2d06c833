#include "server/solver/rays/specular_leaves.h"

#include <algorithm>
#include <bit>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

bool reflects(const glm::vec3& colour) { return std::max({colour.x, colour.y, colour.z}) > 0.0F; }

std::uint64_t bitsOf(float x) { return std::bit_cast<std::uint32_t>(x); }

}  // namespace

std::shared_ptr<const SpecularLeaves> SpecularLeaves::find(const std::vector<Side>& sides,
                                                           const scene::PatchMaterials& materials,
                                                           const std::vector<scene::Surface>& surfaces) {
  std::shared_ptr<SpecularLeaves> found;
  std::size_t leaves = 0;
  for (const auto& side : sides) leaves += side.leaf_count;
  // Rays that go through coloured glass are followed as those are that mirrors reflect.
  if (std::ranges::any_of(surfaces, [](const auto& surface) { return surface.first_tint != scene::kNone; }))
    found.reset(new SpecularLeaves(leaves));
  for (const auto& side : sides) {
    if (materials.specular.sideCount() == 0) break;
    const auto colours = materials.specular.side(side.number), lobe = materials.lobe.side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      if (!reflects(colours[leaf])) {
        if (colours.isUniform()) break;
        continue;
      }
      if (!found) found.reset(new SpecularLeaves(leaves));
      const auto value = side.first_value + leaf;
      found->roughness_[value] = lobe[leaf].x;
      found->colour_[value] = glm::vec4(colours[leaf], lobe[leaf].y);
      if (const auto& face = surfaces[side.surface].glass; face.isGlass()) {
        found->glass_.resize(leaves);
        found->glass_[value] = {face, lobe[leaf].z};
        found->key_ = mixKeys(found->key_, bitsOf(lobe[leaf].z));
      }
      const auto& colour = found->colour_[value];
      found->key_ = mixKeys(mixKeys(found->key_, bitsOf(colour.x) << 32U | bitsOf(colour.y)),
                            mixKeys(bitsOf(colour.z) << 32U | bitsOf(colour.w), bitsOf(lobe[leaf].x) << 32U | value));
    }
  }
  return found;
}

}  // namespace radiosity::solver
