// Programs of others that `radiosity` runs and waits for. Blocking, on the caller's thread.
#pragma once

#include <string>
#include <vector>

#include "common/result.h"

namespace radiosity::cli {

struct Ran {
  int exit_code = 0;  ///< 128 + signal where one ended it
  std::string text;   ///< the last 4,096 bytes of what it printed, without the end of the line
};

/// Runs the program of this name from PATH, with these words after it and nothing to read. Errors name the program:
/// kNotFound: there is none; kCancelled within 50 ms of a signal; kUnavailable: it cannot be started, or has not ended
/// after ten minutes. The program is gone then, with what it started itself.
[[nodiscard]] Result<Ran> runProgram(std::vector<std::string> command);

}  // namespace radiosity::cli
