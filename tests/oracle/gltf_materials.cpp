#include "tests/oracle/gltf_materials.h"

#include <stb_image.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "tests/oracle/shading.h"

namespace radiosity::oracle {
namespace {

using nlohmann::json;

/// Translation times rotation times scale; counter-clockwise as one sees it, v being down.
glm::dmat3 textureMatrix(const json& transform) {
  const auto pair = [&](const char* name, double without) {
    const auto found = transform.value(name, std::vector<double>{without, without});
    return glm::dvec2(found.at(0), found.at(1));
  };
  const glm::dvec2 offset = pair("offset", 0.0), scale = pair("scale", 1.0);
  const double angle = transform.value("rotation", 0.0), c = std::cos(angle), s = std::sin(angle);
  const glm::dmat3 translation(1, 0, 0, 0, 1, 0, offset.x, offset.y, 1);
  const glm::dmat3 rotation(c, -s, 0, s, c, 0, 0, 0, 1);
  return translation * rotation * glm::dmat3(scale.x, 0, 0, 0, scale.y, 0, 0, 0, 1);
}

json extensionOf(const json& holder, const char* name) {
  return holder.value("extensions", json::object()).value(name, json());
}

class MaterialReader {
 public:
  MaterialReader(const GltfFile& file, std::vector<std::string>& warnings) : file_(file), warnings_(warnings) {}

  MaterialValues read(const json& material) {
    MaterialValues values;
    diffuse_part_ = 1.0;
    const auto pbr = material.value("pbrMetallicRoughness", json::object());
    const auto gloss = extensionOf(material, "KHR_materials_pbrSpecularGlossiness");
    // A file that has both means the first for those who do not know the second.
    if (gloss.is_object()) {
      readSpecularGlossiness(gloss, values);
    } else {
      readMetallicRoughness(pbr, values);
    }
    readEmission(material, values);
    values.double_sided = material.value("doubleSided", false);
    const auto& factor =
        gloss.is_object() ? gloss.value("diffuseFactor", json()) : pbr.value("baseColorFactor", json());
    readOpacity(material, factor, values);
    readDiffuseTransmission(material, values);
    return values;
  }

 private:
  void readMetallicRoughness(const json& pbr, MaterialValues& values) {
    values.reflectance = pbr.contains("baseColorFactor") ? vector3(pbr["baseColorFactor"]) : glm::dvec3(1.0);
    values.base_colour = textureUse(pbr, "baseColorTexture");
    values.metal = textureUse(pbr, "metallicRoughnessTexture");
    values.metallic = pbr.value("metallicFactor", 1.0);
    values.mirror.metallic = values.metallic;
    values.mirror.colour = values.reflectance;
    values.mirror.roughness = pbr.value("roughnessFactor", 1.0);
    if (values.metal.texture >= 0) return;
    diffuse_part_ = 1.0 - values.metallic;
    values.reflectance *= diffuse_part_;
    values.metallic = 0.0;
  }

  /// Diffuse light is what the specular part leaves.
  void readSpecularGlossiness(const json& gloss, MaterialValues& values) {
    values.reflectance = gloss.contains("diffuseFactor") ? vector3(gloss["diffuseFactor"]) : glm::dvec3(1.0);
    values.base_colour = textureUse(gloss, "diffuseTexture");
    values.specular_texture = textureUse(gloss, "specularGlossinessTexture");
    values.specular = gloss.contains("specularFactor") ? vector3(gloss["specularFactor"]) : glm::dvec3(1.0);
    if (values.specular_texture.texture >= 0) return;
    diffuse_part_ = 1.0 - std::max({values.specular.x, values.specular.y, values.specular.z});
    values.reflectance *= diffuse_part_;
    values.specular = glm::dvec3(0.0);
  }

  void readDiffuseTransmission(const json& material, MaterialValues& values) {
    const auto extension = extensionOf(material, "KHR_materials_diffuse_transmission");
    if (!extension.is_object()) return;
    values.diffuse_transmission = extension.value("diffuseTransmissionFactor", 0.0);
    const char* colour = "diffuseTransmissionColorFactor";
    values.transmitted = diffuse_part_ * (extension.contains(colour) ? vector3(extension[colour]) : glm::dvec3(1.0));
    values.transmission_part = textureUse(extension, "diffuseTransmissionTexture");
    values.transmission_colour = textureUse(extension, "diffuseTransmissionColorTexture");
  }

  void readEmission(const json& material, MaterialValues& values) {
    if (!material.contains("emissiveFactor")) return;
    const auto extension = extensionOf(material, "KHR_materials_emissive_strength");
    const double strength = extension.is_object() ? extension.value("emissiveStrength", 1.0) : 1.0;
    values.emission_lux = std::numbers::pi * strength * vector3(material["emissiveFactor"]);
    values.emissive = textureUse(material, "emissiveTexture");
  }

