// Emission and reflectance of patches: materials integrated over leaves, means above them (patch_scene.h).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numeric>
#include <span>
#include <string>

#include "common/task.h"
#include "server/geometry/triangle_rows.h"
#include "server/scene/shading/shade.h"
#include "server/scene/shading/shade_layers.h"
#include "server/scene/shading/specular.h"
#include "server/scene/values/chart_corners.h"
#include "server/scene/values/material_of.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {
namespace {

constexpr float kMaxReflectance = 0.999F;
constexpr int kSide = 4;  ///< kSide^2 samples a leaf

using Value = MaterialLayers::Value;

/// What PatchMaterials has of a node. The last two are of translucent materials alone.
constexpr std::size_t kColours = 6, kOfOneSide = 4;
template <typename Colour>
using Colours = std::array<Colour, kColours>;

Colours<SideColours*> coloursOf(PatchMaterials& to) {
  return {&to.emission, &to.reflectance, &to.specular, &to.lobe, &to.transmittance, &to.base_reflectance};
}

Colours<glm::vec3> coloursOf(const Value& of) {
  return {of.emission, of.reflectance, of.specular, of.lobe, of.transmittance, of.base_reflectance};
}

Value valueOf(const Colours<glm::vec3>& colours) {
  const auto& [emission, reflectance, specular, lobe, transmittance, base_reflectance] = colours;
  return {.emission = emission,
          .reflectance = reflectance,
          .transmittance = transmittance,
          .base_reflectance = base_reflectance,
          .specular = specular,
          .lobe = lobe};
}

/// Of a leaf's samples, by how much of the surface is there: the mean of what is everywhere the same is just that.
struct Sum {
  Colours<glm::dvec3> colours{};
  double weight = 0.0;
};

class MaterialShader {
 public:
  MaterialShader(const Scene& scene, const PatchScene& patches, std::uint32_t material, TexturePyramids& pyramids,
                 PatchMaterials& out)
      : scene_(scene),
        patches_(patches),
        out_(out),
        name_(materialOf(scene, material).name),
        is_translucent_(materialOf(scene, material).isTranslucent()),
        layers_(scene, materialOf(scene, material), pyramids) {}

  void shade(std::uint32_t id) {
    surface_ = patches_.surfaces[id];
    instance_ = &scene_.instances[surface_.instance];
    primitive_ = &patches_.cuts.primitiveOf(scene_, surface_.instance);
    if (!layers_.hasTextures() && primitive_->color0.empty()) {
      fill(clamped(layers_.at([](const TextureUse&) { return MaterialLayers::Place{}; }, glm::vec4(1.0F))));
      limitPassing();
      return;
    }
    shadeLeaves();
    for (const std::uint32_t first : surface_.first_node) {
      if (first == kNone) continue;
      const auto side = out_.emission.sideOf(first);
      for (std::size_t i = 0; i < kColours; ++i) {
        if (!isKept(i)) continue;
        average(first, nodes_[i]);
        coloursOf(out_)[i]->assign(side, nodes_[i]);
      }
    }
    limitPassing();
  }

  [[nodiscard]] bool wasClamped() const { return was_clamped_; }
  [[nodiscard]] bool isTranslucent() const { return is_translucent_; }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  Value clamped(Value value) {
    for (int c = 0; c < 3; ++c) {
      float &rho = value.reflectance[c], &tau = value.transmittance[c];
      if (const float sum = rho + tau; sum > kMaxReflectance) {
        was_clamped_ = true;
        rho = tau > 0.0F ? rho * (kMaxReflectance / sum) : kMaxReflectance;
        tau *= kMaxReflectance / sum;
      }
      if (!(rho > 0.0F)) rho = 0.0F;
      if (!(tau > 0.0F)) tau = 0.0F;
      if (!(value.specular[c] > 0.0F)) value.specular[c] = 0.0F;
      if (!(value.emission[c] > 0.0F) || !std::isfinite(value.emission[c])) value.emission[c] = 0.0F;
    }
    return value;
  }

