#include "server/scene/document/json_patch.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace radiosity::scene {
namespace {

constexpr std::size_t kMaxDepth = 64;
// `copy` can double a document with each operation; what is added is bounded, not the count of operations alone.
constexpr std::size_t kMaxAddedBytes = std::size_t{64} << 20;
// Looking for a name reads the elements of an array, and what is added or removed moves all behind it: a patch may do
// so with so many in all, a second's worth or so.
constexpr std::size_t kMaxRead = 20'000'000;

/// About what a value costs in memory.
std::size_t weightOf(const Json& value) {
  std::size_t bytes = 0;
  std::vector<const Json*> stack{&value};
  while (!stack.empty()) {
    const auto* at = stack.back();
    stack.pop_back();
    bytes += 32;
    if (at->is_string()) bytes += at->get_ref<const std::string&>().size();
    if (at->is_object()) {
      for (const auto& [key, child] : at->items()) bytes += key.size() + 32;
    }
    if (at->is_structured()) {
      for (const auto& child : *at) stack.push_back(&child);
    }
  }
  return bytes;
}

/// One operation at a time on `document_`; `fault` builds its error.
class Patcher {
 public:
  Patcher(const Json& document, const PatchGuard& guard) : document_(document), guard_(guard) {}

  Result<void> apply(const Json& operation, std::size_t number) {
    number_ = number;
    where_.clear();
    touched_.clear();
    if (!operation.is_object()) return fault("is not an object");
    const auto op = stringOf(operation, "op");
    const auto path = stringOf(operation, "path");
    if (path) where_ = *path;
    if (!op) return fault("has no 'op'");
    if (!path) return fault("has no 'path'");
    if (*op == "add" || *op == "replace" || *op == "test") {
      if (!operation.contains("value")) return fault("has no 'value'");
      return withValue(*op, *path, operation["value"]);
    }
    if (*op == "remove") return remove(*path);
    if (*op == "move" || *op == "copy") {
      const auto from = stringOf(operation, "from");
      if (!from) return fault("has no 'from'");
      return transfer(*op, *from, *path);
    }
    return fault("unknown op '" + *op + "'");
  }

  Json take() { return std::move(document_); }
  /// Of the operation applied last, names resolved to indices.
  [[nodiscard]] const Tokens& touched() const { return touched_; }

 private:
  struct Target {
    Tokens path;             ///< names and "-" resolved
    Json* parent = nullptr;  ///< null for the whole document
    std::string key;         ///< of an object parent
    std::size_t index = 0;   ///< of an array parent; may be its size
    Json* value = nullptr;   ///< null where there is none yet
  };

  static std::optional<std::string> stringOf(const Json& object, const char* member) {
    const auto found = object.find(member);
    if (found == object.end() || !found->is_string()) return std::nullopt;
    return found->get<std::string>();
  }

  [[nodiscard]] tl::unexpected<Error> fault(const std::string& what, ErrorCode code = ErrorCode::kBadInput) const {
    Error error{code, "operation " + std::to_string(number_) + ": " + what, where_};
    error.operation = static_cast<std::uint32_t>(number_);
    return tl::unexpected<Error>(std::move(error));
  }

  [[nodiscard]] Result<Tokens> split(const std::string& pointer) const {
    Tokens tokens;
    if (pointer.empty()) return tokens;
    if (pointer[0] != '/') return fault("a pointer must start with '/': '" + pointer + "'");
    for (const char c : pointer) {
      if (c == '/') {
        tokens.emplace_back();
      } else {
        tokens.back() += c;
      }
    }
    if (tokens.size() > kMaxDepth) return fault("pointer has more than 64 levels", ErrorCode::kTooLarge);
    for (auto& token : tokens) {
      std::string plain;
      for (std::size_t i = 0; i < token.size(); ++i) {
        if (token[i] != '~') {
          plain += token[i];
        } else if (i + 1 < token.size() && (token[i + 1] == '0' || token[i + 1] == '1')) {
          plain += token[++i] == '0' ? '~' : '/';
        } else {
          return fault("'~' must be followed by 0 or 1 in '" + pointer + "'");
        }
      }
      token = plain;
    }
    return tokens;
  }

  /// "@lamp": the one element whose `name` is lamp. Digits without leading zeros: that element. "-": past the end.
  [[nodiscard]] Result<std::size_t> arrayIndex(const Json& array, const std::string& token) {
    if (token == "-") return array.size();
    if (!token.empty() && token[0] == '@') return namedIndex(array, token.substr(1));
    const bool digits =
        !token.empty() && std::all_of(token.begin(), token.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!digits || token.size() > 9 || (token.size() > 1 && token[0] == '0')) {
      return fault("'" + token + "' is not an array index");
    }
    return static_cast<std::size_t>(std::stoul(token));
  }

