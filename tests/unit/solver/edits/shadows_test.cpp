// What an edit may have cut is found, all of it: against segments and triangles, pair by pair.
#include "server/solver/edits/shadows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <random>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using Triangle = std::array<glm::dvec3, 3>;

/// Whether the way from a to b passes a triangle (Moller and Trumbore 1997).
bool passes(const glm::dvec3& a, const glm::dvec3& b, const Triangle& triangle) {
  const glm::dvec3 way = b - a, e1 = triangle[1] - triangle[0], e2 = triangle[2] - triangle[0];
  const glm::dvec3 p = glm::cross(way, e2);
  const double determinant = glm::dot(e1, p);
  if (std::abs(determinant) < 1e-15) return false;
  const glm::dvec3 s = a - triangle[0], q = glm::cross(s, e1);
  const double u = glm::dot(s, p) / determinant, v = glm::dot(way, q) / determinant;
  const double t = glm::dot(e2, q) / determinant;
  return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < 1.0;
}

class ShadowsTest : public testing::Test {
 protected:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  glm::dvec3 pointIn(const glm::dvec3& low, const glm::dvec3& high) {
    return {uniform(low.x, high.x), uniform(low.y, high.y), uniform(low.z, high.z)};
  }
  glm::dvec3 direction() {
    glm::dvec3 d(0.0);
    while (!(glm::length(d) > 0.1)) d = pointIn(glm::dvec3(-1.0), glm::dvec3(1.0));
    return glm::normalize(d);
  }

  /// The inside of a cube, and a few rectangles in it that lie any way.
  void makeScene() {
    auto quads = test::cubeQuads(12, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F});
    for (int i = 0; i < 4; ++i) {
      const glm::dvec3 along = direction(), across = glm::normalize(glm::cross(along, direction()));
      test::Quad quad{glm::vec3(pointIn(glm::dvec3(-0.3), glm::dvec3(0.3))), glm::vec3(0.15 * along),
                      glm::vec3(0.15 * across)};
      quad.width = 5;
      quad.height = 3;
      quads.push_back(quad);
    }
    scene_ = test::makeQuadScene(quads);
    sides_ = makeSides(*scene_.patches);
    values_ = sides_.back().first_value + sides_.back().leaf_count;
  }

  /// One or two things that came or went: some triangles each, and the box around them.
  GeometryChange makeChange() {
    GeometryChange change;
    triangles_.clear();
    for (int box = 0; box < 1 + static_cast<int>(random_() % 2); ++box) {
      const glm::dvec3 low = pointIn(glm::dvec3(-0.45), glm::dvec3(0.2));
      const glm::dvec3 high = low + pointIn(glm::dvec3(0.01), glm::dvec3(0.25));
      scene::ChangedBox around{glm::vec3(1e30F), glm::vec3(-1e30F)};
      for (int i = 0; i < 6; ++i) {
        triangles_.push_back({pointIn(low, high), pointIn(low, high), pointIn(low, high)});
        for (const auto& corner : triangles_.back()) {
          around.low = glm::min(around.low, glm::vec3(corner));
          around.high = glm::max(around.high, glm::vec3(corner));
        }
      }
      change.boxes.push_back(around);
    }
    change.came = {change.boxes.back()};
    change.altered.resize(values_);
    for (std::size_t v = 0; v < values_; ++v) change.altered[v] = random_() % 50 == 0;
    return change;
  }

  /// Whether the way from the point to some place on a leaf before the point's plane passes a changed triangle.
  bool isCut(const glm::dvec3& from, const glm::dvec3& normal, const Side& side, std::uint32_t leaf) {
    const auto& surface = scene_.patches->surfaces[side.surface];
    const auto& frame = scene_.patches->triangles[surface.first_triangle];
    for (int k = 0; k < 8; ++k) {
      const double x = leaf % side.width + uniform(0.0, 1.0), y = leaf / side.width + uniform(0.0, 1.0);
      const glm::dvec3 to = glm::dvec3(frame.origin) + x * glm::dvec3(frame.du) + y * glm::dvec3(frame.dv);
      if (glm::dot(normal, to - from) <= 0.0) continue;
      for (const auto& triangle : triangles_) {
        if (passes(from, to, triangle)) return true;
      }
    }
    return false;
  }

  std::mt19937 random_{20};
  test::QuadScene scene_;
  std::vector<Side> sides_;
  std::size_t values_ = 0;
  std::vector<Triangle> triangles_;
};