  /// What hardly reflects as a mirror does reflects all diffusely.
  static Value folded(Value value) {
    if (std::max({value.specular.r, value.specular.g, value.specular.b}) >= kLeastSpecular || value.lobe.z > 0.0F)
      return value;
    value.reflectance = glm::min(value.reflectance + value.specular, kMaxReflectance - value.transmittance);
    value.base_reflectance = glm::min(value.base_reflectance + value.specular, glm::vec3(kMaxReflectance));
    value.specular = value.lobe = glm::vec3(0.0F);
    return value;
  }

  void fill(const Value& whole) {
    const auto value = folded(whole);
    for (const std::uint32_t first : surface_.first_node) {
      if (first == kNone) continue;
      const auto side = out_.emission.sideOf(first);
      for (std::size_t i = 0; i < kColours; ++i)
        if (isKept(i)) coloursOf(out_)[i]->fill(side, coloursOf(value)[i]);
    }
  }

  /// Where less of a leaf is free behind than in front no more passes than arrives there.
  void limitPassing() {
    if (!isKept(kOfOneSide)) return;
    for (std::size_t i = 0; i < 2; ++i) {
      const auto first = surface_.first_node[i], other = surface_.first_node[1 - i];
      const auto side = out_.transmittance.sideOf(first);
      const auto count = std::size_t{surface_.width} * surface_.height;
      const auto part = [&](std::size_t leaf) {
        const float to = patches_.node_area[first + leaf], from = patches_.node_area[other + leaf];
        return to > from ? from / to : 1.0F;
      };
      std::size_t leaf = 0;
      while (leaf < count && part(leaf) == 1.0F) ++leaf;
      if (leaf == count) continue;
      auto& passed = nodes_.front();
      passed.resize(levelGrid(surface_.width, surface_.height, surface_.level_count).offset);
      for (leaf = 0; leaf < count; ++leaf) passed[leaf] = part(leaf) * out_.transmittance.side(side)[leaf];
      average(first, passed);
      out_.transmittance.assign(side, passed);
    }
  }

  /// What would pass to a side without patches is absorbed.
  [[nodiscard]] bool isKept(std::size_t colour) const {
    if (colour < kOfOneSide) return coloursOf(out_)[colour]->sideCount() > 0;
    return is_translucent_ && surface_.first_node[0] != kNone && surface_.first_node[1] != kNone;
  }

  [[nodiscard]] glm::vec2 uvAt(const TextureUse& use, const ChartCorners& c, const glm::vec3& w) const {
    const auto& set = use.texcoord == 1 ? primitive_->texcoord1 : primitive_->texcoord0;
    if (set.empty()) return glm::vec2(0.0F);
    return set[c.vertex[0]] * w[0] + set[c.vertex[1]] * w[1] + set[c.vertex[2]] * w[2];
  }

  /// Of a texture, over the part of a leaf that a sample stands for.
  [[nodiscard]] MaterialLayers::Place placeOf(const TextureUse& use, const ChartCorners& c, const glm::dvec2& p) const {
    const double step = 1.0 / kSide;
    const glm::vec2 uv = uvAt(use, c, c.weightsAt(p));
    const glm::vec2 right = uvAt(use, c, c.weightsAt(p + glm::dvec2(step, 0.0))) - uv;
    const glm::vec2 down = uvAt(use, c, c.weightsAt(p + glm::dvec2(0.0, step))) - uv;
    return {uv, glm::max(glm::abs(right), glm::abs(down))};
  }

  Value valueAt(const ChartCorners& c, const glm::dvec2& p) {
    glm::vec4 vertex(1.0F);
    if (!primitive_->color0.empty()) {
      const glm::vec3 w = glm::clamp(c.weightsAt(p), 0.0F, 1.0F);
      const auto& color = primitive_->color0;
      vertex = color[c.vertex[0]] * w[0] + color[c.vertex[1]] * w[1] + color[c.vertex[2]] * w[2];
    }
    return layers_.at([&](const TextureUse& use) { return placeOf(use, c, p); }, vertex);
  }

