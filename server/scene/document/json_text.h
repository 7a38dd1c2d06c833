// Text to JSON, bounded before parsing: the parser of Debian 12 recurses, so depth and size are checked by a linear
// scan. Pure functions; any thread.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "common/result.h"

namespace radiosity::scene {

using Json = nlohmann::json;

/// `text` as JSON. Refuses nesting over `max_depth`, more than 2^24 values, and what is not RFC 8259; the error's
/// `where` is "name: line L, column C".
[[nodiscard]] Result<Json> parseJson(std::string_view text, const std::string& name, std::size_t max_depth);

/// Levels of nesting of a value that is already parsed; walks with a stack of its own.
[[nodiscard]] std::size_t jsonDepth(const Json& value);

/// The same also in what kind of number stands there: 1.0 equals 1, but is no index.
[[nodiscard]] bool isIdentical(const Json& a, const Json& b);

/// RFC 6901 escaping of one token: ~ -> ~0, / -> ~1.
[[nodiscard]] std::string escapeToken(std::string_view token);

/// "room.glb: /accessors/4".
[[nodiscard]] std::string place(const std::string& name, std::string_view pointer);

/// A member of JSON that may be anything; null: there is none.
[[nodiscard]] inline const Json* memberOf(const Json& object, const char* name) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(name);
  return found == object.end() ? nullptr : &*found;
}

/// An extension object of a checked JSON object, or null.
[[nodiscard]] inline const Json* extensionOf(const Json& object, const char* name) {
  const auto extensions = object.find("extensions");
  if (extensions == object.end()) return nullptr;
  const auto found = extensions->find(name);
  return found == extensions->end() ? nullptr : &*found;
}

}  // namespace radiosity::scene
