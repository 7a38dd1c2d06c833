// A material at one place: its factors times its textures there. Used while a scene is shaded.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <memory>
#include <optional>

#include "server/scene/shading/specular.h"
#include "server/scene/shading/texture_pyramids.h"

namespace radiosity::scene {

/// Refers to the scene's textures, which must outlive it.
class MaterialLayers {
 public:
  struct Value {
    glm::vec3 emission{0.0F}, reflectance{0.0F};
    glm::vec3 transmittance{0.0F}, base_reflectance{0.0F};  ///< as of PatchMaterials; of translucent materials
    float weight = 1.0F;  ///< how much of the surface is there: 0 where it is cut out, alpha where it is blended
    glm::vec3 specular{0.0F}, lobe{0.0F};  ///< of PatchMaterials
  };
  /// Where a texture is looked up.
  struct Place {
    glm::vec2 uv, footprint;
  };

  MaterialLayers(const Scene& scene, const Material& material, TexturePyramids& pyramids);

  /// Without textures it is the same everywhere, but for vertex colours.
  [[nodiscard]] bool hasTextures() const {
    return surface_ || metallic_ || specular_ || emissive_ || passing_ || glow_ || specular_look_.rough ||
           pass_look_.part;
  }

  /// `place(use)` gives the Place of a texture; `vertex` is COLOR_0 there.
  template <typename PlaceOf>
  [[nodiscard]] Value at(const PlaceOf& place, const glm::vec4& vertex) const {
    const auto look = [&](const Layer& layer) {
      const Place found = place(layer.use);
      return layer.pyramid->look(layer.use, found.uv, found.footprint);
    };
    float metal = metallic_inside_ ? 0.0F : material_.metallic;
    glm::vec3 specular = specular_inside_ ? glm::vec3(0.0F) : material_.specular;
    if (metallic_) metal *= look(*metallic_).rgb.b;
    if (specular_) specular *= look(*specular_).rgb;
    const float diffuse = diffuseOf(metal, specular);
    Value value{.emission = material_.emission * static_cast<float>(M_PI),
                .reflectance = material_.base_color * diffuse * glm::vec3(vertex),
                .weight = weightOf(vertex.a)};
    if (surface_) {
      const auto found = look(*surface_);
      value.reflectance *= found.rgb;
      value.weight *= found.coverage;
    }
    const auto lookOr1 = [&](const std::optional<Layer>& layer) { return layer ? look(*layer).rgb : glm::vec3(1.0F); };
    PassingPlace passing;
    if (material_.transmission > 0.0F) {
      passing.base = material_.base_color * glm::vec3(vertex) * lookOr1(pass_look_.base);
      passing.transmission = material_.transmission * lookOr1(pass_look_.part).r;
      passing.metallic = material_.metallic * lookOr1(pass_look_.metal).b;
      passing.specular = material_.specular * lookOr1(pass_look_.shine);
    }
    if (is_specular_)
      addSpecular(material_.base_color * glm::vec3(vertex) * lookOr1(specular_look_.base),
                  lookOr1(specular_look_.metal).b, lookOr1(specular_look_.shine), lookOr1(specular_look_.rough).g,
                  passing, value);
    const float stopped = stoppedDiffuse(passing);
    takePassing(passing, stopped, value);
    if (emissive_) value.emission *= look(*emissive_).rgb;
    if (material_.isTranslucent()) {
      const float part = material_.diffuse_transmission * (passing_ ? look(*passing_).coverage : 1.0F);
      value.transmittance = material_.diffuse_transmission_color * (diffuse * stopped * part);
      if (glow_) value.transmittance *= look(*glow_).rgb;
      value.base_reflectance = value.reflectance;
      value.reflectance *= 1.0F - part;
    }
    return value;
  }

 private:
  struct Layer {
    TextureUse use;
    std::shared_ptr<const TexturePyramid> pyramid;
  };

  /// The part of light that diffuse reflection and transmission share.
  [[nodiscard]] static float diffuseOf(float metal, const glm::vec3& specular) {
    return (1.0F - metal) * (1.0F - std::max({specular.r, specular.g, specular.b}));
  }
  void addSpecular(const glm::vec3& base, float metal, const glm::vec3& shine, float rough, const PassingPlace& passing,
                   Value& value) const;
  [[nodiscard]] float stoppedDiffuse(const PassingPlace& passing) const;
  void takePassing(const PassingPlace& passing, float stopped, Value& value) const;
  void addSpecularLooks(TexturePyramids& pyramids);
  void addPassLooks(TexturePyramids& pyramids);
  [[nodiscard]] float weightOf(float vertex_alpha) const;
  [[nodiscard]] const Texture* textureOf(const TextureUse& use) const;
  void setAlpha(const Texture* alpha, PictureStack& stack) const;
  void addSurface(TexturePyramids& pyramids);
  void addEmissive(TexturePyramids& pyramids);
  void addTransmission(TexturePyramids& pyramids);

  const Scene& scene_;
  Material material_;
  /// Base colour, and what is laid over the surface in the same way: light is lost where a texel is both bright and
  /// metallic, which the means of two textures do not tell.
  std::optional<Layer> surface_;
  bool metallic_inside_ = false, specular_inside_ = false;  ///< of `surface_`
  std::optional<Layer> metallic_, specular_, emissive_;     ///< by themselves
  std::optional<Layer> passing_, glow_;                     ///< of diffuse transmission: how much, and its colour
  bool is_specular_ = false;
  struct SpecularLook {
    std::optional<Layer> base, metal, shine, rough;
  };
  SpecularLook specular_look_;  ///< of a material that is: each texture by itself
  struct PassLook {
    std::optional<Layer> base, metal, shine, part;
  };
  PassLook pass_look_;  ///< likewise, of one that light passes
};

}  // namespace radiosity::scene
