#include "server/scene/lightmap/translucent_texels.h"

#include <array>
#include <glm/common.hpp>

namespace radiosity::scene {
namespace {

using Nodes = std::vector<glm::vec3>;

/// Of side `number`, from its own light and that of the other side.
void joinSide(const PatchMaterials& materials, std::size_t number, SidesOf what, const Nodes& own, const Nodes& beyond,
              glm::vec3* joined) {
  const auto reflectance = materials.reflectance.side(number), transmittance = materials.transmittance.side(number);
  const auto base = materials.base_reflectance.side(number);
  for (std::size_t leaf = 0; leaf < own.size(); ++leaf) {
    if (transmittance[leaf] == glm::vec3(0.0F)) continue;
    const glm::vec3 whole = glm::max(base[leaf], kLeastBase);
    auto of_own = reflectance[leaf] / whole, of_beyond = transmittance[leaf] / whole;
    if (what == SidesOf::kSquares) {
      of_own *= of_own;
      of_beyond *= of_beyond;
    }
    const auto light = of_own * own[leaf] + of_beyond * beyond[leaf];
    for (int c = 0; c < 3; ++c) joined[leaf][c] = base[leaf][c] > 0.0F ? light[c] : own[leaf][c];
  }
}

}  // namespace

void joinTranslucentSides(const PatchScene& patches, const PatchMaterials& materials, Nodes& nodes, SidesOf what) {
  if (materials.transmittance.sideCount() == 0 || nodes.empty()) return;
  std::size_t side = 0;
  for (const auto& surface : patches.surfaces) {
    const auto number = side;
    for (const auto first : surface.first_node) side += first != kNone ? 1 : 0;
    if (side != number + 2) continue;
    const auto lightOf = [&](std::uint32_t first) {
      return Nodes(nodes.begin() + first, nodes.begin() + first + surface.width * surface.height);
    };
    const auto [front, back] = surface.first_node;
    if (const auto of = materials.transmittance.side(number); of.isUniform() && of[0] == glm::vec3(0.0F)) continue;
    const auto of_front = lightOf(front), of_back = lightOf(back);
    joinSide(materials, number, what, of_front, of_back, &nodes[front]);
    joinSide(materials, number + 1, what, of_back, of_front, &nodes[back]);
  }
}

}  // namespace radiosity::scene
