#include "server/solver/reflected/leaf_sights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kDark;
using test::kGrey;
using test::makeQuadScene;

struct Sights {
  explicit Sights(const std::vector<test::Quad>& quads, std::uint64_t seed = 1) : Sights(makeQuadScene(quads), seed) {}
  explicit Sights(test::QuadScene made, std::uint64_t seed = 1)
      : scene(std::move(made)), sides(makeSides(*scene.patches)), sights(*scene.patches, sides, seed) {}

  void trace(std::uint16_t count) {
    sights.ask(std::vector<std::uint16_t>(sights.leafCount(), count));
    ASSERT_TRUE(sights.trace(HUGE_VAL));
  }
  /// Form factor from all of one side to all of another; both halves.
  [[nodiscard]] double formFactor(std::uint32_t from, std::uint32_t to) const {
    double seen = 0.0, all = 0.0;
    for (auto v = sides[from].first_value; v < sides[from].first_value + sides[from].leaf_count; ++v) {
      for (std::size_t half = 0; half < 2; ++half) {
        for (const auto end : sights.seen(half, v)) {
          // Of those that go on: the first.
          const auto first = end < sights.endCount() ? end : sights.steps(half)[end - sights.endCount()].by;
          seen += first < sights.leafCount() && sights.sideOf(first) == to ? 1.0 : 0.0;
          all += 1.0;
        }
      }
    }
    return seen / all;
  }

  test::QuadScene scene;
  std::vector<Side> sides;
  LeafSights sights;
};

TEST(LeafSights, OfACubeAreItsFormFactors) {
  Sights cube(cubeQuads(4, kDark, kGrey));
  cube.trace(1024);
  // 32,768 rays of each side; Sobol's points are better than that many by chance, whose error would be 0.0022.
  EXPECT_NEAR(cube.formFactor(0, 1), 0.1998248957, 0.0015);
  for (const std::uint32_t beside : {2U, 3U, 4U, 5U}) EXPECT_NEAR(cube.formFactor(0, beside), 0.2000437761, 0.0015);
  EXPECT_EQ(cube.formFactor(0, 0), 0.0);
}

TEST(LeafSights, OfAnOpenCubeEscapeWhereAWallIsMissing) {
  auto quads = cubeQuads(4, kDark, kGrey);
  quads.erase(quads.begin() + 1);
  Sights open(quads);
  open.trace(1024);
  double escaped = 0.0;
  for (auto v = open.sides[0].first_value; v < open.sides[0].first_value + open.sides[0].leaf_count; ++v) {
    for (const auto end : open.sights.seen(0, v)) escaped += open.sights.isSkyAbove(end) ? 1.0 : 0.0;
  }
  EXPECT_NEAR(escaped / (16 * 1024), 0.1998248957, 0.003);
}

// More of them than a ray keeps in mind at a time.
TEST(LeafSights, ThroughAnyNumberOfSheetsAreWhatTheirOpacityLeaves) {
  constexpr double kOpacity = 2.0 / 255.0;
  for (const int count : {60, 66, 140}) {
    auto quads = cubeQuads(4, kDark, kGrey);
    for (int i = 0; i < count; ++i) {
      const float height = -0.3F + 0.6F * static_cast<float>(i) / static_cast<float>(count);
      quads.push_back({{-0.5F, height, -0.5F}, {0, 0, 1}, {1, 0, 0}, 1, 1, {}, glm::vec3(0.5F)});
    }
    auto made = makeQuadScene(quads);
    made.patches->opacity.assign(1, 2);
    for (std::size_t s = 6; s < quads.size(); ++s) {
      made.patches->surfaces[s].see_through = true;
      made.patches->surfaces[s].first_opacity = 0;
    }
    Sights sheets(std::move(made));
    sheets.trace(128);
    // Of 4,096 rays some 0.1 get through, by chance: three times 0.005.
    EXPECT_NEAR(sheets.formFactor(1, 0), 0.1998248957 * std::pow(1.0 - kOpacity, count), 0.015) << count;
  }
}

