// Where rays bring reflected light: after an edit of geometry they see what tracing all of them anew would show.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/gl/geometry_edit_fixture.h"
#include "tests/unit/engine/block_room.h"

namespace radiosity {
namespace {

using nlohmann::json;
using solver::LinkedSolver;
using test::replaced;

class RayEdit : public test::ChairRoom {
 protected:
  struct Half {
    const solver::LeafSights& sights;
    std::size_t half;
  };
  /// Over the same leaves, up to one of which it is known here, and not there, that it lies in part within something:
  /// more rays tell of more such leaves, and the two have different numbers of rays.
  static bool endsAlike(const Half& a, std::uint32_t here, const Half& b, std::uint32_t there) {
    const auto ends = a.sights.endCount();
    const auto first = [ends](const Half& of, std::uint32_t end) {
      return end < ends ? end : of.sights.steps(of.half)[end - ends].by;
    };
    while (true) {
      const auto x = first(a, here), y = first(b, there);
      if (x != y) return false;
      if (x < a.sights.leafCount() && a.sights.isParted(x) != b.sights.isParted(x)) return true;
      if (here < ends || there < ends) return here == there;
      here = a.sights.steps(a.half)[here - ends].next;
      there = b.sights.steps(b.half)[there - ends].next;
    }
  }

  /// How many rays see something else, of those that both have traced.
  static std::size_t unlikeRays(const LinkedSolver& a, const LinkedSolver& b) {
    const auto &x = a.gathered()->sights(), &y = b.gathered()->sights();
    std::size_t differ = 0, compared = 0;
    for (std::uint32_t value = 0; value < x.leafCount(); ++value) {
      const auto both = std::min(x.counts()[value], y.counts()[value]);
      for (std::size_t half = 0; half < 2; ++half) {
        for (std::size_t k = 0; k < both; ++k) {
          const auto here = x.seen(half, value)[k], there = y.seen(half, value)[k];
          if (here == scene::kNone || there == scene::kNone) continue;  // asked for since
          differ += endsAlike({x, half}, here, {y, half}, there) ? 0 : 1;
          ++compared;
        }
      }
    }
    EXPECT_GT(compared, 10'000U);
    return differ;
  }

  /// The same edit twice: with the rays that it left alone, and with all of them traced anew.
  void expectKeptAreTraced(const json& patch) {
    SCOPED_TRACE(patch.dump());
    const auto after = edited(before_, patch);
    const auto first = solved(before_), second = solved(before_);
    ASSERT_NE(first->gathered(), nullptr);
    const auto map = mapOf(before_, after);
    const auto kept = successor(*first, after, map);
    auto all = map;
    std::fill(all.leaf_altered.begin(), all.leaf_altered.end(), true);
    const auto traced = successor(*second, after, all);
    EXPECT_EQ(unlikeRays(*kept, *traced), 0U);
    EXPECT_GT(kept->linkCounters().rays_kept, kept->linkCounters().rays / 4);
    EXPECT_LT(kept->linkCounters().rays_kept, kept->linkCounters().rays);
    EXPECT_EQ(traced->linkCounters().rays_kept, 0U);
    EXPECT_LT(difference(*kept, *first, *after.patches), 10.0) << "finite";
  }
};

TEST_F(RayEdit, OfAChairKeepsTheRaysThatPassNothing) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    settings_.seed = seed;
    expectKeptAreTraced(move_);
  }
}

TEST_F(RayEdit, OfABlockByEveryKindOfMoveAndOfALamp) {
  start(test::blockRoom());
  expectKeptAreTraced(replaced("/nodes/2/translation", {0.75, 0.0, 0.65}));
  expectKeptAreTraced(replaced("/nodes/2/translation", {0.301, 0.0, 0.302}));
  expectKeptAreTraced(replaced("/nodes/2/rotation", {0.0, 0.38268343, 0.0, 0.92387953}));
  expectKeptAreTraced(replaced("/nodes/2/scale", {0.5, 1.2, 0.5}));
  expectKeptAreTraced(replaced("/nodes/1/translation", {0.9, 1.7, 1.0}));  // the lamp
  expectKeptAreTraced(replaced("/nodes/2/extensions/KHR_node_visibility/visible", false));
}

TEST_F(RayEdit, BeforeRaysWereTracedAndInTheMiddleOfThemEndAsAFreshSolveDoes) {
  settings_.target_error = 0.02;
  const auto after = edited(before_, move_);
  const auto fresh = solved(after);
  for (const int steps : {1, 2, 3, 4, 6, 9}) {
    ASSERT_TRUE(transport_->setScene(before_.patches));
    LinkedSolver early(before_.patches, before_.materials, *transport_, settings_);
    for (int i = 0; i < steps; ++i) ASSERT_TRUE(early.step());
    ASSERT_TRUE(transport_->setScene(after.patches));
    LinkedSolver next(after.patches, after.materials, *transport_, settings_, {}, early, mapOf(before_, after));
    finish(next);
    EXPECT_LE(next.error().total, settings_.target_error) << steps;
    EXPECT_LT(difference(next, *fresh, *after.patches), 2.0 * std::hypot(next.error().total, fresh->error().total))
        << steps;
  }
}

TEST_F(RayEdit, EndsWhereAFreshSolveEnds) {
  settings_.target_error = 0.02;
  const auto after = edited(before_, move_);
  const auto before = solved(before_), fresh = solved(after);
  ASSERT_TRUE(transport_->setScene(after.patches));
  LinkedSolver edit(after.patches, after.materials, *transport_, settings_, {}, *before, mapOf(before_, after));
  finish(edit);
  EXPECT_LE(edit.error().total, settings_.target_error);
  EXPECT_LT(difference(edit, *fresh, *after.patches), std::hypot(edit.error().total, fresh->error().total));
}

TEST_F(RayEdit, OfLightAndBackGivesTheSameBits) {
  const auto solver = solved(before_);
  const auto light = solver->irradiance();
  const auto rays = solver->linkCounters().rays;
  auto other = before_.materials;
  other.emission.scale({2.0F, 1.0F, 0.5F});
  other.reflectance.scale(glm::vec3(0.9F));
  solver->setMaterials(other);
  finish(*solver);
  EXPECT_NE(solver->irradiance(), light);
  EXPECT_EQ(solver->linkCounters().rays, rays) << "no more were wanted";
  solver->setMaterials(before_.materials);
  finish(*solver);
  EXPECT_EQ(solver->irradiance(), light);
}

TEST_F(RayEdit, ARoomInTheDarkTakesLightOverTheRaysThatItHas) {
  const auto solver = solved(before_);
  const auto light = solver->irradiance();
  auto dark = before_.materials;
  dark.emission.fill(glm::vec3(0.0F));
  solver->setMaterials(dark);
  finish(*solver);
  EXPECT_EQ(solver->error().total, 0.0);
  const auto none = solver->irradiance();
  EXPECT_TRUE(std::ranges::all_of(none, [](const glm::vec3& h) { return h == glm::vec3(0.0F); }));
  solver->setMaterials(before_.materials);
  finish(*solver);
  EXPECT_EQ(solver->irradiance(), light);
}

}  // namespace
}  // namespace radiosity
