// Work on the two independent halves of all samples, side by side.
#pragma once

#include <cstddef>
#include <future>

namespace radiosity::solver {

/// Calls work(0) in this thread and work(1) in another. When both have ended, what one of them threw is thrown here:
/// out of a plain thread it would end the process.
template <typename Work>
void inBothHalves(const Work& work) {
  auto other = std::async(std::launch::async, [&work] { work(std::size_t{1}); });
  work(std::size_t{0});  // throws: the destructor of `other` waits
  other.get();
}

}  // namespace radiosity::solver
