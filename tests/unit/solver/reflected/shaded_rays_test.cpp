// What rays count for a normal that is not the face's.
#include "server/solver/reflected/shaded_rays.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <vector>

#include "server/solver/math/sampling.h"
#include "server/solver/rays/leaf_rays.h"

namespace radiosity::solver {
namespace {

const glm::dvec3 kFace(0.0, 1.0, 0.0);

/// The four sums of a leaf with so many rays, of light by direction.
template <typename Light>
std::array<double, 4> sumsOf(std::uint32_t count, const glm::dvec3& normal, const Light& light) {
  ShadedRays rays;
  rays.beginLeaf(0, normal);  // one that has none
  rays.beginLeaf(count, normal);
  std::vector<double> seen;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto at = sobol4(i, 7);
    const auto direction = cosineDirection(kFace, at.x, at.y);
    rays.addRay(kFace, direction);
    seen.push_back(light(direction));
  }
  const auto& leaf = rays.leaf(1);
  std::array<double, 4> sums{};
  double mean = 0.0;
  for (const double one : seen) mean += one / count;
  for (std::size_t k = 0; k < 4; ++k) {
    for (std::uint32_t i = 0; i < count; ++i) sums[k] += leaf.unit * rays.weights(leaf)[i][k] * seen[i];
    sums[k] += leaf.mean[k] * mean;
  }
  return sums;
}

TEST(ShadedRays, LightThatIsTheSameFromEverywhereIsKnownWithoutNoise) {
  const auto normal = glm::normalize(glm::dvec3(0.6, 0.8, 0.0));
  for (const std::uint32_t count : {4U, 64U, 1024U}) {
    const auto sums = sumsOf(count, normal, [](const glm::dvec3&) { return 3.0; });
    const double arrives = normal.x * sums[0] + normal.y * sums[1] + normal.z * sums[2] + sums[3];
    EXPECT_NEAR(arrives, 3.0 * 0.5 * (1.0 + normal.y), 3e-3) << count;  // of the half space above both horizons
  }
}

// The integral of (1 + x) (x, y, z) over the half space, by pi.
TEST(ShadedRays, LightThatGrowsToOneSideComesFromThere) {
  const auto sums = sumsOf(4096, kFace, [](const glm::dvec3& direction) { return 1.0 + direction.x; });
  EXPECT_NEAR(sums[0], 2.0 / 3.0, 0.03);
  EXPECT_NEAR(sums[1], 1.0, 0.01);
  EXPECT_NEAR(sums[2], 0.0, 0.03);
  EXPECT_NEAR(sums[3], 0.0, 1e-3);
}

TEST(ShadedRays, OneRayTellsNothing) {
  ShadedRays rays;
  EXPECT_TRUE(rays.empty());
  rays.beginLeaf(1, kFace);
  EXPECT_EQ(rays.leaf(0).count, 0U);
  EXPECT_TRUE(rays.weights(rays.leaf(0)).empty());
  rays.clear();
  EXPECT_TRUE(rays.empty());
}

}  // namespace
}  // namespace radiosity::solver
