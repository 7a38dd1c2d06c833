// Work on the two independent halves of all samples, side by side.
#pragma once

#include <cstddef>
#include <future>
#include <system_error>

namespace radiosity::solver {

/// Calls work(0) in this thread and work(1) in another. When both have ended, what one of them threw is thrown here:
/// out of a plain thread it would end the process.
template <typename Work>
void inBothHalves(const Work& work) {
  std::future<void> other;
  try {
    other = std::async(std::launch::async, [&work] { work(std::size_t{1}); });
  } catch (const std::system_error&) {  // no more threads to be had: this one does both
  }
  work(std::size_t{0});  // throws: the destructor of `other` waits
  if (other.valid()) {
    other.get();
  } else {
    work(std::size_t{1});
  }
}

}  // namespace radiosity::solver
