#include "server/solver/math/sampling.h"

#include <gtest/gtest.h>

#include <array>

namespace radiosity::solver {
namespace {

// Owen scrambling keeps the Sobol net property: of any 2^m consecutive points from a multiple of 2^m, each elementary
// interval of area 2^-m in the first two dimensions holds exactly one.
TEST(Sobol, FirstTwoDimensionsAreStratifiedInEveryElementaryInterval) {
  for (std::uint64_t key = 0; key < 20; ++key) {
    for (std::uint32_t split = 0; split <= 4; ++split) {
      std::array<int, 16> count{};
      const std::uint32_t columns = 1U << split, rows = 16U >> split;
      for (std::uint32_t i = 0; i < 16; ++i) {
        const auto p = sobol4(i, key);
        const auto x = static_cast<std::size_t>(p.x * columns), y = static_cast<std::size_t>(p.y * rows);
        ++count[y * columns + x];
      }
      for (const int c : count) EXPECT_EQ(c, 1) << "key " << key << " split " << split;
    }
  }
}

TEST(Sobol, EveryDimensionIsStratifiedAlone) {
  for (int d = 0; d < 4; ++d) {
    std::array<int, 64> count{};
    for (std::uint32_t i = 0; i < 64; ++i) ++count[static_cast<std::size_t>(sobol4(i, 99)[d] * 64)];
    for (const int c : count) EXPECT_EQ(c, 1) << "dimension " << d;
  }
}

TEST(Sobol, DifferentKeysGiveDifferentPoints) {
  EXPECT_NE(sobol4(3, 1), sobol4(3, 2));
  EXPECT_EQ(sobol4(3, 1), sobol4(3, 1));
}

}  // namespace
}  // namespace radiosity::solver