TEST_F(ShadowsTest, EveryWayThatPassesWhatChangedIsFound) {
  constexpr std::uint32_t kResolution = 64;
  std::size_t cut = 0, found_in_all = 0, looked_at = 0;
  for (int round = 0; round < 60; ++round) {
    makeScene();
    const Shadows shadows(*scene_.patches, sides_, makeChange());
    const auto& altered = shadows.change().altered;
    Shadows::Scratch scratch;
    std::vector<LinkColumn::ValueRun> runs;
    for (int view = 0; view < 10; ++view) {
      // Half of them samples of a light: any point of a disc.
      const float radius = view % 2 == 0 ? 0.0F : static_cast<float>(uniform(0.01, 0.1));
      const glm::dvec3 middle = pointIn(glm::dvec3(-0.49), glm::dvec3(0.49)), normal = direction();
      const std::array<glm::vec3, 1> points{glm::vec3(middle)};
      shadows.find(points, glm::vec3(normal), radius, kResolution, scratch, runs);
      std::vector<bool> found(values_, false);
      std::size_t last = 0;
      for (const auto& run : runs) {
        ASSERT_GE(run.first, last);
        last = run.first + run.count;
        ASSERT_LE(last, values_);
        for (std::size_t v = run.first; v < last; ++v) found[v] = true;
      }
      const glm::dvec3 across = glm::normalize(glm::cross(normal, direction()));
      const glm::dvec3 from = middle + uniform(0.0, 1.0) * static_cast<double>(radius) * across;
      for (const auto& side : sides_) {
        for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
          const auto v = side.first_value + leaf;
          ++looked_at;
          found_in_all += found[v] ? 1 : 0;
          if (altered[v]) {
            ASSERT_TRUE(found[v]) << "altered leaf " << v;
          }
          if (!isCut(from, normal, side, leaf)) continue;
          ++cut;
          ASSERT_TRUE(found[v]) << "round " << round << ", view " << view << ", leaf " << v;
        }
      }
    }
  }
  EXPECT_GT(cut, 1'000U) << "enough to tell";
  EXPECT_LT(found_in_all, looked_at / 2) << "a superset, but not all there is";
}

TEST_F(ShadowsTest, OfLeavesAndLampsEveryWayThatIsPassedIsToldFromMostThatAreNot) {
  std::size_t cut = 0, told = 0, asked = 0, told_of_leaves = 0, told_of_ways = 0;
  for (int round = 0; round < 40; ++round) {
    makeScene();
    const Shadows shadows(*scene_.patches, sides_, makeChange());
    const auto placeOn = [&](const Side& side, std::uint32_t leaf) {
      const auto& frame = scene_.patches->triangles[scene_.patches->surfaces[side.surface].first_triangle];
      const double x = leaf % side.width + uniform(0.0, 1.0), y = leaf / side.width + uniform(0.0, 1.0);
      return glm::dvec3(frame.origin) + x * glm::dvec3(frame.du) + y * glm::dvec3(frame.dv);
    };
    const auto isCutBetween = [&](const glm::dvec3& from, const glm::dvec3& to, std::size_t first = 0) {
      return std::ranges::any_of(std::span(triangles_).subspan(first),
                                 [&](const Triangle& triangle) { return passes(from, to, triangle); });
    };
    for (int i = 0; i < 2'000; ++i) {
      const auto &side = sides_[random_() % sides_.size()], &other = sides_[random_() % sides_.size()];
      const auto leaf = static_cast<std::uint32_t>(random_() % side.leaf_count);
      const auto seen = static_cast<std::uint32_t>(random_() % other.leaf_count);
      const double radius = uniform(0.0, 0.05);
      const auto lamp = pointIn(glm::dvec3(-0.49), glm::dvec3(0.49));
      const bool to_leaf = shadows.isPassed(side.first_value + leaf, other.first_value + seen);
      const bool to_lamp = shadows.isPassed(side.first_value + leaf, glm::vec3(lamp), static_cast<float>(radius));
      const bool hides = shadows.mayHide(side.first_value + leaf, other.first_value + seen);
      const auto from = placeOn(side, leaf), to = placeOn(other, seen);
      const bool way_to_leaf = shadows.isPassed(glm::vec3(from), glm::vec3(to));
      const bool way_hides =
          shadows.mayHide(glm::vec3(from), glm::vec3(glm::normalize(to - from)), other.first_value + seen);
      const bool cut_to_leaf = isCutBetween(from, to), hidden = isCutBetween(from, to, triangles_.size() - 6);
      const bool cut_to_lamp = isCutBetween(from, lamp + uniform(0.0, radius) * direction());
      ASSERT_TRUE(to_leaf || !cut_to_leaf) << "round " << round << ", " << i;
      ASSERT_TRUE(hides || !hidden) << "round " << round << ", " << i;
      ASSERT_TRUE(way_to_leaf || !cut_to_leaf) << "round " << round << ", " << i;
      ASSERT_TRUE(way_hides || !hidden) << "round " << round << ", " << i;
      told_of_leaves += to_leaf ? 1U : 0U;
      told_of_ways += way_to_leaf ? 1U : 0U;
      ASSERT_TRUE(to_leaf || !hides) << "what came is a part of what changed";
      ASSERT_TRUE(to_lamp || !cut_to_lamp) << "round " << round << ", " << i;
      asked += 2;
      told += (to_leaf ? 1U : 0U) + (to_lamp ? 1U : 0U);
      cut += (cut_to_leaf ? 1U : 0U) + (cut_to_lamp ? 1U : 0U);
    }
  }
  EXPECT_GT(cut, 1'000U) << "enough to tell";
  EXPECT_LT(told, asked / 2);
  EXPECT_LT(told_of_ways, 3 * told_of_leaves / 4) << "single ways are worth asking for";
}

}  // namespace
}  // namespace radiosity::solver
