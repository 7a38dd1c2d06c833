// Memory that runs out: an error instead of the end. Scenes that cannot fit are refused before (scene/atlas.h).
#pragma once

#include <new>

#include "common/result.h"

namespace radiosity::engine {

[[nodiscard]] inline tl::unexpected<Error> outOfMemory() {
  return fail(ErrorCode::kTooLarge, "the server's memory does not hold this; ask for fewer or larger texels");
}

/// What `work` returns, a Result; kTooLarge where memory runs out in it.
template <typename Work>
auto withinMemory(Work&& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return outOfMemory();
  }
}

/// Whether memory sufficed for `work`, which returns nothing. For what comes after an edit is on the disk: that is made
/// then, come what may, and must not be told as refused.
template <typename Work>
bool fitsMemory(Work&& work) {
  try {
    work();
    return true;
  } catch (const std::bad_alloc&) {
    return false;
  }
}

}  // namespace radiosity::engine
