#include "server/scene/import/import_material.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "common/parallel.h"
#include "common/task.h"
#include "server/scene/document/image_decode.h"
#include "server/scene/import/image_plan.h"
#include "server/scene/import/texture_references.h"

namespace radiosity::scene {
namespace {

constexpr int kRepeat = 10497;
constexpr int kClamp = 33071;
constexpr int kMirror = 33648;
constexpr int kNearest = 9728;
constexpr const char* kSpecularGlossiness = "KHR_materials_pbrSpecularGlossiness";
constexpr const char* kTransmissionTexture = "/extensions/KHR_materials_transmission/transmissionTexture";
constexpr const char* kDiffuseTransmission = "KHR_materials_diffuse_transmission";

float unit(double value) { return static_cast<float>(std::clamp(value, 0.0, 1.0)); }

class MaterialImporter {
 public:
  MaterialImporter(ImportContext& context, const ImagePlan& plan) : context_(context), plan_(plan) {}

  Result<void> add(std::size_t index) {
    pointer_ = "/materials/" + std::to_string(index);
    const auto& source = context_.materials[index];
    const auto& json = context_.document.gltf["materials"][index];
    forEachTextureInfo(json, pointer_, [&](const Json& owner, const std::string& key, const std::string& where) {
      warnDanglingReference(owner[key], "index", "textures", where, "the texture is left out");
    });
    Material out;
    out.name = source.name;
    out.double_sided = source.doubleSided;
    out.alpha_cutoff = static_cast<float>(source.alphaCutoff);
    if (auto ok = readAlphaMode(source, out); !ok) return ok;
    if (auto ok = readEmission(source, json, out); !ok) return ok;
    const auto* specular = extensionOf(json, kSpecularGlossiness);
    if (auto ok = specular != nullptr ? readSpecular(*specular, json, out) : readMetallic(source, json, out); !ok)
      return ok;
    if (auto ok = readTranslucent(json, out); !ok) return ok;
    if (auto ok = readOthers(json, out); !ok) return ok;
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
    return readTexture(json, "/emissiveTexture", Coding::kSrgb, out.emissive_texture);
  }

  Result<void> readMetallic(const tinygltf::Material& source, const Json& json, Material& out) {
    const auto& color = source.pbrMetallicRoughness.baseColorFactor;
    out.base_color = {unit(color[0]), unit(color[1]), unit(color[2])};
    out.alpha = unit(color[3]);
    const auto* base = "/pbrMetallicRoughness/baseColorTexture";
    if (auto ok = readTexture(json, base, Coding::kSrgb, out.base_color_texture); !ok) return ok;
    out.metallic = unit(source.pbrMetallicRoughness.metallicFactor);
    out.roughness = clampedRoughness(source.pbrMetallicRoughness.roughnessFactor);
    const auto* member = "/pbrMetallicRoughness/metallicRoughnessTexture";
    // A picture is not read for the roughness of a coat alone.
    if (out.metallic == 0.0F && extensionOf(json, "KHR_materials_transmission") == nullptr) return {};
    if (auto ok = readTexture(json, member, Coding::kLinear, out.metallic_texture); !ok) return ok;
    foldMetallic(out);
    return {};
  }

  float clampedRoughness(double factor) {
    if (factor < 0.0 || factor > 1.0)
      context_.warn(pointer_ + "/pbrMetallicRoughness/roughnessFactor", "is not between 0 and 1 and was clamped");
    return unit(factor);
  }

  /// Most textures say the same of all the surface, and need not be kept. What is no metal anywhere has one roughness.
  void foldMetallic(Material& out) {
    if (!data_) return;
    if (data_->blue) out.metallic *= *data_->blue;
    if (out.metallic_texture.texture != kNone && out.metallic > 0.0F) {
      out.roughness_texture = out.metallic_texture;
    } else {
      out.roughness *= data_->mean_green;
    }
    if (data_->blue || out.metallic <= 0.0F) out.metallic_texture = {};
  }

