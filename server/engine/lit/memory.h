// Memory that runs out, and work that is called off: an error instead of the end. Scenes that cannot fit are refused
// before (scene/charts/atlas.h).
#pragma once

#include <new>
#include <string>

#include "common/result.h"
#include "common/task.h"

namespace radiosity::engine {

[[nodiscard]] inline tl::unexpected<Error> outOfMemory() {
  return fail(ErrorCode::kTooLarge, "the server's memory does not hold this; ask for fewer or larger texels");
}

[[nodiscard]] inline Error cancelled(const std::string& why) { return {ErrorCode::kCancelled, "cancelled: " + why}; }

/// What `work` returns, a Result; kTooLarge where memory runs out in it.
template <typename Work>
auto withinMemory(Work&& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return outOfMemory();
  }
}

/// The same with `task` as that of this thread; kCancelled where it is called off.
template <typename Work>
auto unlessCancelled(Task& task, Work&& work) -> decltype(work()) {
  const TaskScope scope(&task);
  try {
    return withinMemory(work);
  } catch (const Interrupted&) {
    return tl::unexpected<Error>(cancelled("the client has gone, or the server is shutting down"));
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
