// Which materials reflect as mirrors do, so that rays that meet them go on, and how much. Pure; any thread.
//
// Metal does, however rough it is: it has no other reflectance. What is no metal has a coat that reflects by Fresnel's
// law, 4 to 9 % of the light. Where the coat is smooth, rays go on, and what it reflects is missing below. Where it is
// rough, as in nearly every file, its light leaves almost as diffusely as what comes from below it, so that it counts
// as a part of the diffuse reflectance: that is base_color x (1 - metallic), as other engines have it, and costs
// nothing. Of specular-glossiness the same holds: a strong specular colour is metal.
//
// Glass (KHR_materials_transmission) has a coat, however rough, and light goes straight on through each of its faces as
// through a thin sheet: by chance, so much as its reflectance straight on, its transmission, and its tint leave, of
// which luminance counts. Rays that meet it at an angle pass less often, by Fresnel's law (solver::LeafRays). A pane or
// a bulb of two faces does not turn light; that a ball of glass gathers it is not followed.
#pragma once

#include <glm/exponential.hpp>
#include <glm/geometric.hpp>

#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// The coat of what is rougher is diffuse: at 0.2 its lobe is some ten degrees wide.
inline constexpr float kMostRoughCoat = 0.2F;
/// A specular colour of KHR_materials_pbrSpecularGlossiness above this is of metal.
inline constexpr float kLeastMetal = 0.1F;

/// Reflectance of a dielectric at normal incidence, from air.
[[nodiscard]] inline float facingReflectance(float ior) {
  const float part = (ior - 1.0F) / (ior + 1.0F);
  return part * part;
}
/// Of light from all around, by Schlick's approximation: the mean of (1 - cos)^5 over a hemisphere is 1/21.
[[nodiscard]] inline float meanReflectance(float facing) { return facing + (1.0F - facing) / 21.0F; }

/// Part of the light straight at a face, by luminance, that goes on through it.
[[nodiscard]] inline float passedPart(const Material& material) {
  if (material.transmission <= 0.0F) return 0.0F;
  const glm::vec3 tint = material.base_color * glm::sqrt(material.attenuation);
  const float bright = glm::dot(tint, glm::vec3(0.2126F, 0.7152F, 0.0722F));
  return material.transmission * (1.0F - material.metallic) * bright * (1.0F - facingReflectance(material.ior));
}

/// Whether the coat of what is no metal reflects as a mirror does.
[[nodiscard]] inline bool hasCoat(const Material& material) {
  const bool is_smooth = material.roughness <= kMostRoughCoat || material.transmission > 0.0F;
  return material.specular == glm::vec3(0.0F) && is_smooth && material.ior > 1.0F;
}

[[nodiscard]] inline bool isSpecular(const Material& material) {
  const float shine = material.specular.r > material.specular.g ? material.specular.r : material.specular.g;
  const float strongest = shine > material.specular.b ? shine : material.specular.b;
  if (strongest > 0.0F) return strongest > kLeastMetal || material.roughness <= kMostRoughCoat;
  return material.metallic > 0.0F || hasCoat(material);
}

}  // namespace radiosity::scene