  /// KHR_materials_pbrSpecularGlossiness, which comes before pbrMetallicRoughness where a material has both.
  Result<void> readSpecular(const Json& extension, const Json& material, Material& out) {
    const auto factor = [&](const char* member, std::size_t c) {
      return extension.contains(member) ? unit(extension[member][c].get<double>()) : 1.0F;
    };
    for (std::size_t c = 0; c < 3; ++c) {
      out.base_color[static_cast<int>(c)] = factor("diffuseFactor", c);
      out.specular[static_cast<int>(c)] = factor("specularFactor", c);
    }
    out.alpha = factor("diffuseFactor", 3);
    out.roughness = 1.0F - unit(extension.value("glossinessFactor", 1.0));
    const std::string prefix = std::string("/extensions/") + kSpecularGlossiness;
    if (auto ok = readTexture(material, prefix + "/diffuseTexture", Coding::kSrgb, out.base_color_texture); !ok)
      return ok;
    if (out.specular == glm::vec3(0.0F)) return {};
    const auto texture = prefix + "/specularGlossinessTexture";
    if (auto ok = readTexture(material, texture, Coding::kSrgb, out.specular_texture); !ok) return ok;
    return {};
  }

  float clampedIor(double ior) {
    constexpr double kMostIor = 10.0;  // Fresnel's equations know no end, and nothing transparent has a tenth of that
    if (ior < 1.0 || ior > kMostIor)
      context_.warn(pointer_ + "/extensions/KHR_materials_ior/ior", "is not between 1 and 10 and was clamped");
    return static_cast<float>(std::clamp(ior, 1.0, kMostIor));
  }

  /// By Beer's law, over the thickness that the file states.
  glm::vec3 attenuationOf(const Json& volume) {
    const auto where = pointer_ + "/extensions/KHR_materials_volume/";
    const double thickness = volume.value("thicknessFactor", 0.0);
    if (thickness < 0.0) context_.warn(where + "thicknessFactor", "is negative and was taken for 0");
    if (!volume.contains("attenuationDistance") || !volume.contains("attenuationColor")) return glm::vec3(1.0F);
    const double distance = volume["attenuationDistance"].get<double>();
    if (!(distance > 0.0)) {
      context_.warn(where + "attenuationDistance", "is not above 0; nothing is absorbed");
      return glm::vec3(1.0F);
    }
    glm::vec3 left(1.0F);
    for (int c = 0; c < 3; ++c) {
      const auto colour = unit(volume["attenuationColor"][static_cast<std::size_t>(c)].get<double>());
      left[c] = std::pow(colour, static_cast<float>(std::max(thickness, 0.0) / distance));
    }
    return left;
  }

  Result<void> readTranslucent(const Json& json, Material& out) {
    const auto* extension = extensionOf(json, kDiffuseTransmission);
    if (extension == nullptr) return {};
    out.diffuse_transmission = unit(extension->value("diffuseTransmissionFactor", 0.0));
    if (!out.isTranslucent()) return {};  // its colour and textures change nothing
    if (const auto colour = extension->find("diffuseTransmissionColorFactor"); colour != extension->end())
      for (std::size_t c = 0; c < 3; ++c)
        out.diffuse_transmission_color[static_cast<int>(c)] = unit((*colour)[c].get<double>());
    const std::string prefix = std::string("/extensions/") + kDiffuseTransmission;
    // Alpha is not coded, whatever the colours are.
    if (auto ok =
            readTexture(json, prefix + "/diffuseTransmissionTexture", Coding::kSrgb, out.diffuse_transmission_texture);
        !ok)
      return ok;
    if (auto ok = readTexture(json, prefix + "/diffuseTransmissionColorTexture", Coding::kSrgb,
                              out.diffuse_transmission_color_texture);
        !ok)
      return ok;
    if (!out.double_sided && out.emission != glm::vec3(0.0F))
      context_.warn(pointer_,
                    "'" + out.name + "' transmits light diffusely, so that it has two sides, and emits from both");
    out.double_sided = true;
    const auto* volume = extensionOf(json, "KHR_materials_volume");
    if (volume != nullptr && volume->value("thicknessFactor", Json(0.0)) != Json(0.0))
      context_.warn(pointer_, "'" + out.name +
                                  "' is a volume that transmits light diffusely: its faces are taken for thin "
                                  "sheets, and its inside for clear");
    return {};
  }

