#include "server/scene/lightmap/lit_glb_dangling.h"

#include <string>
#include <vector>

#include "server/scene/import/texture_references.h"

namespace radiosity::scene {

void dropDanglingTextures(Json& gltf) {
  const auto images = countOf(gltf, "images"), samplers = countOf(gltf, "samplers");
  std::vector<bool> there(countOf(gltf, "textures"), true);
  for (std::size_t t = 0; t < there.size(); ++t) {
    auto& texture = gltf["textures"][t];
    if (texture.contains("sampler") && !referenceOf(texture, "sampler", samplers)) texture.erase("sampler");
    if (!texture.contains("source") || referenceOf(texture, "source", images)) continue;
    texture.erase("source");
    there[t] = imageReferenceOf(texture, images).has_value();
  }
  if (!gltf.contains("materials")) return;
  for (auto& material : gltf["materials"]) {
    forEachTextureInfo(material, "", [&](Json& owner, const std::string& key, const std::string&) {
      const auto index = referenceOf(owner[key], "index", there.size());
      if (!index || !there[*index]) owner.erase(key);
    });
  }
}

}  // namespace radiosity::scene