TEST(LeafSights, OfBacksAreAbsorbed) {
  auto quads = cubeQuads(2, kDark, kGrey);
  std::swap(quads[1].du, quads[1].dv);  // the ceiling looks up
  Sights cube(quads);
  cube.trace(256);
  EXPECT_EQ(cube.formFactor(0, 1), 0.0);
  double absorbed = 0.0;
  for (const auto end : cube.sights.seen(0, 0)) absorbed += cube.sights.isAbsorbed(end) ? 1.0 : 0.0;
  EXPECT_GT(absorbed, 20.0);
}

bool same(const LeafSights& a, const LeafSights& b) {
  for (std::uint32_t v = 0; v < a.leafCount(); ++v) {
    for (std::size_t half = 0; half < 2; ++half) {
      if (!std::ranges::equal(a.seen(half, v), b.seen(half, v))) return false;
    }
  }
  return true;
}

TEST(LeafSights, AreTheSameHoweverTheyWereAskedForAndCut) {
  Sights once(cubeQuads(8, kDark, kGrey)), often(cubeQuads(8, kDark, kGrey)), other(cubeQuads(8, kDark, kGrey), 2);
  once.trace(32);
  for (const std::uint16_t count : {4, 8, 32}) {
    often.sights.ask(std::vector<std::uint16_t>(often.sights.leafCount(), count));
    int slices = 1;
    while (!often.sights.trace(0.0)) ++slices;  // a slice at a time
    EXPECT_GT(slices, 1);
  }
  EXPECT_TRUE(same(once.sights, often.sights));
  EXPECT_EQ(once.sights.traced(), often.sights.traced());
  EXPECT_EQ(once.sights.traced(), 2U * 32 * 6 * 64);
  other.trace(32);
  EXPECT_FALSE(same(once.sights, other.sights));
  EXPECT_FALSE(std::ranges::equal(once.sights.seen(0, 0), once.sights.seen(1, 0))) << "halves are independent";
}

TEST(LeafSights, ThatAreGivenUpLeaveThoseThatWere) {
  // More leaves than a slice traces.
  Sights cube(cubeQuads(32, kDark, kGrey)), few(cubeQuads(32, kDark, kGrey));
  few.trace(2);
  cube.trace(2);
  cube.sights.ask(std::vector<std::uint16_t>(cube.sights.leafCount(), 16));
  const auto before = cube.sights.traced();
  while (cube.sights.traced() < before + 2U * 14 * 2100)
    ASSERT_FALSE(cube.sights.trace(0.0));  // all of a slice, some of the next
  cube.sights.giveUp();
  ASSERT_TRUE(cube.sights.trace(HUGE_VAL));
  EXPECT_EQ(cube.sights.counts().front(), 16U) << "it was its turn";
  EXPECT_EQ(cube.sights.counts().back(), 2U);
  EXPECT_TRUE(std::ranges::equal(cube.sights.seen(0, 6 * 1024 - 1), few.sights.seen(0, 6 * 1024 - 1)));
}

TEST(LeafSights, OfLeavesWithoutAreaAreNone) {
  auto made = makeQuadScene(cubeQuads(2, kDark, kGrey));
  made.patches->node_area[0] = 0.0F;
  const auto sides = makeSides(*made.patches);
  LeafSights sights(*made.patches, sides, 1);
  sights.ask(std::vector<std::uint16_t>(sights.leafCount(), 64));
  ASSERT_TRUE(sights.trace(HUGE_VAL));
  EXPECT_EQ(sights.counts()[0], 0U);
  EXPECT_EQ(sights.counts()[1], 64U);
  bool seen = false, neighbour = false;
  for (const auto end : sights.seen(0, sides[1].first_value)) {
    seen = seen || end == 0;
    neighbour = neighbour || (end < sights.leafCount() && sights.sideOf(end) == 0);
  }
  EXPECT_FALSE(seen);
  EXPECT_TRUE(neighbour) << "who took it is seen in its place";
}

}  // namespace
}  // namespace radiosity::solver
