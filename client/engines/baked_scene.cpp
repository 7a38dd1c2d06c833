#include "client/engines/baked_scene.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

namespace radiosity::engines {
namespace {

/// Null: there is none, or `of` is no object.
Json* member(Json& of, const char* name) {
  if (!of.is_object()) return nullptr;
  const auto found = of.find(name);
  return found == of.end() ? nullptr : &*found;
}

Json* extension(Json& of, const char* name) {
  auto* all = member(of, "extensions");
  return all == nullptr ? nullptr : member(*all, name);
}

/// Empty where there is none.
Json& listOf(Json& of, const char* name) {
  auto& list = of[name];
  if (!list.is_array()) list = Json::array();
  return list;
}

std::optional<std::size_t> indexIn(Json& of, const char* name, std::size_t count) {
  const auto* value = member(of, name);
  if (value == nullptr || !value->is_number_unsigned() || value->get<std::uint64_t>() >= count) return std::nullopt;
  return value->get<std::size_t>();
}

void dropExtension(Json& of, const char* name) {
  auto* all = member(of, "extensions");
  if (all == nullptr || !all->is_object()) return;
  all->erase(name);
  if (all->empty()) of.erase("extensions");
}

/// Off the lists at the top of the file.
void dropFromLists(Json& gltf, const char* name) {
  for (const auto* key : {"extensionsUsed", "extensionsRequired"}) {
    auto* list = member(gltf, key);
    if (list == nullptr || !list->is_array()) continue;
    list->erase(std::remove(list->begin(), list->end(), name), list->end());
    if (list->empty()) gltf.erase(key);
  }
}

void addToUsed(Json& gltf, const char* name) {
  auto& used = listOf(gltf, "extensionsUsed");
  if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
}

template <typename Visit>
void forEachPrimitive(Json& gltf, const Visit& visit) {
  auto* meshes = member(gltf, "meshes");
  if (meshes == nullptr || !meshes->is_array()) return;
  for (auto& mesh : *meshes) {
    auto* primitives = member(mesh, "primitives");
    if (primitives == nullptr || !primitives->is_array()) continue;
    for (auto& primitive : *primitives)
      if (primitive.is_object()) visit(primitive);
  }
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
  const auto specular = numbers("specularFactor", 3);
  auto colour = numbers("diffuseFactor", 4);
  const double kept = 1.0 - std::clamp(*std::max_element(specular.begin(), specular.end()), 0.0, 1.0);
  for (std::size_t c = 0; c < 3; ++c) colour[c] *= kept;
  Json look = {{"baseColorFactor", colour}, {"metallicFactor", 0.0}, {"roughnessFactor", 1.0}};
  if (const auto* texture = member(*gloss, "diffuseTexture"); texture != nullptr) look["baseColorTexture"] = *texture;
  material["pbrMetallicRoughness"] = std::move(look);
  dropExtension(material, kName);
}

constexpr std::array kLamps = {"KHR_lights_punctual", "EXT_lights_area", "EXT_lights_ies"};
constexpr std::array kSkies = {"EXT_lights_image_based", "KHR_environment_map"};

/// What node["extensions"][name] refers to: the element of the list `name` has at the top of the file, or itself.
Json lampOf(Json& gltf, Json& node, const char* name) {
  auto* use = extension(node, name);
  auto* all = extension(gltf, name);
  auto* lights = all == nullptr ? nullptr : member(*all, "lights");
  const auto index = lights == nullptr || !lights->is_array() ? std::nullopt : indexIn(*use, "light", lights->size());
  return index ? (*lights)[*index] : *use;
}

}  // namespace

void splitMaterialsByPage(Json& gltf, std::size_t pages) {
  const bool had_none = member(gltf, "materials") == nullptr;
  auto& materials = listOf(gltf, "materials");
  MaterialsByPage by_page(materials);
  forEachPrimitive(gltf, [&](Json& primitive) {
    const auto page = pageOf(primitive, pages);
    by_page.give(primitive, page);
    auto* variants = extension(primitive, "KHR_materials_variants");
    auto* mappings = variants == nullptr ? nullptr : member(*variants, "mappings");
    if (mappings == nullptr || !mappings->is_array()) return;
    for (auto& mapping : *mappings)
      if (mapping.is_object()) by_page.give(mapping, page);
  });
  if (had_none && materials.empty()) gltf.erase("materials");
}

void keepDiffuseOnly(Json& gltf) {
  auto* materials = member(gltf, "materials");
  if (materials == nullptr || !materials->is_array()) return;
  bool any = false;
  for (auto& material : *materials) {
    auto* extras = member(material, "extras");
    if (extras == nullptr || member(*extras, "lightmap") == nullptr) continue;
    if (extension(material, "KHR_materials_unlit") != nullptr) continue;
    turnToMetallicRoughness(material);
    material.erase("occlusionTexture");
    dropExtension(material, "KHR_materials_diffuse_transmission");
    material["extensions"]["KHR_materials_specular"] = {{"specularFactor", 0.0}};
    any = true;
  }
  if (any) addToUsed(gltf, "KHR_materials_specular");
  dropFromLists(gltf, "KHR_materials_diffuse_transmission");
  dropFromLists(gltf, "KHR_materials_pbrSpecularGlossiness");
}

std::vector<std::string> takeLightsOut(Json& gltf) {
  std::vector<std::string> names;
  auto& nodes = listOf(gltf, "nodes");
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    auto& node = nodes[i];
    for (const auto* kind : kLamps) {
      if (extension(node, kind) == nullptr) continue;
      Json lamp = lampOf(gltf, node, kind);
      dropExtension(node, kind);
      auto* extras = member(node, "extras");
      if (extras == nullptr || !extras->is_object()) node["extras"] = Json::object();
      auto& baked = node["extras"]["bakedLight"];
      if (!baked.is_object()) baked = Json::object();
      if (lamp.is_object()) baked.update(lamp);
      const auto* name = member(node, "name");
      names.push_back(name != nullptr && name->is_string() ? name->get<std::string>() : "node " + std::to_string(i));
    }
  }
  if (nodes.empty()) gltf.erase("nodes");
  if (auto* scenes = member(gltf, "scenes"); scenes != nullptr && scenes->is_array())
    for (auto& scene : *scenes)
      for (const auto* kind : kSkies) dropExtension(scene, kind);
  for (const auto* kind : kLamps) dropExtension(gltf, kind), dropFromLists(gltf, kind);
  for (const auto* kind : kSkies) dropExtension(gltf, kind), dropFromLists(gltf, kind);
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

void takeHiddenOut(Json& gltf) {
  constexpr const char* kName = "KHR_node_visibility";
  auto* nodes = member(gltf, "nodes");
  if (nodes == nullptr || !nodes->is_array()) return;
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    auto* of = extension((*nodes)[i], kName);
    const auto* visible = of == nullptr ? nullptr : member(*of, "visible");
    if (visible != nullptr && visible->is_boolean() && !visible->get<bool>()) open.push_back(i);
    dropExtension((*nodes)[i], kName);
  }
  dropFromLists(gltf, kName);
  std::vector<bool> seen(nodes->size(), false);
  while (!open.empty()) {
    const auto node = open.back();
    open.pop_back();
    if (node >= nodes->size() || seen[node]) continue;
    seen[node] = true;
    (*nodes)[node].erase("mesh");
    (*nodes)[node].erase("skin");
    (*nodes)[node].erase("weights");
    const auto* children = member((*nodes)[node], "children");
    if (children == nullptr || !children->is_array()) continue;
    for (const auto& child : *children)
      if (child.is_number_unsigned()) open.push_back(child.get<std::size_t>());
  }
}

}  // namespace radiosity::engines
