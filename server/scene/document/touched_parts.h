// What of a document a patch may have changed: an edit of one value is to cost what it touches, not what the document
// is long. Pure; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <set>
#include <span>

#include "server/scene/document/json_patch.h"

namespace radiosity::scene {

/// Elements of the longest lists, and all else at the root that an edit of those may change (kSmall). Whatever is not
/// named is the same before and after, down to the kind of each number.
struct TouchedParts {
  bool all = true;  ///< anything may have changed
  std::set<std::size_t> nodes, materials;
  bool extensions = false;  ///< of the document, its lights

  /// What defaults are written into beside what is touched.
  static constexpr std::array kSmall = {"extensionsUsed", "scene", "scenes"};
};

/// `touched`: by applyJsonPatch() with this patch.
[[nodiscard]] TouchedParts touchedParts(const Json& patch, std::span<const Tokens> touched);

/// diffJson() of documents that differ in `parts` at most. O(size of what is touched, and of what is small).
[[nodiscard]] Json diffDocuments(const Json& before, const Json& after, const TouchedParts& parts);

/// Whether nothing but materials may differ, of which there are as many.
[[nodiscard]] bool touchMaterialsAlone(const TouchedParts& parts, const Json& before, const Json& after);

}  // namespace radiosity::scene
