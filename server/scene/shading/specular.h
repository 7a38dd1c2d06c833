// Which materials reflect as mirrors do, so that rays that meet them go on, and how much; and what glass lets pass.
// Pure; any thread.
//
// Metal reflects so, however rough it is: it has no other reflectance. The coat of what is no metal reflects 4 to 9 %
// of the light by Fresnel's law, and as much is missing below it: its light counts as a part of the diffuse
// reflectance, base_color x (1 - metallic), as engines have it, and costs nothing. The same holds for whatever reflects
// less than kLeastSpecular, and for dielectrics of KHR_materials_pbrSpecularGlossiness, whose specular colour is small.
//
// Glass (KHR_materials_transmission on an opaque material) reflects by Fresnel's law at each face, from both sides, and
// light that is not reflected goes straight on as far as transmission and tint let it: by chance, as much as of the
// channel that passes best, and of the others as much less as the tint says (PatchScene::tints). So a face is one
// interface, and a pane with two faces has two. That a ball of glass gathers light is not followed. The unlit back of a
// single-sided face that only passes and reflects does so as the front; where some of the light is scattered as well,
// the back absorbs what does not pass, as any unlit back.
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>

#include "server/scene/values/glass_face.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// A surface that reflects less than this in all channels, as mirrors do, reflects it diffusely instead: masks of metal
/// are noisy, and another ray is not worth it.
inline constexpr float kLeastSpecular = 0.05F;

/// Reflectance of a dielectric at normal incidence, from air.
[[nodiscard]] inline float facingReflectance(float ior) {
  const float part = (ior - 1.0F) / (ior + 1.0F);
  return part * part;
}

[[nodiscard]] inline bool isGlass(const Material& material) {
  return material.transmission > 0.0F && material.alpha_mode == AlphaMode::kOpaque && material.ior > 1.0F &&
         material.metallic <= 0.0F && material.specular == glm::vec3(0.0F);
}

/// What a face of the material does to light that meets it at an angle; none where it is no glass.
[[nodiscard]] inline GlassFace glassFace(const Material& material) {
  if (!isGlass(material)) return {};
  constexpr float kAll = 0.999F;
  const bool only_passes = material.transmission >= kAll && material.transmission_texture.texture == kNone &&
                           material.emission == glm::vec3(0.0F);
  return {facingReflectance(material.ior), !material.double_sided && only_passes};
}

/// What a material has at a place, of what decides how much passes.
struct PassingPlace {
  glm::vec3 base{1.0F};  ///< base colour, of factor, vertices and texture
  float transmission = 0.0F, metallic = 0.0F;
  glm::vec3 specular{0.0F};

  /// Where no texture and no vertex says otherwise.
  [[nodiscard]] static PassingPlace of(const Material& material) {
    return {material.base_color, material.transmission, material.metallic, material.specular};
  }
};

/// Part of the light that enters a face there, by channel, that goes on through it.
[[nodiscard]] inline glm::vec3 enteredPart(const Material& material, const PassingPlace& at) {
  if (at.transmission <= 0.0F) return glm::vec3(0.0F);
  const glm::vec3 tint = at.base * glm::sqrt(material.attenuation);  // the other half is that of another face
  const float shine = std::max({at.specular.r, at.specular.g, at.specular.b});
  return glm::clamp(at.transmission * (1.0F - at.metallic) * (1.0F - shine) * tint, 0.0F, 1.0F);
}

/// Part of the light straight at a face, by channel, that goes on through it.
[[nodiscard]] inline glm::vec3 passedPart(const Material& material, const PassingPlace& at) {
  return enteredPart(material, at) * (1.0F - glassFace(material).reflectance(0.0F));
}

/// Of the channel of which most does.
[[nodiscard]] inline float mostOf(const glm::vec3& colour) { return std::max({colour.r, colour.g, colour.b}); }

[[nodiscard]] inline bool isSpecular(const Material& material) {
  return material.metallic > 0.0F || material.specular != glm::vec3(0.0F) || isGlass(material);
}

}  // namespace radiosity::scene
