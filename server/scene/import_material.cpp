#include "server/scene/import_material.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "server/scene/image_decode.h"

namespace radiosity::scene {
namespace {

constexpr int kRepeat = 10497;
constexpr int kClamp = 33071;
constexpr int kMirror = 33648;
// All images together; one image may have max_image_pixels.
constexpr std::size_t kTotalImageBudget = 8;

float unit(double value) { return static_cast<float>(std::clamp(value, 0.0, 1.0)); }

class MaterialImporter {
 public:
  explicit MaterialImporter(ImportContext& context)
      : context_(context), pixels_left_(context.limits.max_image_pixels * kTotalImageBudget) {}

  Result<void> add(std::size_t index) {
    pointer_ = "/materials/" + std::to_string(index);
    const auto& source = context_.materials[index];
    const auto& json = context_.document.gltf["materials"][index];
    Material out;
    out.name = source.name;
    const auto& color = source.pbrMetallicRoughness.baseColorFactor;
    out.base_color = {unit(color[0]), unit(color[1]), unit(color[2])};
    out.alpha = unit(color[3]);
    out.double_sided = source.doubleSided;
    out.alpha_cutoff = static_cast<float>(source.alphaCutoff);
    if (auto ok = readAlphaMode(source, out); !ok) return ok;
    if (auto ok = readEmission(source, json, out); !ok) return ok;
    if (auto ok = readMetallic(source, out); !ok) return ok;
    auto base =
        readTexture(source.pbrMetallicRoughness.baseColorTexture, json, "/pbrMetallicRoughness/baseColorTexture");
    if (!base) return tl::unexpected(base.error());
    out.base_color_texture = *base;
    readOthers(json, out);
    context_.scene.materials.push_back(std::move(out));
    return {};
  }

 private:
  Result<void> readAlphaMode(const tinygltf::Material& source, Material& out) {
    if (source.alphaMode == "MASK") {
      out.alpha_mode = AlphaMode::kMask;
    } else if (source.alphaMode == "BLEND") {
      out.alpha_mode = AlphaMode::kBlend;
    } else if (source.alphaMode != "OPAQUE") {
      return context_.bad(pointer_ + "/alphaMode", "must be OPAQUE, MASK or BLEND");
    }
    return {};
  }

  Result<void> readEmission(const tinygltf::Material& source, const Json& json, Material& out) {
    double strength = 1.0;
    if (const auto* extension = extensionOf(json, "KHR_materials_emissive_strength")) {
      strength = extension->value("emissiveStrength", 1.0);
    }
    for (int c = 0; c < 3; ++c) {
      const auto factor = source.emissiveFactor[static_cast<std::size_t>(c)];
      out.emission[c] = static_cast<float>(factor * strength);
      // Beyond this, sums of squares in the error estimate would leave single precision.
      if (!(out.emission[c] <= 1e15F)) return context_.bad(pointer_ + "/emissiveFactor", "is too bright to hold");
    }
    if (*std::max_element(source.emissiveFactor.begin(), source.emissiveFactor.end()) > 1.0) {
      context_.warn(pointer_ + "/emissiveFactor",
                    "is above 1, which glTF leaves to KHR_materials_emissive_strength; taken as it is");
    }
    if (out.emission == glm::vec3(0.0F)) return {};  // its texture changes nothing
    auto texture = readTexture(source.emissiveTexture, json, "/emissiveTexture");
    if (!texture) return tl::unexpected(texture.error());
    out.emissive_texture = *texture;
    return {};
  }

  /// Scene has one metallic value a material: factor x mean of the blue channel (linear).
  Result<void> readMetallic(const tinygltf::Material& source, Material& out) {
    out.metallic = unit(source.pbrMetallicRoughness.metallicFactor);
    const auto texture = source.pbrMetallicRoughness.metallicRoughnessTexture.index;
    const auto image = texture < 0 ? -1 : context_.model.textures[static_cast<std::size_t>(texture)].source;
    if (image >= 0 && out.metallic > 0.0F) {
      const auto mean = meanBlue(static_cast<std::size_t>(image));
      if (!mean) return tl::unexpected(mean.error());
      out.metallic *= *mean;
    }
    if (out.metallic >= 0.999F) {
      context_.warn(pointer_, "'" + source.name + "' is wholly metallic and so reflects nothing diffusely");
    }
    return {};
  }

  void readOthers(const Json& json, Material& out) {
    if (const auto* transmission = extensionOf(json, "KHR_materials_transmission")) {
      out.transmission = unit(transmission->value("transmissionFactor", 0.0));
      if (transmission->contains("transmissionTexture")) {
        context_.warn(pointer_, "transmissionTexture is ignored; the factor is used all over");
      }
    }
    if (extensionOf(json, "KHR_materials_unlit") != nullptr) {
      context_.warn(pointer_, "KHR_materials_unlit: lit like any other surface");
    }
  }

  [[nodiscard]] const Json* textureJson(const Json& material, const char* member) const {
    const Json::json_pointer pointer(member);
    return material.contains(pointer) ? &material.at(pointer) : nullptr;
  }

