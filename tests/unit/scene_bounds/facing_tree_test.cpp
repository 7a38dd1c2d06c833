// Searches by place and direction find what looking at all finds.
#include "server/geometry/facing_tree.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <random>

#include "server/geometry/covering_faces.h"
#include "server/geometry/flat_sides.h"
#include "server/geometry/triangle_hit.h"

namespace radiosity::scene::test {
namespace {

class Random {
 public:
  float operator()(float low, float high) { return std::uniform_real_distribution<float>(low, high)(engine_); }
  glm::vec3 place() { return {(*this)(-0.5F, 0.5F), (*this)(-0.5F, 0.5F), (*this)(-0.5F, 0.5F)}; }
  /// One of few, or about one of them.
  glm::vec3 direction() {
    const auto axis = static_cast<int>((*this)(0.0F, 3.0F));
    glm::vec3 normal(0.0F);
    normal[std::min(axis, 2)] = (*this)(0.0F, 1.0F) < 0.5F ? -1.0F : 1.0F;
    return glm::normalize(normal + (*this)(0.0F, 0.02F) * place());
  }

 private:
  std::mt19937 engine_{7};
};

TEST(FlatSides, HaveCompanyWhereLookingAtAllPairsSaysSo) {
  Random random;
  std::vector<FlatSide> sides;
  for (std::uint32_t i = 0; i < 600; ++i) {
    const auto low = random.place();
    sides.push_back({low, low + 0.1F * (random.place() + 0.5F), random.direction(), i / 2});
  }
  const LieTogether lie_together{2e-5F, 0.9999F};
  const auto found = findCompany(sides, lie_together);
  std::size_t with_company = 0;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    bool expected = false;
    for (const auto& other : sides) expected = expected || lie_together(sides[i], other);
    EXPECT_EQ(found[i], expected) << i;
    with_company += expected ? 1 : 0;
  }
  EXPECT_GT(with_company, 20U);
  EXPECT_LT(with_company, 300U);
}

/// Squares in few planes, in halves: that of least rank is found.
TEST(CoveringFaces, FindTheLeastOfThoseInOnePlace) {
  Random random;
  std::vector<Bvh::Triangle> triangles;
  std::vector<glm::vec3> normals;
  std::vector<std::uint32_t> rank;
  for (std::uint32_t i = 0; i < 400; ++i) {
    const glm::vec3 low(random(-0.5F, 0.2F), 0.1F * static_cast<float>(i % 3), random(-0.5F, 0.2F));
    const glm::vec3 u(0.3F, 0, 0), v(0, 0, 0.3F);
    triangles.push_back({low, low + v, low + u});
    triangles.push_back({low + u, low + v, low + u + v});
    normals.insert(normals.end(), 2, glm::vec3(0, 1, 0));
  }
  for (std::uint32_t t = 0; t < triangles.size(); ++t) rank.push_back((t * 7919) % 800);
  const CoveringFaces faces(triangles, normals, rank);
  const auto counts = [](const RayHit& hit) { return hit.triangle % 5 != 0; };
  std::size_t hits = 0;
  for (int i = 0; i < 500; ++i) {
    const glm::vec3 at(random(-0.5F, 0.5F), 0.1F * static_cast<float>(i % 3), random(-0.5F, 0.5F));
    std::uint64_t work = 0;
    const auto found = faces.find({at, {0, i % 2 == 0 ? 1.0F : -1.0F, 0}, 0.9999F, 1e-6, 500}, counts, work);
    std::uint32_t least = 500;
    RayHit hit{};
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
      if (meetsTriangle(triangles[t], glm::dvec3(at) + glm::dvec3(0, 1e-6, 0), {0, -1, 0}, hit) && hit.t > 0.0 &&
          hit.t < 2e-6 && counts({0.0, t, true}))
        least = std::min(least, rank[t]);
    EXPECT_EQ(found ? rank[found->triangle] : 500, least);
    EXPECT_GT(work, 0U);
    hits += found ? 1 : 0;
  }
  EXPECT_GT(hits, 100U);
}

TEST(CoveringFaces, OfManyInOnePlaceFewAreLookedAt) {
  std::vector<Bvh::Triangle> triangles;
  for (int i = 0; i < 50'000; ++i) {
    triangles.push_back({glm::vec3(0, 0, 0), {0, 0, 1}, {1, 0, 0}});
    triangles.push_back({glm::vec3(1, 0, 0), {0, 0, 1}, {1, 0, 1}});
  }
  std::vector<std::uint32_t> rank(triangles.size());
  for (std::uint32_t t = 0; t < rank.size(); ++t) rank[t] = t;
  const CoveringFaces faces(triangles, std::vector<glm::vec3>(triangles.size(), {0, 1, 0}), rank);
  std::uint64_t work = 0;
  const auto found = faces.find(
      {{0.9F, 0, 0.9F}, {0, 1, 0}, 0.9999F, 1e-6, 100'000}, [](const RayHit&) { return true; }, work);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->triangle, 1U);
  EXPECT_LT(work, 2'000U);
}

}  // namespace
}  // namespace radiosity::scene::test
