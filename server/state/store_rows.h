// How Store's values lie in rows; private to this folder.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/state/database.h"

namespace radiosity::state {

inline constexpr std::string_view kSettingPrefix = "setting.";

/// SQLite's integers are signed; all 64 bits survive.
[[nodiscard]] inline std::int64_t signedOf(std::uint64_t value) { return static_cast<std::int64_t>(value); }

/// Columns of a row; 0 or "" where it is of another type.
[[nodiscard]] inline std::int64_t integer(const Row& row, std::size_t column) {
  const auto* value = column < row.size() ? std::get_if<std::int64_t>(&row[column]) : nullptr;
  return value == nullptr ? 0 : *value;
}
[[nodiscard]] inline std::uint64_t number(const Row& row, std::size_t column) {
  return static_cast<std::uint64_t>(integer(row, column));
}
[[nodiscard]] inline double real(const Row& row, std::size_t column) {
  const auto* value = column < row.size() ? std::get_if<double>(&row[column]) : nullptr;
  return value == nullptr ? 0.0 : *value;
}
[[nodiscard]] inline std::string text(const Row& row, std::size_t column) {
  const auto* value = column < row.size() ? std::get_if<std::string>(&row[column]) : nullptr;
  return value == nullptr ? std::string() : *value;
}

/// "id,id,id"; empty parts are left out.
[[nodiscard]] inline std::vector<std::string> splitIds(std::string_view ids) {
  std::vector<std::string> parts;
  while (!ids.empty()) {
    const auto end = std::min(ids.find(','), ids.size());
    if (end > 0) parts.emplace_back(ids.substr(0, end));
    ids.remove_prefix(std::min(end + 1, ids.size()));
  }
  return parts;
}

}  // namespace radiosity::state
