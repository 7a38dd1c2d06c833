// Loops over the cores of the machine.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <future>
#include <system_error>
#include <thread>
#include <vector>

namespace radiosity {

/// Calls work(share, shares) once for every share in [0, shares): share 0 in this thread, the others side by side in
/// threads of their own, one a core, at most `most`. When all have ended, what one of them threw is thrown here.
template <typename Work>
void inShares(std::size_t most, const Work& work) {
  static const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());  // which reads a file
  const std::size_t shares = std::clamp<std::size_t>(most, 1, std::min<std::size_t>(cores, 16));
  std::vector<std::future<void>> others;
  others.reserve(shares);
  std::size_t started = 1;
  try {
    for (; started < shares; ++started)
      others.push_back(std::async(std::launch::async, [&work, share = started, shares] { work(share, shares); }));
  } catch (const std::system_error&) {  // no more threads to be had: this one does their shares
  }
  work(std::size_t{0}, shares);  // throws: the destructors of `others` wait
  for (auto share = started; share < shares; ++share) work(share, shares);
  for (auto& other : others) other.get();
}

/// Calls work(part) once for every part in [0, parts), each by whichever thread of inShares() is free: where some parts
/// take far longer than others, and nobody knows which. What one of them threw is thrown here when all threads have
/// ended.
template <typename Work>
void inTurns(std::size_t parts, const Work& work) {
  std::atomic<std::size_t> next{0};
  inShares(parts, [&](std::size_t, std::size_t) {
    for (auto part = next++; part < parts; part = next++) work(part);
  });
}

}  // namespace radiosity