  [[nodiscard]] static bool isNamed(const Json& element, const std::string& name) {
    if (!element.is_object()) return false;
    const auto found = element.find("name");
    return found != element.end() && found->is_string() && found->get_ref<const std::string&>() == name;
  }

  [[nodiscard]] Result<std::size_t> namedIndex(const Json& array, const std::string& name) {
    read_ += array.size();
    if (read_ > kMaxRead) return fault("the patch looks for too many names; use indices", ErrorCode::kTooLarge);
    std::optional<std::size_t> found;
    for (std::size_t i = 0; i < array.size(); ++i) {
      if (!isNamed(array[i], name)) continue;
      if (found) return fault("'" + name + "' names more than one element; use its index");
      found = i;
    }
    if (!found) return fault("nothing is named '" + name + "'");
    return *found;
  }

  [[nodiscard]] Result<Target> resolve(const std::string& pointer) {
    auto tokens = split(pointer);
    if (!tokens) return tl::unexpected(tokens.error());
    Target target;
    target.value = &document_;
    for (const auto& token : *tokens) {
      if (target.value == nullptr) return fault("there is no parent for '" + token + "' in '" + pointer + "'");
      target.parent = target.value;
      target.value = nullptr;
      if (target.parent->is_object()) {
        target.key = token;
        if (const auto found = target.parent->find(token); found != target.parent->end()) target.value = &*found;
        target.path.push_back(token);
      } else if (target.parent->is_array()) {
        const auto index = arrayIndex(*target.parent, token);
        if (!index) return tl::unexpected(index.error());
        target.index = *index;
        if (*index < target.parent->size()) target.value = &(*target.parent)[*index];
        target.path.push_back(std::to_string(*index));
      } else {
        return fault("'" + token + "' in '" + pointer + "' is below a value that has no members");
      }
    }
    return target;
  }

  [[nodiscard]] Result<void> permit(const std::string& op, const Tokens& path) const {
    const auto why = guard_ ? guard_(document_, op, path) : std::string();
    if (!why.empty()) return fault(why);
    return {};
  }

  [[nodiscard]] Result<void> afford(const Json& value, const Tokens& path) {
    if (path.size() + jsonDepth(value) > kMaxDepth)
      return fault("would nest deeper than 64 levels", ErrorCode::kTooLarge);
    added_ += weightOf(value);
    if (added_ > kMaxAddedBytes) return fault("the patch adds more than 64 MiB", ErrorCode::kTooLarge);
    return {};
  }

  Result<void> withValue(const std::string& op, const std::string& path, const Json& value) {
    auto target = resolve(path);
    if (!target) return tl::unexpected(target.error());
    touched_ = target->path;
    if (op == "add") return add(*target, value);
    if (target->value == nullptr) return fault("there is no such value");
    if (op == "test") {
      if (*target->value == value) return {};
      return fault("test failed: the value is " + shortened(*target->value), ErrorCode::kTestFailed);
    }
    if (auto ok = permit(op, target->path); !ok) return ok;
    if (auto ok = afford(value, target->path); !ok) return ok;
    *target->value = value;
    return {};
  }

  static std::string shortened(const Json& value) {
    constexpr std::size_t kLongest = 200;
    if (value.is_structured() && weightOf(value) > 32 * kLongest) return value.type_name();
    auto text = value.dump(-1, ' ', true, Json::error_handler_t::replace);  // ASCII, so it can be cut anywhere
    if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
    return text;
  }

  Result<void> add(Target& target, Json value) {
    if (target.parent != nullptr && target.parent->is_array() && target.index > target.parent->size()) {
      return fault("index " + std::to_string(target.index) + " is past the end");
    }
    if (auto ok = permit("add", target.path); !ok) return ok;
    if (auto ok = afford(value, target.path); !ok) return ok;
    if (target.parent == nullptr) {
      document_ = std::move(value);
    } else if (target.parent->is_array()) {
      if (auto ok = shift(target.parent->size() - target.index); !ok) return ok;
      target.parent->insert(target.parent->begin() + static_cast<std::ptrdiff_t>(target.index), std::move(value));
    } else {
      (*target.parent)[target.key] = std::move(value);
    }
    return {};
  }

  Result<void> remove(const std::string& path) {
    const auto target = resolve(path);
    if (!target) return tl::unexpected(target.error());
    if (target->value == nullptr) return fault("there is no such value");
    touched_ = target->path;
    if (auto ok = permit("remove", target->path); !ok) return ok;
    return erase(*target);
  }

