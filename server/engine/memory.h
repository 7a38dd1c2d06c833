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

}  // namespace radiosity::engine
