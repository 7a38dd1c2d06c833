// What one input costs: a find is one that takes more time or memory than it may.
#pragma once

#include <sys/resource.h>

#include <ctime>

#include "tests/fuzz/target.h"

namespace radiosity::fuzz {

[[nodiscard]] inline double processorSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Measured from when it is made.
class Cost {
 public:
  Cost() { getrusage(RUSAGE_SELF, &before_); }

  /// Of memory, the growth of the most that the process ever had.
  void requireAtMost(double seconds, long kilobytes) const {
    require(processorSeconds() - begin_ < seconds, "it takes no more time than it may");
    rusage after{};
    getrusage(RUSAGE_SELF, &after);
    require(after.ru_maxrss - before_.ru_maxrss < kilobytes, "it takes no more memory than it may");
  }

 private:
  rusage before_{};
  double begin_ = processorSeconds();
};

}  // namespace radiosity::fuzz
