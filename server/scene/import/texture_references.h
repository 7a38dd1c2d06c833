// What materials and textures of a document refer to, be it there or not. Pure; any thread.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/document/document.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// What an optional member refers to, of a list that has `count` entries; none, too, where it has no such entry.
[[nodiscard]] inline std::optional<std::size_t> referenceOf(const Json& object, const char* member, std::size_t count) {
  const auto found = object.find(member);
  if (found == object.end() || !found->is_number_integer()) return std::nullopt;
  const auto index = found->get<std::uint64_t>();  // what is negative is more than any count
  return index < count ? std::optional<std::size_t>(index) : std::nullopt;
}

/// Entries of a top-level list of a document.
[[nodiscard]] inline std::size_t countOf(const Json& gltf, const char* list) {
  const auto found = gltf.find(list);
  return found == gltf.end() ? 0 : found->size();
}

/// The image of a texture, of `count` that there are: that which EXT_texture_webp names, or else its `source`; none,
/// too, where there is no such image.
[[nodiscard]] inline std::optional<std::size_t> imageReferenceOf(const Json& texture, std::size_t count) {
  const auto* webp = extensionOf(texture, "EXT_texture_webp");
  const auto image = webp != nullptr ? referenceOf(*webp, "source", count) : std::nullopt;
  return image ? image : referenceOf(texture, "source", count);
}

/// KHR_texture_basisu: an error that names the image where a texture has no other. Clients turn KTX2 into PNG, since no
/// transcoder comes with Debian.
[[nodiscard]] Result<void> checkIsNoKtx2(const Document& document, std::size_t texture);

/// Calls visit(owner, key, where) for each texture info of a material and its extensions, also of textures that light
/// does not need: it is owner[key], and `where` its JSON pointer. The call may erase it. `value`: the material, at
/// `pointer`; values nest at most 64 deep.
template <typename Value, typename Visit>
void forEachTextureInfo(Value& value, const std::string& pointer, const Visit& visit) {
  if (!value.is_object()) return;
  std::vector<std::string> keys;
  for (const auto& item : value.items())
    if (item.key() != "extras") keys.push_back(item.key());
  for (const auto& key : keys) {
    const auto where = pointer + "/" + escapeToken(key);
    const auto& child = value[key];
    const bool is_info =
        key.ends_with("Texture") && child.is_object() && child.contains("index") && child["index"].is_number_integer();
    if (is_info) visit(value, key, where);
    if (const auto left = value.find(key); left != value.end()) forEachTextureInfo(*left, where, visit);
  }
}

}  // namespace radiosity::scene
