// Memory that runs out when a test says so: an allocation of one thread fails, or all from it on. All of this program's
// `operator new` pass here.
#pragma once

#include <cstddef>

namespace radiosity::test {

/// What memory runs out for.
enum class Shortage { kOnce, kFromThenOn };

/// Of this thread, from now on, and of allocations of at least `least_bytes`: the one of this number (the first is 1)
/// throws std::bad_alloc, and with kFromThenOn so do all that follow. 0: none does, they are only counted.
void failAllocation(std::size_t number, std::size_t least_bytes, Shortage shortage);

/// Ends that. Returns how many of these allocations there were.
std::size_t letAllocate();

}  // namespace radiosity::test
