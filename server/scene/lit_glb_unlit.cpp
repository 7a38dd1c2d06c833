// writeUnlitGlb: the lit scene as pictures on unlit materials, for viewers that know nothing of lightmaps.
#include <stb_image_write.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/check.h"
#include "server/scene/json_text.h"
#include "server/scene/lightmap.h"

namespace radiosity::scene {
namespace {

constexpr const char* kUnlit = "KHR_materials_unlit";
constexpr int kLinear = 9729;
constexpr int kClampToEdge = 33071;

Bytes encodePng(const Image& image) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(image.pixels.size() * 3);
  for (const auto& pixel : image.pixels) {
    for (int c = 0; c < 3; ++c) {
      const auto value = std::isfinite(pixel[c]) ? std::clamp(pixel[c], 0.0F, 1.0F) : 0.0F;
      rgb.push_back(static_cast<std::uint8_t>(std::lround(value * 255.0F)));
    }
  }
  Bytes png;
  const auto write = [](void* context, void* data, int size) {
    auto& out = *static_cast<Bytes*>(context);
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    out.insert(out.end(), bytes, bytes + size);
  };
  stbi_write_png_to_func(write, &png, image.width, image.height, 3, rgb.data(), image.width * 3);
  return png;
}

/// An unlit stand-in for `material` that shows a page. What lets light through stays see-through.
Json unlitMaterial(const Scene& scene, std::size_t material, std::uint32_t page) {
  const Material& source = scene.materials[material];
  const float alpha = source.alpha_mode == AlphaMode::kBlend ? source.alpha : 1.0F;
  const float opacity = alpha * (1.0F - source.transmission);
  Json out = {{"name", source.name + " lit " + std::to_string(page)}};
  out["pbrMetallicRoughness"] = {{"baseColorFactor", {1.0, 1.0, 1.0, opacity}}, {"metallicFactor", 0.0}};
  out["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", page}, {"texCoord", 1}};
  out["alphaMode"] = opacity < 1.0F ? "BLEND" : "OPAQUE";
  out["extensions"][kUnlit] = Json::object();
  return out;
}

void setPages(Document& out, std::span<const Image> pages) {
  auto& gltf = out.gltf;
  for (const auto* list : {"materials", "textures", "images", "samplers"}) gltf.erase(list);
  out.images.clear();
  if (pages.empty()) return;
  gltf["samplers"] =
      Json::array({{{"magFilter", kLinear}, {"minFilter", kLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}}});
  for (std::size_t i = 0; i < pages.size(); ++i) {
    out.images.push_back(std::make_shared<const Bytes>(encodePng(pages[i])));
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
  setPages(*lit, display_pages);
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
    }
  }
  dropMaterialExtensions(gltf, "extensionsUsed");
  dropMaterialExtensions(gltf, "extensionsRequired");
  if (gltf.contains("extensions")) gltf["extensions"].erase("KHR_materials_variants");
  gltf["extensionsUsed"].push_back(kUnlit);
  return writeGlb(*lit);
}

}  // namespace radiosity::scene
