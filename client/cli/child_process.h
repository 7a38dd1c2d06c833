// Programs of others that `radiosity` runs and waits for. Blocking, on the caller's thread.
#pragma once

#include <string>
#include <vector>

#include "common/result.h"

namespace radiosity::cli {

struct Ran {
  int exit_code = 0;  ///< 128 + signal where one ended it; kNoProgram: it was not found
  std::string text;   ///< the last 4,096 bytes of what it printed, without the end of the line
};

inline constexpr int kNoProgram = 127;

/// Runs the program of this name from PATH, with these words after it. Errors: kCancelled within 50 ms of a signal;
/// kUnavailable: it has not ended after ten minutes, or cannot be started for lack of resources. The program is gone
/// then.
[[nodiscard]] Result<Ran> runProgram(std::vector<std::string> command);

}  // namespace radiosity::cli