  Result<void> readOthers(const Json& json, Material& out) {
    if (const auto* ior = extensionOf(json, "KHR_materials_ior")) out.ior = clampedIor(ior->value("ior", 1.5));
    if (const auto* transmission = extensionOf(json, "KHR_materials_transmission")) {
      out.transmission = unit(transmission->value("transmissionFactor", 0.0));
      if (auto ok = readTransmission(json, out); !ok) return ok;
    }
    if (const auto* volume = extensionOf(json, "KHR_materials_volume")) out.attenuation = attenuationOf(*volume);
    if (extensionOf(json, "KHR_materials_unlit") != nullptr) {
      context_.warn(pointer_, "KHR_materials_unlit: lit like any other surface");
    }
    return {};
  }

  Result<void> readTransmission(const Json& json, Material& out) {
    red_ = 1.0F;
    if (out.transmission <= 0.0F) return {};
    if (auto ok = readTexture(json, kTransmissionTexture, Coding::kRed, out.transmission_texture); !ok) return ok;
    out.transmission *= red_;
    return {};
  }

  /// A reference that the schema lets pass although nothing is there.
  void warnDanglingReference(const Json& object, const char* member, const char* list, const std::string& where,
                             const char* what) {
    const auto count = countOf(context_.document.gltf, list);
    if (!object.contains(member) || referenceOf(object, member, count)) return;
    context_.warn(where + "/" + member, "is " + object[member].dump() + ", but /" + list + " has " +
                                            std::to_string(count) + " entries; " + what);
  }

  enum class Coding { kSrgb, kLinear, kRed };

  /// What a texture info refers to: the texture, and its image. Both are there, or neither.
  struct Picture {
    const Json* texture = nullptr;
    std::size_t image = 0;
  };
  Result<Picture> pictureOf(const Json& info) {
    const auto index = referenceOf(info, "index", countOf(context_.document.gltf, "textures"));
    if (!index) return Picture{};
    if (auto ok = checkIsNoKtx2(context_.document, *index); !ok) return tl::unexpected(ok.error());
    const auto& texture = context_.document.gltf["textures"][*index];
    const auto image = imageOf(texture, "/textures/" + std::to_string(*index));
    return image ? Picture{&texture, *image} : Picture{};
  }

  /// `member`: a JSON pointer into the material. Without such a texture, or with one that cannot be had, `use` stays as
  /// it is.
  Result<void> readTexture(const Json& material, const std::string& member, Coding coding, TextureUse& use) {
    data_.reset();
    const Json::json_pointer pointer(member);
    if (!material.contains(pointer)) return {};
    const auto& info = material.at(pointer);
    const auto picture = pictureOf(info);
    if (!picture) return tl::unexpected(picture.error());
    if (picture->texture == nullptr) return {};
    TextureUse read;
    read.texcoord = static_cast<int>(info.value("texCoord", 0));
    readTransform(info, read);
    if (read.texcoord > 1) {
      context_.warn(pointer_ + member + "/texCoord", "only TEXCOORD_0 and TEXCOORD_1 are read; 0 is used");
      read.texcoord = 0;
    }
    // Where a file names no filter the choice is ours. Charts of an atlas lie side by side, and metal is a matter of
    // yes or no: a texel of it does not shade off into the next.
    read.nearest = coding != Coding::kSrgb;
    if (auto ok = readSampler(*picture->texture, read); !ok) return ok;
    const auto loaded = coding == Coding::kSrgb     ? colorTexture(picture->image)
                        : coding == Coding::kLinear ? dataTexture(picture->image)
                                                    : maskTexture(picture->image);
    if (!loaded) return tl::unexpected(loaded.error());
    read.texture = *loaded;
    use = read;
    return {};
  }

