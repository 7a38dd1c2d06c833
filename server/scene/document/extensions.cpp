// Which extensions of glTF are understood (import_schema.h).
#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "server/scene/document/import_schema.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {
namespace {

constexpr std::array<std::string_view, 19> kSupported = {"EXT_lights_area",
                                                         "EXT_lights_ies",
                                                         "EXT_lights_image_based",
                                                         "EXT_mesh_gpu_instancing",
                                                         "EXT_meshopt_compression",
                                                         "EXT_texture_webp",
                                                         "KHR_draco_mesh_compression",
                                                         "KHR_environment_map",
                                                         "KHR_lights_punctual",
                                                         "KHR_materials_diffuse_transmission",
                                                         "KHR_materials_emissive_strength",
                                                         "KHR_materials_pbrSpecularGlossiness",
                                                         "KHR_materials_transmission",
                                                         "KHR_materials_unlit",
                                                         "KHR_mesh_quantization",
                                                         "KHR_meshopt_compression",
                                                         "KHR_node_visibility",
                                                         "KHR_texture_basisu",
                                                         "KHR_texture_transform"};

bool isSupported(const std::string& extension) {
  return std::find(kSupported.begin(), kSupported.end(), extension) != kSupported.end();
}

bool isIndexInto(const Json& list, const Json& value) {
  return list.is_array() && value.is_number_unsigned() && value.get<std::size_t>() < list.size();
}

std::string nameOf(const Json& gltf, const Json& source) {
  const auto images = gltf.value("images", Json::array());
  if (!isIndexInto(images, source)) return "its image";
  const auto& image = images[source.get<std::size_t>()];
  const auto name = image.is_object() ? image.find("name") : image.end();
  const auto number = "image " + source.dump();
  return name != image.end() && name->is_string() ? number + " ('" + name->get<std::string>() + "')" : number;
}

/// KHR_texture_basisu: clients turn KTX2 into PNG, since no transcoder comes with Debian. A texture may name another
/// picture for those who do not know the extension, which is used.
Result<void> checkBasisu(const Json& gltf, const std::string& name) {
  constexpr const char* kBasisu = "KHR_texture_basisu";
  const auto images = gltf.value("images", Json::array()), textures = gltf.value("textures", Json::array());
  for (std::size_t i = 0; textures.is_array() && i < textures.size(); ++i) {
    const auto* basisu = textures[i].is_object() ? extensionOf(textures[i], kBasisu) : nullptr;
    if (basisu == nullptr || isIndexInto(images, textures[i].value("source", Json()))) continue;
    const auto source = basisu->is_object() ? basisu->value("source", Json()) : Json();
    return fail(ErrorCode::kUnsupported,
                nameOf(gltf, source) +
                    " is KTX2, which the server does not decode: open the file in the viewer or send it with "
                    "'radiosity', which make a PNG of it, or export it as PNG, JPEG or WebP",
                place(name, "/textures/" + std::to_string(i) + "/extensions/" + kBasisu));
  }
  return {};
}

}  // namespace

Result<void> checkExtensions(const Json& gltf, const std::string& name, std::vector<std::string>& warnings) {
  const auto list = [&](const char* member) { return gltf.contains(member) ? gltf[member] : Json::array(); };
  const auto required = list("extensionsRequired");
  for (std::size_t i = 0; i < required.size(); ++i) {
    const auto extension = required[i].get<std::string>();
    if (isSupported(extension)) continue;
    return fail(ErrorCode::kUnsupported,
                "the file requires " + extension + ", which is not supported; export without it",
                place(name, "/extensionsRequired/" + std::to_string(i)));
  }
  const auto used = list("extensionsUsed");
  for (std::size_t i = 0; i < used.size(); ++i) {
    const auto extension = used[i].get<std::string>();
    if (isSupported(extension)) continue;
    warnings.push_back(place(name, "/extensionsUsed/" + std::to_string(i)) + ": " + extension + " is ignored");
  }
  return checkBasisu(gltf, name);
}

}  // namespace radiosity::scene
