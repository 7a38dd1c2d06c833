#include "server/engine/publish/quantity_pages.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <utility>

#include "server/scene/lightmap/translucent_texels.h"
#include "server/solver/error/texel_error.h"

namespace radiosity::engine {
namespace {

using scene::Seams;

/// What emits, and what is reflected of the light that assemble() fits.
QuantityValues radiosity(const LitScene& lit) {
  QuantityValues values{Quantity::kRadiosity, {}, {}, false, lit.ownLight(), {}};
  values.nodes.resize(lit.patches().nodeCount());
  values.reflectance.resize(lit.patches().nodeCount());
  std::size_t side = 0;
  for (const auto& surface : lit.patches().surfaces) {
    for (const auto first : surface.first_node) {
      if (first == scene::kNone) continue;
      const auto emission = lit.materials().emission.side(side), reflectance = lit.materials().reflectance.side(side);
      for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
        values.nodes[first + leaf] = emission[leaf];
        values.reflectance[first + leaf] = reflectance[leaf];
      }
      if (lit.materials().transmittance.sideCount() > 0) {
        const auto transmittance = lit.materials().transmittance.side(side);
        values.transmittance.resize(values.nodes.size());
        for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf)
          values.transmittance[first + leaf] = transmittance[leaf];
      }
      ++side;
    }
  }
  return values;
}

/// What translucent surfaces let through. `transmittance`: by node; empty: there are none.
void addPassed(const scene::PatchScene& patches, const std::vector<glm::vec3>& transmittance,
               const std::vector<glm::vec3>& irradiance, std::vector<glm::vec3>& radiosity) {
  for (const auto& surface : patches.surfaces) {
    const auto [front, back] = surface.first_node;
    if (transmittance.empty() || front == scene::kNone || back == scene::kNone) continue;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      radiosity[front + leaf] += transmittance[front + leaf] * irradiance[back + leaf];
      radiosity[back + leaf] += transmittance[back + leaf] * irradiance[front + leaf];
    }
  }
}

std::vector<glm::vec3> errorSquared(const LitScene& lit) {
  const auto& solver = lit.solver();
  auto squares = solver::texelErrorSquared(lit.patches(), solver.halfIrradiance(0), solver.halfIrradiance(1),
                                           solver.irradiance(), solver.error(), solver.commonErrorSquared());
  scene::joinTranslucentSides(lit.patches(), lit.materials(), squares, scene::SidesOf::kSquares);
  return squares;
}

/// Of each side, away from the surface.
std::vector<glm::vec3> normals(const LitScene& lit) {
  const auto& patches = lit.patches();
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(0.5F));
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const auto triangle = patches.leaves[surface.first_leaf + leaf].triangle;
      if (triangle == scene::kNone) continue;
      const glm::vec3 half = 0.5F * patches.triangles[triangle].normal;
      const auto& [front, back] = surface.first_node;
      if (front != scene::kNone) values[front + leaf] = 0.5F + half;
      if (back != scene::kNone) values[back + leaf] = 0.5F - half;
    }
  }
  return values;
}

/// `idOf(node)` of each leaf with area, at its texel. Where a file's own charts overlap, the first is shown.
template <typename IdOf>
std::vector<IdImage> placeIds(const scene::PatchScene& patches, const IdOf& idOf) {
  std::vector<IdImage> pages;
  for (const auto& page : patches.pages)
    pages.push_back({static_cast<int>(page.width), static_cast<int>(page.height),
                     std::vector<std::uint32_t>(std::size_t{page.width} * page.height, kNoId)});
  for (const auto& surface : patches.surfaces) {
    for (std::size_t side = 0; side < 2; ++side) {
      const auto first = surface.first_node[side];
      if (first == scene::kNone) continue;
      const auto& place = surface.place[side];
      auto& page = pages[place.page];
      for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
        const std::size_t x = place.x + leaf % surface.width, y = place.y + leaf / surface.width;
        auto& id = page.ids[y * static_cast<std::size_t>(page.width) + x];
        if (id == kNoId && patches.node_area[first + leaf] > 0.0F) id = idOf(first + leaf);
      }
    }
  }
  return pages;
}

std::vector<IdImage> idPages(const LitScene& lit, Quantity quantity) {
  if (quantity == Quantity::kPatchId) return placeIds(lit.patches(), [](std::uint32_t node) { return node; });
  const auto levels = lit.solver().shotLevels();
  return placeIds(lit.patches(), [&](std::uint32_t node) {
    return levels[node] == solver::Solver::kNeverShot ? kNoId : std::uint32_t{levels[node]};
  });
}

}  // namespace

QuantityValues readQuantity(const LitScene& lit, Quantity quantity) {
  switch (quantity) {
    case Quantity::kIrradiance:
      return {quantity, {}, {}, false, lit.shownLight(), {}};
    case Quantity::kRadiosity:
      return radiosity(lit);
    case Quantity::kError:
      return {quantity, errorSquared(lit), {}, true};
    case Quantity::kUnshot:
      return {quantity, lit.solver().unshot(), {}, false};
    case Quantity::kNormal:
      return {quantity, normals(lit), {}, false};
    case Quantity::kPatchId:
    case Quantity::kMipLevel:
      break;
  }
  return {quantity, {}, idPages(lit, quantity), false};
}

QuantityPages assemble(const scene::PatchScene& patches, QuantityValues values) {
  QuantityPages pages{values.quantity, {}, std::move(values.ids), values.squared};
  const auto seams = values.quantity == Quantity::kIrradiance ? Seams::kStitched : Seams::kLeft;
  if (values.quantity == Quantity::kIrradiance) values.nodes = fitTexels(patches, values.light);
  if (values.quantity == Quantity::kRadiosity) {
    const auto irradiance = fitTexels(patches, values.light);
    for (std::size_t n = 0; n < irradiance.size(); ++n) values.nodes[n] += values.reflectance[n] * irradiance[n];
    addPassed(patches, values.transmittance, irradiance, values.nodes);
  }
  if (!holdsIds(values.quantity)) pages.values = assemblePages(patches, values.nodes, seams);
  return pages;
}

QuantityPages makePages(const LitScene& lit, Quantity quantity) {
  return assemble(lit.patches(), readQuantity(lit, quantity));
}

Image shown(const QuantityPages& pages, Image values) {
  if (!pages.squared) return values;
  for (auto& pixel : values.pixels)
    for (int c = 0; c < 3; ++c) pixel[c] = std::sqrt(std::max(0.0F, pixel[c]));
  return values;
}

}  // namespace radiosity::engine
