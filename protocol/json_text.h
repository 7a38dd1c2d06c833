// JSON values to text, for this folder's .cpp files only.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace radiosity::protocol {

/// Compact; bytes that are not UTF-8 become U+FFFD instead of an exception.
[[nodiscard]] std::string dumpJson(const nlohmann::json& value);

/// A number with six significant digits: more than anything is known to, and a list is a third as long with them.
[[nodiscard]] double sixDigits(double value);

}  // namespace radiosity::protocol