  void readOpacity(const json& material, const json& factor, MaterialValues& values) {
    const auto mode = material.value("alphaMode", std::string("OPAQUE"));
    if (mode != "OPAQUE" && factor.is_array()) values.alpha = factor.at(3).get<double>();
    if (mode == "MASK") values.cutoff = material.value("alphaCutoff", 0.5);
    if (const auto transmission = extensionOf(material, "KHR_materials_transmission"); transmission.is_object()) {
      values.transmission = transmission.value("transmissionFactor", 0.0);
      values.passing = textureUse(transmission, "transmissionTexture");
    }
    values.see_through = mode != "OPAQUE";
    if (values.transmission <= 0.0) return;
    const auto ior = extensionOf(material, "KHR_materials_ior");
    values.mirror.interface = interfaceOf(ior.is_object() ? ior.value("ior", 1.5) : 1.5);
    const auto volume = extensionOf(material, "KHR_materials_volume");
    if (!volume.is_object() || !volume.contains("attenuationColor") || !volume.contains("attenuationDistance")) return;
    const double thickness = volume.value("thicknessFactor", 0.0), distance = volume["attenuationDistance"];
    values.mirror.attenuation = glm::pow(vector3(volume["attenuationColor"]), glm::dvec3(0.5 * thickness / distance));
  }

  /// None where the reference leads nowhere: as if it were not there.
  MaterialTexture textureUse(const json& holder, const char* name) {
    if (!holder.contains(name)) return {};
    const auto& use = holder[name];
    const auto index = use.value("index", std::size_t{0});
    const auto& textures = file_.member("textures");
    if (index >= textures.size() || textures[index].value("source", std::size_t{0}) >= file_.member("images").size()) {
      warnings_.push_back(std::string(name) + " names a texture that is not there");
      return {};
    }
    MaterialTexture result{static_cast<int>(index), use.value("texCoord", 0), glm::dmat3(1.0)};
    const auto transform = extensionOf(use, "KHR_texture_transform");
    if (!transform.is_object()) return result;
    result.texcoord = transform.value("texCoord", result.texcoord);
    result.transform = textureMatrix(transform);
    return result;
  }

  const GltfFile& file_;
  std::vector<std::string>& warnings_;
  double diffuse_part_ = 1.0;  ///< that metal and gloss leave of the material's light where no texture tells
};

Image decode(std::span<const char> bytes) {
  Image image;
  int channels = 0;
  auto* pixels = stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()), static_cast<int>(bytes.size()),
                                       &image.width, &image.height, &channels, 4);
  if (pixels == nullptr) throw std::runtime_error("an image cannot be decoded");
  image.rgba.assign(
      pixels, pixels + std::size_t{4} * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  stbi_image_free(pixels);
  return image;
}

std::shared_ptr<const Image> readImage(const GltfFile& file, const json& image, std::vector<std::string>& warnings) {
  try {
    if (image.contains("bufferView"))
      return std::make_shared<Image>(decode(file.bytesOfView(image["bufferView"].get<std::size_t>())));
    return std::make_shared<Image>(decode(file.bytesOfUri(image.value("uri", std::string()))));
  } catch (const std::exception& error) {
    warnings.push_back(std::string("an image is taken as white: ") + error.what());
    return std::make_shared<Image>(Image{1, 1, {255, 255, 255, 255}});
  }
}

Texture::Wrap wrapOf(const json& sampler, const char* name) {
  switch (sampler.value(name, 10497)) {
    case 33071:
      return Texture::Wrap::kClamp;
    case 33648:
      return Texture::Wrap::kMirror;
    default:
      return Texture::Wrap::kRepeat;
  }
}

}  // namespace

std::vector<MaterialValues> readMaterials(const GltfFile& file, std::vector<std::string>& warnings) {
  std::vector<MaterialValues> materials;
  MaterialReader reader(file, warnings);
  for (const auto& material : file.member("materials")) materials.push_back(reader.read(material));
  return materials;
}

MaterialValues defaultMaterial() {
  MaterialValues values;
  values.reflectance = glm::dvec3(kMostReflectance);
  return values;
}

std::vector<Texture> readTextures(const GltfFile& file, std::vector<std::string>& warnings) {
  constexpr int kNearest = 9728;
  std::vector<std::shared_ptr<const Image>> images;
  for (const auto& image : file.member("images")) images.push_back(readImage(file, image, warnings));
  const auto white = std::make_shared<const Image>(Image{1, 1, {255, 255, 255, 255}});
  std::vector<Texture> textures;
  for (const auto& entry : file.member("textures")) {
    Texture texture;
    const auto source = entry.value("source", images.size());
    texture.image = source < images.size() ? images[source] : white;
    const auto& samplers = file.member("samplers");
    if (const auto index = entry.value("sampler", samplers.size()); index < samplers.size()) {
      texture.wrap_u = wrapOf(samplers[index], "wrapS");
      texture.wrap_v = wrapOf(samplers[index], "wrapT");
      texture.nearest = samplers[index].value("magFilter", 0) == kNearest;
    }
    textures.push_back(std::move(texture));
  }
  return textures;
}

}  // namespace radiosity::oracle
