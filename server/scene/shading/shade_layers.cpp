#include "server/scene/shading/shade_layers.h"

namespace radiosity::scene {
namespace {

/// Whether two textures have the same place everywhere.
bool laidAlike(TextureUse a, const TextureUse& b) {
  a.texture = b.texture;
  a.nearest = b.nearest;
  return a == b;
}

}  // namespace

MaterialLayers::MaterialLayers(const Scene& scene, const Material& material, TexturePyramids& pyramids)
    : scene_(scene), material_(material) {
  addSurface(pyramids);
  if (material_.emission != glm::vec3(0.0F)) addEmissive(pyramids);
  if (material_.isTranslucent()) addTransmission(pyramids);
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

/// Of what is cut out or clear.
void MaterialLayers::setAlpha(const Texture* alpha, PictureStack& stack) const {
  stack.alpha = alpha;
  if (alpha == nullptr || material_.alpha_mode != AlphaMode::kMask) return;
  stack.is_mask = true;
  stack.alpha_factor = material_.alpha;
  stack.alpha_cutoff = material_.alpha_cutoff;
}

void MaterialLayers::addSurface(TexturePyramids& pyramids) {
  const Texture* base = textureOf(material_.base_color_texture);
  const Texture* metallic = material_.metallic > 0.0F ? textureOf(material_.metallic_texture) : nullptr;
  const Texture* specular = material_.specular != glm::vec3(0.0F) ? textureOf(material_.specular_texture) : nullptr;
  const TextureUse& use = base != nullptr       ? material_.base_color_texture
                          : metallic != nullptr ? material_.metallic_texture
                                                : material_.specular_texture;
  // Metal takes from transmitted light, too, which has a colour of its own.
  const bool joins = !material_.isTranslucent();
  metallic_inside_ = joins && metallic != nullptr && laidAlike(material_.metallic_texture, use);
  specular_inside_ = joins && specular != nullptr && laidAlike(material_.specular_texture, use);
  if (metallic != nullptr && !metallic_inside_)
    metallic_.emplace(Layer{material_.metallic_texture, pyramids.of({.colour = metallic})});
  if (specular != nullptr && !specular_inside_)
    specular_.emplace(Layer{material_.specular_texture, pyramids.of({.colour = specular})});
  if (base == nullptr && !metallic_inside_ && !specular_inside_) return;
  PictureStack stack{.colour = base};
  if (metallic_inside_) {
    stack.metal = metallic;
    stack.metal_factor = material_.metallic;
  }
  if (specular_inside_) {
    stack.shine = specular;
    stack.shine_factor = material_.specular;
  }
  if (material_.alpha_mode != AlphaMode::kOpaque) setAlpha(base, stack);
  surface_.emplace(Layer{use, pyramids.of(stack)});
}

void MaterialLayers::addEmissive(TexturePyramids& pyramids) {
  const Texture* light = textureOf(material_.emissive_texture);
  if (light == nullptr) return;
  const Texture* base = textureOf(material_.base_color_texture);
  const bool covered = base != nullptr && material_.alpha_mode != AlphaMode::kOpaque &&
                       laidAlike(material_.base_color_texture, material_.emissive_texture);
  PictureStack stack{.colour = light};
  if (covered) setAlpha(base, stack);
  emissive_.emplace(Layer{material_.emissive_texture, pyramids.of(stack)});
}

void MaterialLayers::addTransmission(TexturePyramids& pyramids) {
  if (const Texture* part = textureOf(material_.diffuse_transmission_texture))
    passing_.emplace(Layer{material_.diffuse_transmission_texture, pyramids.of({.alpha = part})});
  if (const Texture* colour = textureOf(material_.diffuse_transmission_color_texture))
    glow_.emplace(Layer{material_.diffuse_transmission_color_texture, pyramids.of({.colour = colour})});
}

}  // namespace radiosity::scene
