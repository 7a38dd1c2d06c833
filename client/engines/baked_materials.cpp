#include "client/engines/baked_materials.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "client/engines/gltf_json.h"

namespace radiosity::engines {
namespace {

template <typename Visit>
void forEachPrimitive(Json& gltf, const Visit& visit) {
  forEachIn(gltf, "meshes", [&](Json& mesh) { forEachIn(mesh, "primitives", visit); });
}

constexpr std::int64_t kNoPage = -1;

/// Materials by what they were and the page that they show now.
class MaterialsByPage {
 public:
  explicit MaterialsByPage(Json& materials) : materials_(materials), count_(materials.size()) {}

  /// `user` has "material", or not.
  void give(Json& user, std::int64_t page) {
    const auto was = indexIn(user, "material", count_);
    if (!was && page == kNoPage) return;
    const auto key = std::pair(was ? static_cast<std::int64_t>(*was) : kNoMaterial, page);
    const auto found = made_.find(key);
    const auto index = found != made_.end() ? found->second : made_.emplace(key, make(was, page)).first->second;
    user["material"] = index;
  }

 private:
  static constexpr std::int64_t kNoMaterial = -1;

  /// The first page that a material is on gets the material itself.
  std::size_t make(std::optional<std::size_t> was, std::int64_t page) {
    const bool is_free = was && originals_.try_emplace(*was, materials_[*was]).second;
    Json material =
        !was ? Json{{"name", "white"}, {"pbrMetallicRoughness", {{"metallicFactor", 0.0}}}} : Json(originals_.at(*was));
    if (page != kNoPage) {
      auto* extras = member(material, "extras");
      if (extras == nullptr || !extras->is_object()) material["extras"] = Json::object();
      material["extras"]["lightmap"] = page;
    }
    if (is_free) {
      materials_[*was] = std::move(material);
      return *was;
    }
    materials_.push_back(std::move(material));
    return materials_.size() - 1;
  }

  Json& materials_;
  std::size_t count_;
  std::map<std::pair<std::int64_t, std::int64_t>, std::size_t> made_;
  std::map<std::size_t, Json> originals_;
};

std::int64_t pageOf(Json& primitive, std::size_t pages) {
  auto* extras = member(primitive, "extras");
  if (extras == nullptr) return kNoPage;
  const auto page = indexIn(*extras, "lightmap", pages);
  return page ? static_cast<std::int64_t>(*page) : kNoPage;
}

/// KHR_materials_pbrSpecularGlossiness as a dielectric of the reflectance that it was lit with, as far as factors tell.
void turnToMetallicRoughness(Json& material) {
  constexpr const char* kName = "KHR_materials_pbrSpecularGlossiness";
  auto* gloss = extension(material, kName);
  if (gloss == nullptr) return;
  const auto numbers = [&](const char* name, std::size_t count) {
    std::vector<double> values(count, 1.0);
    const auto* given = member(*gloss, name);
    for (std::size_t i = 0; given != nullptr && given->is_array() && i < std::min(count, given->size()); ++i)
      if ((*given)[i].is_number()) values[i] = (*given)[i].get<double>();
    return values;
  };
  auto colour = numbers("diffuseFactor", 4);
  const auto specular = numbers("specularFactor", 3);
  const double most = std::clamp(*std::max_element(specular.begin(), specular.end()), 0.0, 1.0);
  // The factor, 1 unless stated, is that of the texture, so that by itself it says nothing of what is left.
  if (member(*gloss, "specularGlossinessTexture") == nullptr)
    for (std::size_t c = 0; c < 3; ++c) colour[c] *= 1.0 - most;
  Json look = {{"baseColorFactor", colour}, {"metallicFactor", 0.0}, {"roughnessFactor", 1.0}};
  if (const auto* texture = member(*gloss, "diffuseTexture"); texture != nullptr) look["baseColorTexture"] = *texture;
  material["pbrMetallicRoughness"] = std::move(look);
  dropExtension(material, kName);
}

/// Of what the solve knows nothing.
constexpr std::array kNotSolved = {"KHR_materials_anisotropy", "KHR_materials_clearcoat", "KHR_materials_iridescence",
                                   "KHR_materials_sheen"};

void forgetPage(Json& material) {
  auto* extras = member(material, "extras");
  if (extras == nullptr || !extras->is_object() || extras->erase("lightmap") == 0) return;
  if (extras->empty()) material.erase("extras");
}

}  // namespace

void splitMaterialsByPage(Json& gltf, std::size_t pages) {
  const bool had_none = member(gltf, "materials") == nullptr;
  auto& materials = listOf(gltf, "materials");
  forEachIn(gltf, "materials", forgetPage);
  MaterialsByPage by_page(materials);
  forEachPrimitive(gltf, [&](Json& primitive) {
    const auto page = pageOf(primitive, pages);
    by_page.give(primitive, page);
    auto* variants = extension(primitive, "KHR_materials_variants");
    if (variants != nullptr) forEachIn(*variants, "mappings", [&](Json& mapping) { by_page.give(mapping, page); });
  });
  if (had_none && materials.empty()) gltf.erase("materials");
}

void keepDiffuseOnly(Json& gltf) {
  bool any = false;
  forEachIn(gltf, "materials", [&](Json& material) {
    auto* extras = member(material, "extras");
    if (extras == nullptr || member(*extras, "lightmap") == nullptr) return;
    turnToMetallicRoughness(material);
    material.erase("occlusionTexture");
    for (const auto* name : {"KHR_materials_diffuse_transmission", "KHR_materials_unlit"})
      dropExtension(material, name);
    for (const auto* name : kNotSolved) dropExtension(material, name);
    material["extensions"]["KHR_materials_specular"] = {{"specularFactor", 0.0}};
    any = true;
  });
  if (any) addToUsed(gltf, "KHR_materials_specular");
}

}  // namespace radiosity::engines
