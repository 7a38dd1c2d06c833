// RFC 6902 JSON Patch on a copy. Our own, because the library of Debian 12 (nlohmann 3.11.2) aborts on `add` through a
// scalar parent, ignores `remove` through one, and leaves a half-edited value when it throws. Pure; any thread.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {

using Tokens = std::vector<std::string>;

/// Asked before each change, with names resolved to indices: a reason to refuse, or "".
using PatchGuard = std::function<std::string(const Json& document, const std::string& op, const Tokens& path)>;

inline constexpr std::size_t kMaxPatchOperations = 5000;

/// At most so many operations, 64 levels, 64 MiB of added values, 20 million elements looked at for names. An array
/// element may be named: /nodes/@lamp. The error's message starts with "operation N: " (from 0), its `where` is the
/// pointer; kTestFailed for a failed `test`, kTooLarge over a limit, else kBadInput. `touched`, where given, gets the
/// resolved `path` of every operation.
[[nodiscard]] Result<Json> applyJsonPatch(const Json& document, const Json& patch, const PatchGuard& guard = {},
                                          std::vector<Tokens>* touched = nullptr);

/// A patch that turns `before` into `after`, in plain RFC 6902. Arrays of objects are compared element by element and
/// grow and shrink at their end; other arrays (vectors, lists of indices) are replaced whole. O(size of both).
[[nodiscard]] Json diffJson(const Json& before, const Json& after);

}  // namespace radiosity::scene
