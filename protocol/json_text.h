// JSON values to text, for this folder's .cpp files only.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace radiosity::protocol {

/// Compact; bytes that are not UTF-8 become U+FFFD instead of an exception.
[[nodiscard]] std::string dumpJson(const nlohmann::json& value);

}  // namespace radiosity::protocol
