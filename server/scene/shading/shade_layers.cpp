#include "server/scene/shading/shade_layers.h"

namespace radiosity::scene {
namespace {

constexpr float kLeastStopped = 1e-3F;  ///< of the rays at what passes nearly all

/// Whether two textures have the same place everywhere.
bool laidAlike(TextureUse a, const TextureUse& b) {
  a.texture = b.texture;
  a.nearest = b.nearest;
  return a == b;
}

}  // namespace

MaterialLayers::MaterialLayers(const Scene& scene, const Material& material, TexturePyramids& pyramids)
    : scene_(scene), material_(material) {
  is_specular_ = isSpecular(material_);
  addSurface(pyramids);
  if (is_specular_) addSpecularLooks(pyramids);
  if (material_.transmission > 0.0F) addPassLooks(pyramids);
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

void MaterialLayers::addSpecularLooks(TexturePyramids& pyramids) {
  const auto layerOf = [&](const TextureUse& use, bool is_used, bool has_alpha = false) {
    const Texture* texture = is_used ? textureOf(use) : nullptr;
    if (texture == nullptr) return std::optional<Layer>();
    PictureStack stack{.colour = texture};
    if (has_alpha) setAlpha(texture, stack);
    return std::optional<Layer>({use, pyramids.of(stack)});
  };
  const bool is_metal = material_.metallic > 0.0F;
  specular_look_.base = layerOf(material_.base_color_texture, is_metal, material_.alpha_mode != AlphaMode::kOpaque);
  specular_look_.metal = layerOf(material_.metallic_texture, is_metal);
  specular_look_.rough = layerOf(material_.roughness_texture, is_metal);
  specular_look_.shine = layerOf(material_.specular_texture, material_.specular != glm::vec3(0.0F));
}

void MaterialLayers::addPassLooks(TexturePyramids& pyramids) {
  const auto layerOf = [&](const TextureUse& use) {
    const Texture* texture = textureOf(use);
    return texture != nullptr ? std::optional<Layer>({use, pyramids.of({.colour = texture})}) : std::nullopt;
  };
  pass_look_ = {layerOf(material_.base_color_texture), layerOf(material_.metallic_texture),
                layerOf(material_.specular_texture), layerOf(material_.transmission_texture)};
}

/// `value.reflectance`: what the surface reflects diffusely. Of metal the rest is what the base colour has more, which
/// holds also where both vary within the place.
void MaterialLayers::addSpecular(const glm::vec3& base, float metal, const glm::vec3& shine, float rough,
                                 const PassingPlace& passing, Value& value) const {
  value.lobe.x = std::clamp(material_.roughness * rough, 0.0F, 1.0F);
  if (isGlass(material_)) {
    const auto face = glassFace(material_);
    value.specular = glm::vec3(face.facing);
    value.lobe.z = mostOf(enteredPart(material_, passing));
  } else if (material_.specular != glm::vec3(0.0F)) {
    value.specular = material_.specular * shine;
    value.lobe.y = std::max({value.specular.r, value.specular.g, value.specular.b});
  } else {
    value.specular = glm::clamp(base - value.reflectance, 0.0F, 1.0F);
    value.lobe.y = metal * material_.metallic;
  }
}

/// The part that is scattered, reflected or passed on, of the light that neither passes nor is reflected as by a
/// mirror: as a part of what does not pass, for rays that do not pass are what meets it.
float MaterialLayers::stoppedDiffuse(const PassingPlace& passing) const {
  if (passing.transmission <= 0.0F) return 1.0F;
  const float passed = mostOf(passedPart(material_, passing));
  if (!isGlass(material_)) return (1.0F - passing.transmission) / std::max(1.0F - passed, kLeastStopped);
  const auto face = glassFace(material_);
  const float stopped = face.meanStopped(1.0F - passed), reflected = face.meanStopped(face.reflectance(0.0F));
  return stopped > 0.0F ? (1.0F - passing.transmission) * (1.0F - reflected) / stopped : 0.0F;
}

/// Rays that do not pass meet what is left, as parts of these.
void MaterialLayers::takePassing(const PassingPlace& passing, float stopped, Value& value) const {
  value.reflectance *= stopped;
  if (passing.transmission <= 0.0F || isGlass(material_)) return;
  const float met = std::max(1.0F - mostOf(passedPart(material_, passing)), kLeastStopped);
  value.specular = glm::min(value.specular / met, glm::vec3(1.0F));
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
