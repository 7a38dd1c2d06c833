#include "client/engines/gltf_json.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>

namespace radiosity::engines {
namespace {

/// Others can be in use without an object that bears their name, as KHR_mesh_quantization is.
constexpr std::array<std::string_view, 15> kTakenOut = {
    "EXT_lights_area",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "KHR_animation_pointer",
    "KHR_environment_map",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_unlit",
    "KHR_node_visibility",
};

void collectExtensions(const Json& in, std::set<std::string>& names) {
  if (in.is_array())
    for (const auto& element : in) collectExtensions(element, names);
  if (!in.is_object()) return;
  for (const auto& [name, value] : in.items()) {
    if (name == "extras") continue;  // the user's own
    if (name == "extensions" && value.is_object())
      for (const auto& [extension, ignored] : value.items()) names.insert(extension);
    collectExtensions(value, names);
  }
}

}  // namespace

Json* member(Json& of, const char* name) {
  if (!of.is_object()) return nullptr;
  const auto found = of.find(name);
  return found == of.end() ? nullptr : &*found;
}

Json* extension(Json& of, const char* name) {
  auto* all = member(of, "extensions");
  return all == nullptr ? nullptr : member(*all, name);
}

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

void addToUsed(Json& gltf, const char* name) {
  auto& used = listOf(gltf, "extensionsUsed");
  if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
}

void trimExtensionLists(Json& gltf) {
  std::set<std::string> has;
  collectExtensions(gltf, has);
  const auto is_gone = [&](const Json& name) {
    if (!name.is_string()) return false;
    const auto& text = name.get_ref<const std::string&>();
    return std::ranges::find(kTakenOut, text) != kTakenOut.end() && !has.contains(text);
  };
  for (const auto* key : {"extensionsUsed", "extensionsRequired"}) {
    auto* list = member(gltf, key);
    if (list == nullptr || !list->is_array()) continue;
    list->erase(std::remove_if(list->begin(), list->end(), is_gone), list->end());
    if (list->empty()) gltf.erase(key);
  }
}

}  // namespace radiosity::engines
