// Rays that are held against a part of a scene's solids: they tell of a place what they tell when held against all.
#include "server/geometry/solid_parts.h"

#include <gtest/gtest.h>

#include <array>
#include <random>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {
namespace {

/// Twelve triangles, facing out.
std::vector<Bvh::Triangle> block(const glm::vec3& low, const glm::vec3& high) {
  std::vector<Bvh::Triangle> triangles;
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool far : {false, true}) {
      const auto corner = [&](bool u, bool v) {
        glm::vec3 at(0.0F);
        at[axis] = far ? high[axis] : low[axis];
        at[(axis + 1) % 3] = u ? high[(axis + 1) % 3] : low[(axis + 1) % 3];
        at[(axis + 2) % 3] = v ? high[(axis + 2) % 3] : low[(axis + 2) % 3];
        return at;
      };
      const auto a = corner(false, false), b = corner(true, false), c = corner(true, true), d = corner(false, true);
      if (far) {
        triangles.insert(triangles.end(), {{a, b, c}, {a, c, d}});
      } else {
        triangles.insert(triangles.end(), {{c, b, a}, {d, c, a}});
      }
    }
  }
  return triangles;
}

class Parts : public testing::Test {
 protected:
  /// Blocks that overlap, here and there.
  void addBlocks(std::uint32_t count) {
    for (std::uint32_t k = 0; k < count; ++k) {
      const glm::vec3 low(uniform(-0.5F, 0.4F), uniform(-0.5F, 0.4F), uniform(-0.5F, 0.4F));
      add(block(low, low + glm::vec3(uniform(0.02F, 0.2F), uniform(0.02F, 0.2F), uniform(0.02F, 0.2F))), 2 * k);
    }
  }
  void add(const std::vector<Bvh::Triangle>& triangles, std::uint32_t part) {
    triangles_.insert(triangles_.end(), triangles.begin(), triangles.end());
    part_of_.insert(part_of_.end(), triangles.size(), part);
  }
  float uniform(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }
  glm::vec3 anywhere() { return {uniform(-0.6F, 0.6F), uniform(-0.6F, 0.6F), uniform(-0.6F, 0.6F)}; }

  std::vector<Bvh::Triangle> triangles_;
  std::vector<std::uint32_t> part_of_;
  std::mt19937 random_{3};
};

TEST_F(Parts, OfClosedBlocksTellWhetherAPlaceLiesInOne) {
  addBlocks(300);
  const SolidParts parts(triangles_, part_of_);
  const Bvh tree(triangles_);
  const SolidTree all(tree);
  SolidParts::Around around;
  std::vector<RayHit> hits;
  std::uint64_t work = 0, work_of_all = 0;
  std::size_t inside = 0, blocks = 0;
  for (int i = 0; i < 3000; ++i) {
    const auto place = anywhere();
    ASSERT_TRUE(parts.find({place, place}, std::nullopt, around));
    const glm::dvec3 direction(anywhere());
    const bool ends = SolidTree::endOfSolid(around.trees, place, direction, 8.0, hits, work).has_value();
    EXPECT_EQ(ends, SolidTree::endOfSolid(std::array{&all}, place, direction, 8.0, hits, work_of_all).has_value());
    EXPECT_FALSE(around.in_hollow);
    inside += ends ? 1 : 0;
    blocks += around.trees.size();
  }
  EXPECT_GT(inside, 100U);
  EXPECT_LT(blocks, 3000U) << "most places lie in none";
  EXPECT_LT(10 * work, work_of_all);
}

TEST_F(Parts, AreThoseWhoseBoundsHoldAPartOfABox) {
  add(block({0, 0, 0}, {0.1F, 0.1F, 0.1F}), 4);
  add(block({0.05F, 0, 0}, {0.2F, 0.1F, 0.1F}), 2 * 3 + SolidParts::kHollow);
  add({{glm::vec3(-0.5F), glm::vec3(0.5F), glm::vec3(0.5F, -0.5F, 0.5F)}}, kNone);
  const SolidParts parts(triangles_, part_of_);
  SolidParts::Around around;
  const auto found = [&](float x0, float x1) {
    EXPECT_TRUE(parts.find({{x0, 0.05F, 0.05F}, {x1, 0.06F, 0.06F}}, std::nullopt, around));
    return std::pair(around.trees.size(), around.in_hollow);
  };
  EXPECT_EQ(found(-0.2F, -0.1F), std::pair(std::size_t{1}, false)) << "what belongs to none counts everywhere";
  EXPECT_EQ(found(-0.2F, 0.01F), std::pair(std::size_t{2}, false));
  EXPECT_EQ(found(0.01F, 0.06F), std::pair(std::size_t{3}, true));
  EXPECT_EQ(found(0.15F, 0.16F), std::pair(std::size_t{2}, true));
}

/// A ray that enters both at once leaves them one after the other.
TEST_F(Parts, ThatBeginInOnePlaneAreEnteredEach) {
  add(block({0, 0, 0}, {0.1F, 0.1F, 0.1F}), 0);
  add(block({0, 0, 0}, {0.2F, 0.1F, 0.1F}), 2);
  const SolidParts parts(triangles_, part_of_);
  SolidParts::Around around;
  ASSERT_TRUE(parts.find({glm::vec3(-0.1F), glm::vec3(0.1F)}, std::nullopt, around));
  ASSERT_EQ(around.trees.size(), 2U);
  std::vector<RayHit> hits;
  std::uint64_t work = 0;
  EXPECT_FALSE(SolidTree::endOfSolid(around.trees, {-0.1, 0.04, 0.06}, {1.0, 0.0, 0.0}, 8.0, hits, work));
  EXPECT_EQ(hits.size(), 4U);
}

