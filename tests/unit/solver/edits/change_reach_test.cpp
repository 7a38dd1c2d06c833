// What an edit does to the links of a shooter, estimated by some rays, against a sum over fine grids in both scenes.
#include "server/solver/edits/change_reach.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kTurns = 12;
constexpr double kArea = 1e-3;

class ChangeReachTest : public testing::Test {
 protected:
  static test::Quad plate(const glm::vec3& middle, const glm::vec3& along, const glm::vec3& across) {
    test::Quad quad{middle - 0.5F * (along + across), along, across};
    quad.width = quad.height = 4;
    return quad;
  }

  /// The inside of a cube, what hangs in it and stays, and one plate that is moved.
  void make(const std::vector<test::Quad>& stays, const test::Quad& from, const test::Quad& to) {
    auto quads = test::cubeQuads(12, {}, {});
    quads.insert(quads.end(), stays.begin(), stays.end());
    quads.push_back(from);
    before_ = test::makeQuadScene(quads).patches;
    quads.back() = to;
    after_ = test::makeQuadScene(quads).patches;
    map_ = {};
    for (std::uint32_t s = 0; s < quads.size(); ++s) map_.surface_before.push_back(s);
    map_.moved.assign(quads.size(), false);
    map_.moved.back() = true;
    map_.leaf_altered.assign(after_->leaves.size(), false);
  }

  static scene::Bvh treeOf(const scene::PatchScene& patches) {
    std::vector<scene::Bvh::Triangle> triangles(patches.triangles.size());
    for (std::size_t i = 0; i < patches.indices.size(); ++i)
      triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
    return scene::Bvh(std::move(triangles));
  }

  /// What a small shooter sends to a place, 0 where it is hidden.
  static double arriving(const glm::vec3& origin, const glm::vec3& normal, const glm::dvec3& place,
                         const glm::dvec3& facing, const scene::Bvh& tree) {
    const glm::dvec3 way = place - glm::dvec3(origin);
    const double distance = glm::length(way), rise = glm::dot(way, glm::dvec3(normal));
    if (rise <= 0.0) return 0.0;
    if (tree.nearestHit(glm::dvec3(origin), way / distance, 1e-5, distance * (1.0 - 1e-4))) return 0.0;
    return kArea * rise * std::abs(glm::dot(way, facing)) / (std::numbers::pi * std::pow(distance, 4.0));
  }

  /// Norm of the change over all surfaces; on what is moved, of what it had and of what it has.
  [[nodiscard]] double exact(const glm::vec3& origin, const glm::vec3& normal) const {
    constexpr int kFine = 160;
    const auto tree_before = treeOf(*before_), tree_after = treeOf(*after_);
    double square = 0.0;
    for (std::size_t s = 0; s < after_->surfaces.size(); ++s) {
      for (const auto* patches : {before_.get(), after_.get()}) {
        if (!map_.moved[s] && patches == before_.get()) continue;
        const auto& surface = patches->surfaces[s];
        const auto& frame = patches->triangles[surface.first_triangle];
        const glm::dvec3 u = static_cast<double>(surface.width) * glm::dvec3(frame.du),
                         v = static_cast<double>(surface.height) * glm::dvec3(frame.dv), facing(frame.normal);
        for (int i = 0; i < kFine * kFine; ++i) {
          const glm::dvec3 place =
              glm::dvec3(frame.origin) + (i % kFine + 0.5) / kFine * u + (i / kFine + 0.5) / kFine * v;
          const double then = arriving(origin, normal, place, facing, tree_before);
          const double now = arriving(origin, normal, place, facing, tree_after);
          const double change = map_.moved[s] ? (patches == before_.get() ? then : now) : now - then;
          square += change * change * glm::length(glm::cross(u, v)) / (kFine * kFine);
        }
      }
    }
    return std::sqrt(square);
  }

  [[nodiscard]] double estimate(const glm::vec3& origin, const glm::vec3& normal) const {
    const ChangeReach reach(*before_, *after_, map_);
    double squares = 0.0;
    for (std::uint32_t turn = 0; turn < kTurns; ++turn) squares += std::pow(reach.of(origin, normal, kArea, turn), 2.0);
    return std::sqrt(squares / kTurns);
  }

  std::shared_ptr<const scene::PatchScene> before_, after_;
  scene::PatchMap map_;
};

TEST_F(ChangeReachTest, IsAboutTheNormOfTheChange) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> number(-0.3F, 0.3F);
  int seen = 0;
  for (int i = 0; i < 24; ++i) {
    const glm::vec3 first(number(random), number(random), number(random)), shift(0.5F * number(random), 0.2F, 0.0F);
    const glm::vec3 along(0.2F, 0.0F, number(random)), across(0.0F, 0.2F, number(random));
    make({plate({0.0F, -0.2F, 0.0F}, {0.3F, 0, 0}, {0, 0, 0.3F})}, plate(first, along, across),
         plate(first + shift, along, across));
    const glm::vec3 origin(number(random), -0.5F, number(random)), normal(0, 1, 0);
    const double expected = exact(origin, normal), found = estimate(origin, normal);
    if (expected < 1e-6) continue;
    ++seen;
    EXPECT_LT(found, 1.7 * expected) << i;  // what one opens another may hide again: counted twice
    EXPECT_GT(found, 0.6 * expected) << i;
  }
  EXPECT_GT(seen, 12);
}

TEST_F(ChangeReachTest, IsNothingWhereTheChangeIsHiddenOrBehind) {
  const auto from = plate({0.0F, 0.2F, 0.0F}, {0.1F, 0, 0}, {0, 0, 0.1F}),
             to = plate({0.1F, 0.25F, 0.0F}, {0.1F, 0, 0}, {0, 0, 0.1F});
  make({}, from, to);
  EXPECT_GT(estimate({0.0F, -0.5F, 0.0F}, {0, 1, 0}), 1e-4);
  EXPECT_EQ(estimate({0.0F, 0.3F, 0.0F}, {0, 1, 0}), 0.0);
  make({plate({0.0F, 0.0F, 0.0F}, {0.95F, 0, 0}, {0, 0, 0.95F})}, from, to);
  EXPECT_EQ(estimate({0.0F, -0.5F, 0.0F}, {0, 1, 0}), 0.0) << "a ceiling hides it";
}

TEST_F(ChangeReachTest, FallsWithTheDistanceOfWhatChanged) {
  double last = HUGE_VAL;
  for (const float height : {-0.4F, -0.2F, 0.1F, 0.4F}) {
    make({}, plate({0.0F, height, 0.0F}, {0.1F, 0, 0}, {0, 0, 0.1F}),
         plate({0.12F, height, 0.0F}, {0.1F, 0, 0}, {0, 0, 0.1F}));
    const double reach = estimate({0.05F, -0.499F, 0.0F}, {0, 1, 0});
    EXPECT_LT(reach, last);
    last = reach;
  }
  EXPECT_GT(last, 0.0);
}

}  // namespace
}  // namespace radiosity::solver
