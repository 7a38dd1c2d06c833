// writeUnlitGlb: the lit scene as pictures on unlit materials, for viewers that know nothing of lightmaps.
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/check.h"
#include "server/scene/document/json_text.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/lightmap/lit_glb_picture.h"
#include "server/scene/shading/opacity.h"

namespace radiosity::scene {
namespace {

constexpr const char* kUnlit = "KHR_materials_unlit";
constexpr int kLinear = 9729;
constexpr int kClampToEdge = 33071;

/// An unlit stand-in for `material` that shows a page. The page's alpha is what the surface stops of the light, so
/// there is nothing left to multiply it with. Of a cell that MASK cuts out in part the page has the part that stays.
Json unlitMaterial(const Scene& scene, std::size_t material, std::uint32_t page) {
  const Material& source = scene.materials[material];
  Json out = {{"name", source.name + " lit " + std::to_string(page)}};
  out["pbrMetallicRoughness"] = {{"baseColorFactor", {1.0, 1.0, 1.0, 1.0}}, {"metallicFactor", 0.0}};
  out["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", page}, {"texCoord", 1}};
  const bool cut_out = source.alpha_mode == AlphaMode::kMask && source.transmission <= 0.0F;
  out["alphaMode"] = cut_out ? "MASK" : isSeeThrough(source) ? "BLEND" : "OPAQUE";
  if (cut_out) out["alphaCutoff"] = 0.5;
  out["extensions"][kUnlit] = Json::object();
  return out;
}

/// Vertex colours multiply the page, which has them already.
void dropColours(Json& primitive) {
  const auto drop = [](Json& attributes) {
    std::vector<std::string> names;
    for (const auto& [name, accessor] : attributes.items())
      if (name.rfind("COLOR_", 0) == 0) names.push_back(name);
    for (const auto& name : names) attributes.erase(name);
  };
  drop(primitive["attributes"]);
  if (!primitive.contains("targets")) return;
  for (auto& target : primitive["targets"]) drop(target);
}

void setPages(Document& out, const PatchScene& patches, std::span<const Image> pages) {
  auto& gltf = out.gltf;
  for (const auto* list : {"materials", "textures", "images", "samplers"}) gltf.erase(list);
  out.images.clear();
  if (pages.empty()) return;
  gltf["samplers"] =
      Json::array({{{"magFilter", kLinear}, {"minFilter", kLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}}});
  for (std::size_t i = 0; i < pages.size(); ++i) {
    out.images.push_back(
        std::make_shared<const Bytes>(encodePagePng(patches, static_cast<std::uint32_t>(i), pages[i])));
    gltf["images"].push_back({{"name", "lightmap " + std::to_string(i)}, {"mimeType", "image/png"}});
    gltf["textures"].push_back({{"source", i}, {"sampler", 0}});
  }
}

/// Names that only materials and their variants use.
void dropMaterialExtensions(Json& gltf, const char* list) {
  if (!gltf.contains(list)) return;
  Json kept = Json::array();
  for (const auto& name : gltf[list]) {
    const auto text = name.get<std::string>();
    if (text.rfind("KHR_materials_", 0) != 0 && text.find("_texture_") == std::string::npos) kept.push_back(name);
  }
  gltf[list] = kept;
  if (kept.empty()) gltf.erase(list);
}

}  // namespace

Result<Bytes> writeUnlitGlb(const Document& document, const Scene& scene, const PatchScene& patches,
                            std::span<const Image> display_pages) {
  RAD_CHECK_EQ(display_pages.size(), patches.pages.size());
  auto lit = withLightmapUvs(document, scene, patches);
  if (!lit) return tl::unexpected(lit.error());
  setPages(*lit, patches, display_pages);
  auto& gltf = lit->gltf;
  std::map<std::pair<std::size_t, std::uint32_t>, std::size_t> materials;
  if (!gltf.contains("meshes")) return writeGlb(*lit);
  for (auto& mesh : gltf["meshes"]) {
    for (auto& primitive : mesh["primitives"]) {
      // The scene's last material is its default one, when a primitive names none.
      const auto material = primitive.value("material", scene.materials.size() - 1);
      primitive.erase("material");
      primitive.erase("extensions");
      if (!primitive.contains("extras") || !primitive["extras"].is_object()) continue;
      if (!primitive["extras"].contains("lightmap")) continue;
      const auto page = primitive["extras"]["lightmap"].get<std::uint32_t>();
      const auto [found, added] = materials.try_emplace({material, page}, materials.size());
      if (added) gltf["materials"].push_back(unlitMaterial(scene, material, page));
      primitive["material"] = found->second;
      dropColours(primitive);
    }
  }
  dropMaterialExtensions(gltf, "extensionsUsed");
  dropMaterialExtensions(gltf, "extensionsRequired");
  if (gltf.contains("extensions")) gltf["extensions"].erase("KHR_materials_variants");
  gltf["extensionsUsed"].push_back(kUnlit);
  return writeGlb(*lit);
}

}  // namespace radiosity::scene
