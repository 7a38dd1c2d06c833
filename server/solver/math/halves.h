// Work on the two independent halves of all samples, side by side.
#pragma once

#include <cstddef>

#include "common/parallel.h"

namespace radiosity::solver {

/// Calls work(0) in this thread and work(1) in another, where one is free: doShares(). When both have ended, what one
/// of them threw is thrown here: out of a plain thread it would end the process.
template <typename Work>
void inBothHalves(const Work& work) {
  doShares(2, ShareOfWork(work));
}

}  // namespace radiosity::solver
