// Takes what is looked for out of lists of values.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <optional>
#include <utility>
#include <vector>

namespace radiosity {

/// The first of which `is_it` holds, moved out of the first list that has one; the rest stay in their order. Nothing:
/// none does.
template <typename T, typename IsIt>
[[nodiscard]] std::optional<T> takeFirst(std::initializer_list<std::vector<T>*> lists, const IsIt& is_it) {
  for (auto* list : lists) {
    const auto found = std::ranges::find_if(*list, is_it);
    if (found == list->end()) continue;
    auto taken = std::move(*found);
    list->erase(found);
    return taken;
  }
  return std::nullopt;
}

}  // namespace radiosity
