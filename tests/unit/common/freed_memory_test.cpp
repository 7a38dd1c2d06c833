#include "common/freed_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <vector>

namespace radiosity {
namespace {

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

long pageFaults() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_minflt;
}

TEST(FreedMemory, IsThereTheNextTime) {
  constexpr std::size_t kBytes = std::size_t{16} << 20U, kPage = 4096;
  keepFreedMemory();
  const auto faultsOf = [] {
    const auto before = pageFaults();
    const std::vector<char> block(kBytes, 1);
    EXPECT_EQ(block[kBytes - 1], 1);
    return pageFaults() - before;
  };
  (void)faultsOf();
  EXPECT_LT(faultsOf(), static_cast<long>(kBytes / kPage / 8));
}

#endif

}  // namespace
}  // namespace radiosity