  /// Triangle by triangle, each sample point of the leaf grid that lies in it.
  void shadeLeaves() {
    const std::size_t count = std::size_t{surface_.width} * surface_.height;
    sums_.assign(count, Sum{});
    const std::size_t nodes = levelGrid(surface_.width, surface_.height, surface_.level_count).offset;
    for (auto& of_nodes : nodes_) of_nodes.resize(nodes);
    for (std::uint32_t t = surface_.first_triangle; t < surface_.first_triangle + surface_.triangle_count; ++t) {
      interruptionPoint();
      sampleTriangle(cornersOf(patches_, t, *instance_, *primitive_));
    }
    for (std::size_t i = 0; i < count; ++i) {
      const LeafPoint& point = patches_.leaves[surface_.first_leaf + i];
      Value value;
      if (const auto& sum = sums_[i]; sum.weight > 0.0) {
        Colours<glm::vec3> means;
        for (std::size_t k = 0; k < kColours; ++k) means[k] = sum.colours[k] / sum.weight;
        value = valueOf(means);
      } else if (point.triangle != kNone) {
        const auto corners = cornersOf(patches_, point.triangle, *instance_, *primitive_);
        value = clamped(valueAt(corners, glm::dvec2(point.texel)));
      }
      const auto colours = coloursOf(folded(value));
      for (std::size_t k = 0; k < kColours; ++k) nodes_[k][i] = colours[k];
    }
  }

  void sampleTriangle(const ChartCorners& c) {
    const glm::dvec2 low = glm::min(glm::min(c.texel[0], c.texel[1]), c.texel[2]) * double{kSide};
    const glm::dvec2 high = glm::max(glm::max(c.texel[0], c.texel[1]), c.texel[2]) * double{kSide};
    const auto end_y = std::min(static_cast<int>(std::ceil(high.y)), static_cast<int>(surface_.height) * kSide);
    const auto end_x = std::min(static_cast<int>(std::ceil(high.x)), static_cast<int>(surface_.width) * kSide);
    const std::array<glm::dvec2, 3> scaled{c.texel[0] * double{kSide}, c.texel[1] * double{kSide},
                                           c.texel[2] * double{kSide}};
    for (int y = std::max(0, static_cast<int>(std::floor(low.y))); y < end_y; ++y) {
      const auto columns = columnsOf(scaled, y, static_cast<int>(surface_.width) * kSide);
      for (int x = std::max(columns.first, static_cast<int>(std::floor(low.x))); x < std::min(end_x, columns.end);
           ++x) {
        const glm::dvec2 p((x + 0.5) / kSide, (y + 0.5) / kSide);
        const glm::vec3 w = c.weightsAt(p);
        if (std::min({w.x, w.y, w.z}) < -1e-6F) continue;
        const std::size_t leaf =
            static_cast<std::size_t>(y / kSide) * surface_.width + static_cast<std::size_t>(x / kSide);
        const Value found = valueAt(c, p);
        if (!(found.weight > 0.0F)) continue;  // nothing is there
        const Value value = clamped(found);
        const double weight = value.weight;
        const auto colours = coloursOf(value);
        for (std::size_t k = 0; k < kColours; ++k) sums_[leaf].colours[k] += glm::dvec3(colours[k]) * weight;
        sums_[leaf].weight += weight;
      }
    }
  }

