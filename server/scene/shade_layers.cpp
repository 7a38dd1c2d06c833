#include "server/scene/shade_layers.h"

namespace radiosity::scene {
namespace {

/// Whether two textures have the same place everywhere.
bool laidAlike(TextureUse a, const TextureUse& b) {
  a.texture = b.texture;
  a.nearest = b.nearest;
  return a == b;
}

/// A texture read on a grid that may be finer than its own.
struct Regridded {
  const Texture* texture;  ///< null: white
  int width, height;

  [[nodiscard]] glm::vec4 at(int x, int y) const {
    if (texture == nullptr) return glm::vec4(1.0F);
    const auto scaled = [](int i, int to, int from) {
      return to == from ? i : static_cast<int>(std::int64_t{i} * to / from);
    };
    return pixelOf(*texture, scaled(x, texture->width, width), scaled(y, texture->height, height));
  }
};

}  // namespace

MaterialLayers::MaterialLayers(const Scene& scene, const Material& material) : scene_(scene), material_(material) {
  addSurface();
  if (material_.emission != glm::vec3(0.0F)) addEmissive();
}

const Texture* MaterialLayers::textureOf(const TextureUse& use) const {
  if (use.texture >= scene_.textures.size()) return nullptr;
  const Texture& texture = scene_.textures[use.texture];
  return hasPixels(texture) ? &texture : nullptr;
}

float MaterialLayers::weightOf(float vertex_alpha) const {
  if (material_.alpha_mode == AlphaMode::kBlend) return vertex_alpha > 0.0F ? std::min(vertex_alpha, 1.0F) : 0.0F;
  if (material_.alpha_mode == AlphaMode::kMask)
    return material_.alpha * vertex_alpha >= material_.alpha_cutoff ? 1.0F : 0.0F;
  return 1.0F;
}

float MaterialLayers::coverageOf(float texture_alpha) const {
  if (material_.alpha_mode != AlphaMode::kMask) return texture_alpha;
  return material_.alpha * texture_alpha >= material_.alpha_cutoff ? 1.0F : 0.0F;
}

void MaterialLayers::addSurface() {
  const Texture* base = textureOf(material_.base_color_texture);
  const Texture* metallic = material_.metallic > 0.0F ? textureOf(material_.metallic_texture) : nullptr;
  const Texture* specular = material_.specular != glm::vec3(0.0F) ? textureOf(material_.specular_texture) : nullptr;
  const TextureUse& use = base != nullptr       ? material_.base_color_texture
                          : metallic != nullptr ? material_.metallic_texture
                                                : material_.specular_texture;
  metallic_inside_ = metallic != nullptr && laidAlike(material_.metallic_texture, use);
  specular_inside_ = specular != nullptr && laidAlike(material_.specular_texture, use);
  if (metallic != nullptr && !metallic_inside_)
    metallic_.emplace(Layer{material_.metallic_texture, TexturePyramid(*metallic)});
  if (specular != nullptr && !specular_inside_)
    specular_.emplace(Layer{material_.specular_texture, TexturePyramid(*specular)});
  if (base == nullptr && !metallic_inside_ && !specular_inside_) return;
  int width = 1, height = 1;
  for (const auto* texture : {base, metallic_inside_ ? metallic : nullptr, specular_inside_ ? specular : nullptr}) {
    if (texture == nullptr) continue;
    width = std::max(width, texture->width);
    height = std::max(height, texture->height);
  }
  const Regridded colour{base, width, height};
  const Regridded metal{metallic_inside_ ? metallic : nullptr, width, height};
  const Regridded shine{specular_inside_ ? specular : nullptr, width, height};
  const float metal_factor = metallic_inside_ ? material_.metallic : 0.0F;
  const glm::vec3 shine_factor = specular_inside_ ? material_.specular : glm::vec3(0.0F);
  const bool opaque = base == nullptr || material_.alpha_mode == AlphaMode::kOpaque;
  const auto pixels = [this, colour, metal, shine, metal_factor, shine_factor, opaque](int x, int y) {
    const glm::vec4 texel = colour.at(x, y);
    glm::vec3 rgb(texel);
    if (metal.texture != nullptr) rgb *= 1.0F - metal_factor * metal.at(x, y).b;
    if (shine.texture != nullptr) {
      const glm::vec3 specular = shine_factor * glm::vec3(shine.at(x, y));
      rgb *= 1.0F - std::max({specular.r, specular.g, specular.b});
    }
    return glm::vec4(rgb, opaque ? 1.0F : coverageOf(texel.a));
  };
  surface_.emplace(Layer{use, TexturePyramid(width, height, pixels, opaque)});
}

void MaterialLayers::addEmissive() {
  const Texture* light = textureOf(material_.emissive_texture);
  if (light == nullptr) return;
  const Texture* base = textureOf(material_.base_color_texture);
  const bool covered = base != nullptr && material_.alpha_mode != AlphaMode::kOpaque &&
                       laidAlike(material_.base_color_texture, material_.emissive_texture);
  if (!covered) {
    emissive_.emplace(Layer{material_.emissive_texture, TexturePyramid(*light)});
    return;
  }
  const int width = std::max(light->width, base->width), height = std::max(light->height, base->height);
  const Regridded colour{light, width, height}, alpha{base, width, height};
  const auto pixels = [this, colour, alpha](int x, int y) {
    return glm::vec4(glm::vec3(colour.at(x, y)), coverageOf(alpha.at(x, y).a));
  };
  emissive_.emplace(Layer{material_.emissive_texture, TexturePyramid(width, height, pixels, false)});
}

}  // namespace radiosity::scene