  Result<void> erase(const Target& target) {
    if (target.parent == nullptr) {
      document_ = nullptr;
    } else if (target.parent->is_array()) {
      if (auto ok = shift(target.parent->size() - target.index); !ok) return ok;
      target.parent->erase(target.index);
    } else {
      target.parent->erase(target.key);
    }
    return {};
  }

  /// Elements behind the place where an array grows or shrinks move up: a long one is not to be moved by every
  /// operation of a patch.
  Result<void> shift(std::size_t elements) {
    read_ += elements;
    if (read_ <= kMaxRead) return {};
    return fault("the patch moves too many elements of long arrays; add and remove at their ends",
                 ErrorCode::kTooLarge);
  }

  Result<void> transfer(const std::string& op, const std::string& from, const std::string& path) {
    const auto source = resolve(from);
    if (!source) return tl::unexpected(source.error());
    if (source->value == nullptr) return fault("there is no value at 'from' (" + from + ")");
    Json value;
    if (op == "move") {
      // Compared as resolved: a name and an index may mean the same element.
      const auto to = resolve(path);
      if (!to) return tl::unexpected(to.error());
      const auto& inner = source->path;
      const bool below = to->path.size() >= inner.size() && std::equal(inner.begin(), inner.end(), to->path.begin());
      if (below && to->path.size() > inner.size()) return fault("cannot move a value into itself");
      if (below) return {};
      if (auto ok = permit("remove", inner); !ok) return ok;
      value = std::move(*source->value);
      if (auto ok = erase(*source); !ok) return ok;
    } else {
      value = *source->value;
    }
    auto target = resolve(path);
    if (!target) return tl::unexpected(target.error());
    touched_ = target->path;
    return add(*target, std::move(value));
  }

  Json document_;
  const PatchGuard& guard_;
  std::size_t number_ = 0;
  std::size_t added_ = 0;
  std::size_t read_ = 0;  ///< elements, on the way
  std::string where_;
  Tokens touched_;
};

/// Whether elements are things of their own, which keep their index, rather than parts of one value.
bool isListOfObjects(const Json& value) {
  return value.is_array() && std::all_of(value.begin(), value.end(), [](const Json& e) { return e.is_object(); });
}

void addDifference(const Json& before, const Json& after, const std::string& pointer, Json& operations) {
  if (before == after) return;
  if (before.is_object() && after.is_object()) {
    for (const auto& [key, value] : before.items()) {
      const auto child = pointer + "/" + escapeToken(key);
      if (const auto found = after.find(key); found != after.end()) {
        addDifference(value, *found, child, operations);
      } else {
        operations.push_back({{"op", "remove"}, {"path", child}});
      }
    }
    for (const auto& [key, value] : after.items()) {
      if (!before.contains(key))
        operations.push_back({{"op", "add"}, {"path", pointer + "/" + escapeToken(key)}, {"value", value}});
    }
  } else if (isListOfObjects(before) && isListOfObjects(after)) {
    const auto both = std::min(before.size(), after.size());
    for (std::size_t i = 0; i < both; ++i)
      addDifference(before[i], after[i], pointer + "/" + std::to_string(i), operations);
    for (std::size_t i = before.size(); i > both; --i)
      operations.push_back({{"op", "remove"}, {"path", pointer + "/" + std::to_string(i - 1)}});
    for (std::size_t i = both; i < after.size(); ++i)
      operations.push_back({{"op", "add"}, {"path", pointer + "/-"}, {"value", after[i]}});
  } else {
    operations.push_back({{"op", "replace"}, {"path", pointer}, {"value", after}});
  }
}

}  // namespace

Result<Json> applyJsonPatch(const Json& document, const Json& patch, const PatchGuard& guard,
                            std::vector<Tokens>* touched) {
  if (!patch.is_array()) return fail(ErrorCode::kBadInput, "a JSON Patch is an array of operations", "patch");
  if (patch.size() > kMaxPatchOperations) {
    return fail(ErrorCode::kTooLarge, "a patch may have " + std::to_string(kMaxPatchOperations) + " operations",
                "patch");
  }
  if (jsonDepth(patch) > kMaxDepth) return fail(ErrorCode::kTooLarge, "patch is nested deeper than 64 levels", "patch");
  Patcher patcher(document, guard);
  for (std::size_t i = 0; i < patch.size(); ++i) {
    if (auto ok = patcher.apply(patch[i], i); !ok) return tl::unexpected(ok.error());
    if (touched != nullptr) touched->push_back(patcher.touched());
  }
  return patcher.take();
}

Json diffJson(const Json& before, const Json& after) {
  Json operations = Json::array();
  addDifference(before, after, "", operations);
  return operations;
}

}  // namespace radiosity::scene
