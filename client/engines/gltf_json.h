// Members of glTF's JSON that may be missing or of another kind than they should be. In place; any thread.
#pragma once

#include <cstddef>
#include <optional>

#include "client/engines/lit_scene.h"

namespace radiosity::engines {

/// Null: there is none, or `of` is no object.
[[nodiscard]] Json* member(Json& of, const char* name);
/// of["extensions"][name], likewise.
[[nodiscard]] Json* extension(Json& of, const char* name);

/// of[name] as an array, which is made where there is none. `of` is an object.
[[nodiscard]] Json& listOf(Json& of, const char* name);

/// of[name], if that is an index into a list of so many.
[[nodiscard]] std::optional<std::size_t> indexIn(Json& of, const char* name, std::size_t count);

/// Calls visit(element) for each object in the list of[name].
template <typename Visit>
void forEachIn(Json& of, const char* name, const Visit& visit) {
  auto* list = member(of, name);
  if (list == nullptr || !list->is_array()) return;
  for (auto& element : *list)
    if (element.is_object()) visit(element);
}

void dropExtension(Json& of, const char* name);

void addToUsed(Json& gltf, const char* name);

/// Takes those extensions off the lists at the top of the file that we take out of scenes and that nothing in the file
/// has any more.
void trimExtensionLists(Json& gltf);

}  // namespace radiosity::engines
