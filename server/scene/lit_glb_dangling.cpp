#include "server/scene/lit_glb_dangling.h"

#include <string>
#include <vector>

namespace radiosity::scene {
namespace {

bool refersTo(const Json& object, const char* member, std::size_t count) {
  const auto& index = object[member];
  return index.is_number_integer() && index.get<std::uint64_t>() < count;  // what is negative is more than any count
}

/// In a material and its extensions; values nest at most 64 deep.
void dropInfos(Json& value, const std::vector<bool>& there) {
  if (!value.is_object()) return;
  std::vector<std::string> dropped;
  for (auto& [key, child] : value.items()) {
    if (key == "extras") continue;
    const bool info =
        key.ends_with("Texture") && child.is_object() && child.contains("index") && child["index"].is_number_integer();
    if (info && !(refersTo(child, "index", there.size()) && there[child["index"].get<std::size_t>()])) {
      dropped.push_back(key);
    } else {
      dropInfos(child, there);
    }
  }
  for (const auto& key : dropped) value.erase(key);
}

}  // namespace

void dropDanglingTextures(Json& gltf) {
  const auto count = [&](const char* list) { return gltf.contains(list) ? gltf[list].size() : 0; };
  const auto images = count("images"), samplers = count("samplers");
  std::vector<bool> there(count("textures"), true);
  for (std::size_t t = 0; t < there.size(); ++t) {
    auto& texture = gltf["textures"][t];
    if (texture.contains("sampler") && !refersTo(texture, "sampler", samplers)) texture.erase("sampler");
    if (!texture.contains("source") || refersTo(texture, "source", images)) continue;
    texture.erase("source");
    there[t] = false;
  }
  if (!gltf.contains("materials")) return;
  for (auto& material : gltf["materials"]) dropInfos(material, there);
}

}  // namespace radiosity::scene