  /// Of the levels above leaves, by what of them is there on the side that begins with node `first`.
  void average(std::uint32_t first, std::vector<glm::vec3>& values) const {
    LevelGrid below = levelGrid(surface_.width, surface_.height, 0);
    for (std::uint32_t level = 1; level < surface_.level_count; ++level) {
      const LevelGrid grid = levelGrid(surface_.width, surface_.height, level);
      for (std::uint32_t y = 0; y < grid.height; ++y)
        for (std::uint32_t x = 0; x < grid.width; ++x) {
          glm::dvec3 sum(0.0);
          double weight = 0.0;
          for (std::uint32_t cy = 2 * y; cy < std::min(2 * y + 2, below.height); ++cy)
            for (std::uint32_t cx = 2 * x; cx < std::min(2 * x + 2, below.width); ++cx) {
              const std::uint32_t child = below.offset + cy * below.width + cx;
              const double area = patches_.node_area[first + child];
              weight += area;
              sum += glm::dvec3(values[child]) * area;
            }
          values[grid.offset + y * grid.width + x] = weight > 0.0 ? glm::vec3(sum / weight) : glm::vec3(0.0F);
        }
      below = grid;
    }
  }

  const Scene& scene_;
  const PatchScene& patches_;
  PatchMaterials& out_;
  std::string name_;
  bool is_translucent_;
  MaterialLayers layers_;
  Surface surface_;
  const Instance* instance_ = nullptr;
  const Primitive* primitive_ = nullptr;
  std::vector<Sum> sums_;
  Colours<std::vector<glm::vec3>> nodes_;  ///< by node of a side
  bool was_clamped_ = false;
};

}  // namespace

namespace {

/// Room for what reflects as mirrors do, and for what passes light on, once something does.
void makeRoom(const Scene& scene, const PatchScene& patches, std::uint32_t material, PatchMaterials& materials) {
  const auto& of = materialOf(scene, material);
  if (materials.specular.sideCount() == 0 && isSpecular(of)) materials.specular = materials.lobe = SideColours(patches);
  if (materials.transmittance.sideCount() == 0 && of.isTranslucent())
    materials.transmittance = materials.base_reflectance = SideColours(patches);
}

/// `surfaces`: those of the material, one at least.
void shadeSurfaces(const Scene& scene, const PatchScene& patches, std::uint32_t material,
                   std::span<const std::uint32_t> surfaces, TexturePyramids& pyramids, PatchMaterials& materials) {
  makeRoom(scene, patches, material, materials);
  MaterialShader shader(scene, patches, material, pyramids, materials);
  for (const std::uint32_t s : surfaces) shader.shade(s);
  if (shader.wasClamped())
    materials.warnings.push_back(fmt::format("/materials/{} ({}): reflectance{} above {} was lowered to it", material,
                                             shader.name(), shader.isTranslucent() ? " and transmittance" : "",
                                             kMaxReflectance));
}

}  // namespace

std::vector<std::uint32_t> reshadeMaterial(const Scene& scene, const PatchScene& patches, std::uint32_t material,
                                           PatchMaterials& materials) {
  std::vector<std::uint32_t> surfaces;
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s)
    if (patches.surfaces[s].material == material) surfaces.push_back(s);
  TexturePyramids pyramids;
  if (!surfaces.empty()) shadeSurfaces(scene, patches, material, surfaces, pyramids, materials);
  return surfaces;
}

PatchMaterials shadePatches(const Scene& scene, const PatchScene& patches) {
  PatchMaterials materials;
  materials.emission = materials.reflectance = SideColours(patches);
  std::vector<std::uint32_t> order(patches.surfaces.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto materialOf = [&](std::uint32_t s) { return patches.surfaces[s].material; };
  std::ranges::stable_sort(order, {}, materialOf);
  TexturePyramids pyramids;
  for (auto first = order.begin(), end = first; first != order.end(); first = end) {
    const auto material = materialOf(*first);
    end = std::find_if(first, order.end(), [&](std::uint32_t s) { return materialOf(s) != material; });
    shadeSurfaces(scene, patches, material, {first, end}, pyramids, materials);
  }
  if (pyramids.coarse() > 0) {
    materials.warnings.push_back(
        fmt::format("materials look at large pictures in so many ways ({}) that of {} few pixels were looked at: their "
                    "colours may be "
                    "a little off. Fewer materials, or smaller pictures, help",
                    pyramids.made(), pyramids.coarse()));
  }
  return materials;
}

}  // namespace radiosity::scene
