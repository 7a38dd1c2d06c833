#include "server/scene/document/touched_parts.h"

#include <algorithm>
#include <optional>
#include <string>

namespace radiosity::scene {
namespace {

constexpr const char *kNodes = "nodes", *kMaterials = "materials", *kExtensions = "extensions";

bool isSame(const Json* before, const Json* after) {
  return before == nullptr || after == nullptr ? before == after : isIdentical(*before, *after);
}

/// Of an element, as applyJsonPatch() resolves names; its list stays in its order, since none may be inserted or taken
/// out.
std::optional<std::size_t> elementOf(const Tokens& path) {
  const auto isDigit = [](char c) { return c >= '0' && c <= '9'; };
  if (path.size() < 2 || path[1].empty() || path[1].size() > 9 || !std::ranges::all_of(path[1], isDigit))
    return std::nullopt;
  return std::stoul(path[1]);
}

/// A patch for one member of the root alone.
void addMember(const Json& before, const Json& after, const char* member, Json& operations) {
  const auto *one = memberOf(before, member), *other = memberOf(after, member);
  if (one == nullptr && other == nullptr) return;
  Json from = Json::object(), to = Json::object();
  if (one != nullptr) from[member] = *one;
  if (other != nullptr) to[member] = *other;
  for (auto& operation : diffJson(from, to)) operations.push_back(std::move(operation));
}

void addElements(const Json& before, const Json& after, const char* list, const std::set<std::size_t>& elements,
                 Json& operations) {
  if (elements.empty()) return;
  const auto *one = memberOf(before, list), *other = memberOf(after, list);
  if (one == nullptr || other == nullptr || !one->is_array() || !other->is_array() || one->size() > other->size())
    return addMember(before, after, list, operations);
  for (const auto i : elements) {
    if (i >= one->size()) continue;
    const auto pointer = std::string("/") + list + "/" + std::to_string(i);
    for (auto& operation : diffJson((*one)[i], (*other)[i])) {
      operation["path"] = pointer + operation["path"].get_ref<const std::string&>();
      operations.push_back(std::move(operation));
    }
  }
  for (auto i = one->size(); i < other->size(); ++i)
    operations.push_back({{"op", "add"}, {"path", std::string("/") + list + "/-"}, {"value", (*other)[i]}});
}

}  // namespace

TouchedParts touchedParts(const Json& patch, std::span<const Tokens> touched) {
  TouchedParts parts;
  const auto moves = [](const Json& operation) { return operation.value("op", std::string()) == "move"; };
  if (std::ranges::any_of(patch, moves)) return {};  // it touches also where it comes from
  for (const auto& path : touched) {
    if (path.empty()) return {};
    const auto element = elementOf(path);
    if (path[0] == kNodes && element) {
      parts.nodes.insert(*element);
    } else if (path[0] == kMaterials && element) {
      parts.materials.insert(*element);
    } else if (path[0] == kExtensions) {
      parts.extensions = true;
    } else {
      return {};
    }
  }
  parts.all = false;
  return parts;
}

Json diffDocuments(const Json& before, const Json& after, const TouchedParts& parts) {
  if (parts.all || !before.is_object() || !after.is_object()) return diffJson(before, after);
  Json operations = Json::array();
  if (parts.extensions) addMember(before, after, kExtensions, operations);
  for (const auto* member : TouchedParts::kSmall) addMember(before, after, member, operations);
  addElements(before, after, kMaterials, parts.materials, operations);
  addElements(before, after, kNodes, parts.nodes, operations);
  return operations;
}

bool touchMaterialsAlone(const TouchedParts& parts, const Json& before, const Json& after) {
  if (parts.all || !parts.nodes.empty() || parts.extensions) return false;
  const auto *one = memberOf(before, kMaterials), *other = memberOf(after, kMaterials);
  const bool as_many = one != nullptr && other != nullptr && one->is_array() && one->size() == other->size();
  return as_many && std::ranges::all_of(TouchedParts::kSmall, [&](const char* member) {
           return isSame(memberOf(before, member), memberOf(after, member));
         });
}

}  // namespace radiosity::scene