/// As many as are told of one by one; of more a ray is held against all there is (Solids).
TEST_F(Parts, HoweverManyHoldAPlaceAllCount) {
  const auto most = static_cast<std::uint32_t>(SolidParts::kMostAround);
  for (const std::uint32_t count : {3U, most, most + 1, 200U}) {
    triangles_.clear();
    part_of_.clear();
    for (std::uint32_t k = 0; k < count; ++k) {
      const glm::vec3 half(0.1F + 0.3F * static_cast<float>((7 * k) % count) / static_cast<float>(count));
      add(block(-half, half), 2 * k);
    }
    const SolidParts parts(triangles_, part_of_);
    SolidParts::Around around;
    ASSERT_EQ(parts.find({glm::vec3(0.0F), glm::vec3(0.0F)}, std::nullopt, around), count <= most);
    if (count > most) continue;
    ASSERT_EQ(around.trees.size(), count);
    std::vector<RayHit> hits;
    std::uint64_t work = 0;
    const auto end = SolidTree::endOfSolid(around.trees, glm::dvec3(0.0), {0.03, 1.0, 0.02}, 8.0, hits, work);
    ASSERT_TRUE(end);
    EXPECT_NEAR(*end, 0.1, 1e-6) << "the smallest, of " << count;
  }
}

TEST_F(Parts, OfACrowdAreAskedOneByOne) {
  for (std::uint32_t k = 0; k < 200; ++k) {
    const glm::vec3 half(0.1F + 0.001F * static_cast<float>(k));
    add(block(-half, half), 2 * k);
  }
  std::size_t asked = 0;
  const auto askAll = [&](const SolidParts& parts, const glm::vec3& place, bool holds, std::uint64_t stop = 1'000'000) {
    std::uint64_t work = 0;
    return parts.anyHolds(place, work, stop, [&](const SolidTree&) { return ++asked, holds; });
  };
  const SolidParts closed(triangles_, part_of_);
  EXPECT_EQ(askAll(closed, glm::vec3(0.0F), true), true);
  EXPECT_EQ(asked, 1U) << "no more once one holds it";
  EXPECT_EQ(askAll(closed, glm::vec3(0.0F), false), false);
  EXPECT_EQ(asked, 201U);
  EXPECT_EQ(askAll(closed, glm::vec3(0.0F, 0.0F, 0.4F), true), false) << "none is there";
  EXPECT_EQ(asked, 201U);
  add(block(glm::vec3(0.0F), glm::vec3(0.1F)), 2 * 200 + SolidParts::kHollow);
  EXPECT_EQ(askAll(SolidParts(triangles_, part_of_), glm::vec3(0.0F), false), std::nullopt);
  EXPECT_EQ(asked, 401U);
  EXPECT_EQ(askAll(closed, glm::vec3(0.0F), false, 20), true) << "what took too much work is as if one held it";
  EXPECT_LT(asked, 430U);
}

/// Long thin blocks that lean every way: within the bounds of most there is mostly nothing of them.
TEST_F(Parts, OfThoseThatLeanFewAreAskedAndNoneIsMissed) {
  const auto uniform = [&] { return Parts::uniform(-0.5F, 0.5F); };
  std::vector<std::array<glm::vec3, 4>> frames;  // middle and axes
  for (std::uint32_t k = 0; k < 300; ++k) {
    const auto one = glm::normalize(glm::vec3(uniform(), uniform(), uniform()));
    const auto other = glm::normalize(glm::cross(one, glm::vec3(uniform(), uniform(), uniform())));
    const auto& frame = frames.emplace_back(
        std::array{0.4F * glm::vec3(uniform(), uniform(), uniform()), one, other, glm::cross(one, other)});
    auto slab = block({-0.2F, -0.2F, -0.002F}, {0.2F, 0.2F, 0.002F});
    for (auto& triangle : slab)
      for (auto& p : triangle) p = frame[0] + p.x * frame[1] + p.y * frame[2] + p.z * frame[3];
    add(slab, 2 * k);
  }
  const SolidParts parts(triangles_, part_of_);
  std::size_t asked = 0, in_bounds = 0;
  for (int i = 0; i < 200; ++i) {
    const auto& near = frames[static_cast<std::size_t>(i)];
    const auto place = i % 2 == 0 ? near[0] : glm::vec3(uniform(), uniform(), uniform());
    std::size_t inside = 0, told = 0;
    for (const auto& frame : frames) {
      const auto way = place - frame[0];
      const bool is_in = std::abs(glm::dot(way, frame[1])) <= 0.2F && std::abs(glm::dot(way, frame[2])) <= 0.2F &&
                         std::abs(glm::dot(way, frame[3])) <= 0.002F;
      const auto half = 0.2F * glm::abs(frame[1]) + 0.2F * glm::abs(frame[2]);
      inside += is_in ? 1 : 0;
      in_bounds += glm::all(glm::lessThanEqual(glm::abs(way), half)) ? 1 : 0;
    }
    std::uint64_t work = 0;
    (void)parts.anyHolds(place, work, ~std::uint64_t{0}, [&](const SolidTree&) { return ++told, false; });
    EXPECT_GE(told, inside);
    asked += told;
  }
  EXPECT_LT(8 * asked, in_bounds);
}

}  // namespace
}  // namespace radiosity::scene