  /// The image of a texture that is used; without one there is no texture, with a warning.
  std::optional<std::size_t> imageOf(const Json& texture, const std::string& where) {
    const auto image = imageReferenceOf(texture, context_.document.images.size());
    if (!warned_.insert(where).second) return image;
    if (!image && !texture.contains("source")) context_.warn(where, "has no source that we can read; white is used");
    if (!image) warnDanglingReference(texture, "source", "images", where, "the texture is left out");
    warnDanglingReference(texture, "sampler", "samplers", where, "the texture repeats and is filtered linearly");
    return image;
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

  Result<void> readSampler(const Json& texture, TextureUse& use) {
    const auto index = referenceOf(texture, "sampler", countOf(context_.document.gltf, "samplers"));
    if (!index) return {};
    const auto& sampler = context_.document.gltf["samplers"][*index];
    const int wrap_s = sampler.value("wrapS", kRepeat), wrap_t = sampler.value("wrapT", kRepeat);
    for (const auto wrap : {wrap_s, wrap_t}) {
      if (wrap != kRepeat && wrap != kClamp && wrap != kMirror)
        return context_.bad("/samplers/" + std::to_string(*index), "unknown wrap mode " + std::to_string(wrap));
    }
    use.repeat_u = wrap_s != kClamp;
    use.repeat_v = wrap_t != kClamp;
    use.mirror_u = wrap_s == kMirror;
    use.mirror_v = wrap_t == kMirror;
    if (sampler.contains("magFilter")) use.nearest = sampler["magFilter"] == kNearest;
    return {};
  }

  /// As large as it is to be held.
  [[nodiscard]] Result<Texture> decodeNow(std::size_t image, bool srgb) const {
    return decodeImage(*context_.document.images[image], context_.limits.max_image_pixels,
                       place(context_.document.name, "/images/" + std::to_string(image)),
                       {srgb, plan_.halvings[image]});
  }

  /// Of large pictures the next one is decoded at the same time: materials mostly ask for them in their order.
  Result<Texture> decode(std::size_t image, bool srgb) {
    auto ahead = std::exchange(ahead_, std::nullopt);
    if (ahead && ahead->image == image && ahead->srgb == srgb) return std::move(ahead->texture);
    ahead.reset();  // one more is all there is room for
    const auto next = nextLarge(image, srgb);
    if (!next) return decodeNow(image, srgb);
    std::array<std::optional<Result<Texture>>, 2> textures;
    const auto decodeOne = [&](std::size_t share) { textures[share] = decodeNow(share == 0 ? image : *next, srgb); };
    doShares(textures.size(), ShareOfWork(decodeOne));
    ahead_ = Ahead{*next, srgb, std::move(*textures[1])};
    return std::move(*textures[0]);
  }

  /// Of those that are held smaller than they are.
  [[nodiscard]] std::optional<std::size_t> nextLarge(std::size_t image, bool srgb) const {
    if (!plan_.two_at_once || plan_.halvings[image] == 0) return std::nullopt;
    const auto isDone = [&](std::size_t other) {
      return srgb ? color_textures_.contains(other) : data_textures_.contains(other);
    };
    for (auto next = image + 1; next < plan_.halvings.size(); ++next)
      if (plan_.halvings[next] > 0 && !isDone(next) && known(next) == nullptr) return next;
    return std::nullopt;
  }

  /// What the document before had of the same bytes, if it is as large.
  [[nodiscard]] const DecodedImage* known(std::size_t image) const {
    if (context_.before == nullptr) return nullptr;
    const auto found = context_.before->images.find(context_.document.images[image]);
    if (found == context_.before->images.end() || found->second.halvings != plan_.halvings[image]) return nullptr;
    return &found->second;
  }

  /// Where it is kept for the next edit.
  DecodedImage& keep(std::size_t image) {
    auto& kept = context_.images[context_.document.images[image]];
    kept.halvings = plan_.halvings[image];
    return kept;
  }

  Result<std::uint32_t> colorTexture(std::size_t image) {
    if (const auto found = color_textures_.find(image); found != color_textures_.end()) return found->second;
    const auto* before = known(image);
    auto color = before != nullptr ? before->color : nullptr;
    if (!color) {
      auto texture = decode(image, true);
      if (!texture) return tl::unexpected(texture.error());
      color = std::make_shared<const Texture>(std::move(*texture));
    }
    keep(image).color = color;
    const auto index = static_cast<std::uint32_t>(context_.scene.textures.size());
    context_.scene.textures.push_back(std::move(color));
    color_textures_[image] = index;
    return index;
  }

  /// kNone where it tells nothing that `data_` does not.
  Result<std::uint32_t> dataTexture(std::size_t image) {
    auto found = data_textures_.find(image);
    if (found == data_textures_.end()) {
      const auto loaded = loadData(image);
      if (!loaded) return tl::unexpected(loaded.error());
      found = data_textures_.emplace(image, *loaded).first;
    }
    data_ = found->second;
    return found->second.texture;
  }

  struct DataTexture {
    std::uint32_t texture = kNone;
    std::optional<float> blue;
    float mean_green = 1.0F;
  };

  Result<DataTexture> loadData(std::size_t image) {
    DecodedImage data;
    if (const auto* before = known(image); before != nullptr) data = *before;
    if (!data.data && !data.blue) {
      auto texture = decode(image, false);
      if (!texture) return tl::unexpected(texture.error());
      data.blue = sameChannel(*texture, 2);
      data.mean_green = meanOf(*texture, 1);
      const bool is_metal = !data.blue || *data.blue > 0.0F;
      if (is_metal && !(data.blue && sameChannel(*texture, 1)))
        data.data = std::make_shared<const Texture>(std::move(*texture));
    }
    auto& kept = keep(image);
    kept.data = data.data;
    kept.blue = data.blue;
    kept.mean_green = data.mean_green;
    DataTexture found{kNone, data.blue, data.mean_green};
    if (data.data) {
      context_.scene.textures.push_back(std::move(data.data));
      found.texture = static_cast<std::uint32_t>(context_.scene.textures.size() - 1);
    }
    return found;
  }

  /// kNone where it tells nothing that `red_` does not.
  Result<std::uint32_t> maskTexture(std::size_t image) {
    DecodedImage mask;
    if (const auto* before = known(image); before != nullptr) mask = *before;
    if (!mask.mask && !mask.red) {
      auto texture = decode(image, false);
      if (!texture) return tl::unexpected(texture.error());
      mask.red = sameChannel(*texture, 0);
      if (!mask.red) mask.mask = std::make_shared<const Texture>(std::move(*texture));
    }
    auto& kept = keep(image);
    kept.mask = mask.mask;
    kept.red = mask.red;
    red_ = mask.red.value_or(1.0F);
    if (mask.red) return kNone;
    const auto known_as = mask_textures_.find(image);
    if (known_as != mask_textures_.end()) return known_as->second;
    const auto index = static_cast<std::uint32_t>(context_.scene.textures.size());
    context_.scene.textures.push_back(std::move(mask.mask));
    mask_textures_[image] = index;
    return index;
  }

  /// The value that all pixels have of a channel; none: they differ.
  static std::optional<float> sameChannel(const Texture& texture, std::size_t channel) {
    for (std::size_t i = channel; i < texture.rgba.size(); i += 4) {
      if (texture.rgba[i] != texture.rgba[channel]) return std::nullopt;
    }
    return texture.rgba.size() > channel ? static_cast<float>(texture.rgba[channel]) / 255.0F : 1.0F;
  }

  static float meanOf(const Texture& texture, std::size_t channel) {
    std::uint64_t sum = 0;
    for (std::size_t i = channel; i < texture.rgba.size(); i += 4) sum += texture.rgba[i];
    const auto pixels = texture.rgba.size() / 4;
    return pixels > 0 ? static_cast<float>(static_cast<double>(sum) / (255.0 * static_cast<double>(pixels))) : 1.0F;
  }

  ImportContext& context_;
  const ImagePlan& plan_;
  std::string pointer_;
  std::map<std::size_t, std::uint32_t> color_textures_;  ///< by image
  std::map<std::size_t, DataTexture> data_textures_;     ///< by image
  std::map<std::size_t, std::uint32_t> mask_textures_;   ///< by image
  struct Ahead {
    std::size_t image;
    bool srgb;
    Result<Texture> texture;
  };
  std::optional<Ahead> ahead_;       ///< what nobody has asked for yet
  std::optional<DataTexture> data_;  ///< the last that was asked for
  float red_ = 1.0F;                 ///< of the last mask, where it is the same all over
  std::set<std::string> warned_;     ///< textures whose references were looked at
};

}  // namespace

Result<void> importMaterials(ImportContext& context) {
  const auto plan = planImages(context.document, context.claimed_bytes, context.limits);
  if (!plan) return tl::unexpected(plan.error());
  if (plan->halved > 0)
    context.warn("/images", std::to_string(plan->halved) + " images are so large together that they are read at half " +
                                "their width and height, or less");
  MaterialImporter importer(context, *plan);
  for (std::size_t i = 0; i < context.materials.size(); ++i) {
    interruptionPoint();
    if (auto ok = importer.add(i); !ok) return ok;
  }
  return {};
}

}  // namespace radiosity::scene
