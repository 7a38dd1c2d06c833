// Loaded into radiosityd before all else (LD_PRELOAD): a disk that takes what is written and never says that it is
// safe, as a file server that went away does, while the file that RADIOSITY_TEST_STUCK_DISK names is there. Where
// RADIOSITY_TEST_SLOW_EXIT is set, a library that takes a second at the end of the program, after all of C++'s own, and
// says "exit of PID" on standard error before.
#include <dlfcn.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace {

using Sync = int (*)(int);

int wait(const char* name, int descriptor) {
  const char* file = std::getenv("RADIOSITY_TEST_STUCK_DISK");
  while (file != nullptr && access(file, F_OK) == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  return reinterpret_cast<Sync>(dlsym(RTLD_NEXT, name))(descriptor);
}

[[gnu::destructor]] void linger() {
  if (std::getenv("RADIOSITY_TEST_SLOW_EXIT") == nullptr) return;
  dprintf(STDERR_FILENO, "exit of %d\n", static_cast<int>(getpid()));
  std::this_thread::sleep_for(std::chrono::seconds(1));
}

}  // namespace

// NOLINTBEGIN(readability-identifier-naming): the C library's names
extern "C" int fsync(int descriptor) { return wait("fsync", descriptor); }
extern "C" int fdatasync(int descriptor) { return wait("fdatasync", descriptor); }
// NOLINTEND(readability-identifier-naming)