  Result<TextureUse> readTexture(const tinygltf::TextureInfo& info, const Json& material, const char* member) {
    TextureUse use;
    const auto where = pointer_ + member;
    if (info.index < 0) return use;
    const auto& texture = context_.model.textures[static_cast<std::size_t>(info.index)];
    if (texture.source < 0) {
      context_.warn("/textures/" + std::to_string(info.index), "has no source that we can read; white is used");
      return use;
    }
    use.texcoord = info.texCoord;
    if (const auto* json = textureJson(material, member)) readTransform(*json, use);
    if (use.texcoord > 1) {
      context_.warn(where + "/texCoord", "only TEXCOORD_0 and TEXCOORD_1 are read; 0 is used");
      use.texcoord = 0;
    }
    if (auto ok = readWrap(texture, use); !ok) return tl::unexpected(ok.error());
    const auto loaded = colorTexture(static_cast<std::size_t>(texture.source));
    if (!loaded) return tl::unexpected(loaded.error());
    use.texture = *loaded;
    return use;
  }

  static void readTransform(const Json& info, TextureUse& use) {
    const auto* transform = extensionOf(info, "KHR_texture_transform");
    if (transform == nullptr) return;
    const auto pair = [&](const char* member, glm::vec2 otherwise) {
      if (!transform->contains(member)) return otherwise;
      const auto& v = (*transform)[member];
      return glm::vec2(v[0].get<float>(), v[1].get<float>());
    };
    use.offset = pair("offset", use.offset);
    use.scale = pair("scale", use.scale);
    use.rotation = static_cast<float>(transform->value("rotation", 0.0));
    use.texcoord = transform->value("texCoord", use.texcoord);
  }

  Result<void> readWrap(const tinygltf::Texture& texture, TextureUse& use) {
    if (texture.sampler < 0) return {};
    const auto& sampler = context_.model.samplers[static_cast<std::size_t>(texture.sampler)];
    for (const auto wrap : {sampler.wrapS, sampler.wrapT}) {
      if (wrap != kRepeat && wrap != kClamp && wrap != kMirror) {
        return context_.bad("/samplers/" + std::to_string(texture.sampler),
                            "unknown wrap mode " + std::to_string(wrap));
      }
    }
    use.repeat_u = sampler.wrapS != kClamp;
    use.repeat_v = sampler.wrapT != kClamp;
    use.mirror_u = sampler.wrapS == kMirror;
    use.mirror_v = sampler.wrapT == kMirror;
    return {};
  }

  [[nodiscard]] std::size_t limit() const { return std::min(context_.limits.max_image_pixels, pixels_left_); }

  Result<Texture> decode(std::size_t image) const {
    return decodeImage(*context_.document.images[image], limit(),
                       place(context_.document.name, "/images/" + std::to_string(image)));
  }

  /// What the document before had of the same bytes, if it still fits.
  [[nodiscard]] const DecodedImage* known(std::size_t image) const {
    if (context_.before == nullptr) return nullptr;
    const auto found = context_.before->images.find(context_.document.images[image]);
    return found != context_.before->images.end() && found->second.pixels <= limit() ? &found->second : nullptr;
  }

  /// Where it is kept for the next edit, of so many pixels.
  DecodedImage& keep(std::size_t image, std::size_t pixels) {
    pixels_left_ -= pixels;
    auto& kept = context_.images[context_.document.images[image]];
    kept.pixels = pixels;
    return kept;
  }

  Result<std::uint32_t> colorTexture(std::size_t image) {
    if (const auto found = color_textures_.find(image); found != color_textures_.end()) return found->second;
    const auto* before = known(image);
    auto color = before != nullptr ? before->color : nullptr;
    if (!color) {
      auto texture = decode(image);
      if (!texture) return tl::unexpected(texture.error());
      color = std::make_shared<const Texture>(std::move(*texture));
    }
    keep(image, color->rgba.size() / 4).color = color;
    const auto index = static_cast<std::uint32_t>(context_.scene.textures.size());
    context_.scene.textures.push_back(std::move(color));
    color_textures_[image] = index;
    return index;
  }

  Result<float> meanBlue(std::size_t image) {
    if (const auto found = mean_blue_.find(image); found != mean_blue_.end()) return found->second;
    const auto* before = known(image);
    auto mean = before != nullptr ? before->mean_blue : std::nullopt;
    auto pixels = before != nullptr ? before->pixels : 0;
    if (!mean) {
      const auto texture = decode(image);
      if (!texture) return tl::unexpected(texture.error());
      double sum = 0.0;
      for (std::size_t i = 2; i < texture->rgba.size(); i += 4) sum += texture->rgba[i];
      pixels = texture->rgba.size() / 4;
      mean = static_cast<float>(sum / 255.0 / static_cast<double>(pixels));
    }
    keep(image, pixels).mean_blue = mean;
    mean_blue_[image] = *mean;
    return *mean;
  }

  ImportContext& context_;
  std::size_t pixels_left_;
  std::string pointer_;
  std::map<std::size_t, std::uint32_t> color_textures_;  ///< by image
  std::map<std::size_t, float> mean_blue_;               ///< by image
};

}  // namespace

Result<void> importMaterials(ImportContext& context) {
  MaterialImporter importer(context);
  for (std::size_t i = 0; i < context.materials.size(); ++i) {
    if (auto ok = importer.add(i); !ok) return ok;
  }
  return {};
}

}  // namespace radiosity::scene
