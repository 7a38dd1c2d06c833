// How much memory there is to work with.
#pragma once

#include <cstdint>

namespace radiosity {

/// What this process may use at most, bytes: the machine's memory, or less where a control group or the limit of its
/// address space allows less. Reads /proc and /sys, once. Any thread.
[[nodiscard]] std::uint64_t memoryLimitBytes();

}  // namespace radiosity
