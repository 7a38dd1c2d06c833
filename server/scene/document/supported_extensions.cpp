// Which extensions of glTF a document may name.
#include <algorithm>
#include <iterator>
#include <string_view>

#include "server/scene/document/import_schema.h"

namespace radiosity::scene {
namespace {

constexpr std::string_view kSupported[] = {"EXT_lights_area",
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
                                           "KHR_materials_ior",
                                           "KHR_materials_pbrSpecularGlossiness",
                                           "KHR_materials_transmission",
                                           "KHR_materials_unlit",
                                           "KHR_materials_volume",
                                           "KHR_mesh_quantization",
                                           "KHR_meshopt_compression",
                                           "KHR_node_visibility",
                                           "KHR_texture_basisu",
                                           "KHR_texture_transform"};

bool isSupported(const std::string& extension) {
  return std::ranges::find(kSupported, extension) != std::end(kSupported);
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
  return {};
}

}  // namespace radiosity::scene
