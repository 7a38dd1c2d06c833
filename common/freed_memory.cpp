#include "common/freed_memory.h"

#include <cstdlib>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace radiosity {

void keepFreedMemory() {
#ifdef __GLIBC__
  constexpr int kMebi = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, 32 * kMebi);  // the most that glibc takes
  mallopt(M_TRIM_THRESHOLD, 64 * kMebi);
#endif
}

}  // namespace radiosity
