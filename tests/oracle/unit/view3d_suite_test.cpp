// Form factors of geometries made by others against figures computed by others (View3D 3.2, single precision: View3D's
// own versions differ by about 0.3 % in the median).
#include "tests/oracle/view3d_suite.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace radiosity::oracle {
namespace {

struct Case {
  const char* input;
  const char* output;
  double tolerance;  ///< absolute; View3D's own is its eps, 1e-4 by default
};

class View3dSuite : public testing::TestWithParam<Case> {};

TEST_P(View3dSuite, FactorsAgree) {
  const std::filesystem::path suite = std::filesystem::path(RADIOSITY_SHARED_DIR) / "suites" / "viewfactors";
  if (!std::filesystem::exists(suite)) GTEST_SKIP() << "no " << suite;
  const auto expected = readView3dOutput(suite / "expected-view3d32" / GetParam().output);
  const auto found = viewFactors(readView3dInput(suite / GetParam().input), {1e-6, 7});
  ASSERT_EQ(found.areas.size(), expected.areas.size());
  std::vector<double> relative;
  for (std::size_t i = 0; i < expected.areas.size(); ++i) {
    EXPECT_NEAR(found.areas[i], expected.areas[i], 1e-5 * expected.areas[i]) << i;
    for (std::size_t j = 0; j < expected.areas.size(); ++j) {
      const double wanted = expected.factors[i * expected.areas.size() + j];
      const double value = found.factors[i * expected.areas.size() + j];
      EXPECT_NEAR(value, wanted, GetParam().tolerance) << "F(" << i + 1 << ", " << j + 1 << ")";
      if (wanted > 1e-3) relative.push_back(std::abs(value / wanted - 1.0));
    }
  }
  ASSERT_FALSE(relative.empty());
  std::sort(relative.begin(), relative.end());
  EXPECT_LT(relative[relative.size() / 2], 0.003);
}

INSTANTIATE_TEST_SUITE_P(Files, View3dSuite,
                         testing::Values(Case{"jakeoshannessy/ParallelPlanes.vs3", "ParallelPlanes.out", 2e-6},
                                         Case{"jasondegraw/cube.vs3", "cube.out", 2e-6},
                                         Case{"jasondegraw/square-obstruction.vs3", "square-obstruction.out", 1e-5},
                                         Case{"jakeoshannessy/facet.vs3", "facet.out", 1e-4},
                                         Case{"jakeoshannessy/wdwdoor.vs3", "wdwdoor.out", 1e-5},
                                         Case{"jakeoshannessy/gunter1.vs3", "gunter1.out", 1e-3}));

}  // namespace
}  // namespace radiosity::oracle
