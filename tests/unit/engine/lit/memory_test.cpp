// Memory that runs out anywhere in an edit: what the client is told of it is what is on the disk.
#include <gmock/gmock.h>

#include <future>
#include <new>
#include <optional>
#include <set>
#include <vector>

#include "server/geometry/bvh.h"
#include "server/geometry/solid_tree.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/client/temporary_folder.h"
#include "tests/unit/engine/engine_driver.h"
#include "tests/unit/engine/failing_memory.h"

namespace radiosity::test {
namespace {

using engine::PatchOutcome;
using test_scenes::lumpedCube;

/// In a function of which there are two clones, and out of which nothing may be thrown.
TEST(RayMemory, ARayThatMeetsMoreThanThereIsRoomForIsNotTakenForOneThatMeetsLess) {
  std::vector<scene::Bvh::Triangle> sheets;
  for (int i = 1; i <= 40; ++i) {
    const float x = 0.01F * static_cast<float>(i);
    sheets.push_back({glm::vec3(x, 0, 0), {x, 0, 1}, {x, 1, 0}});
  }
  const scene::Bvh tree(std::move(sheets));
  const scene::SolidTree solids(tree);
  std::vector<scene::RayHit> hits;
  std::uint64_t work = 0;
  const auto ask = [&] {
    return scene::SolidTree::endOfSolid(std::array{&solids}, glm::dvec3(0, 0.2, 0.3), {1, 0, 0}, 2.0, hits, work);
  };
  failAllocation(1, sizeof(scene::RayHit), Shortage::kOnce);
  EXPECT_THROW((void)ask(), std::bad_alloc);
  (void)letAllocate();
  EXPECT_FALSE(ask());
  EXPECT_EQ(hits.size(), 40U);
}

/// Smaller ones are not let fail: the JSON library makes some in destructors, which end the program where they throw.
constexpr std::size_t kLeastBytes = 512;

class Memory : public EngineTest {
 protected:
  void SetUp() override { start(); }

  void start() {
    auto options = rayOptions(script_);
    options.checkpoint_bytes = 0;
    ASSERT_NO_FATAL_FAILURE(startOn(folder_.file("state"), std::move(options)));
    watching_ = engine().watch(engine::Quantity::kRadiosity);  // of which an edit of light makes pages at once
  }
  void restart() {
    watching_.reset();
    engine_.reset();
    start();
  }

  struct Outcome {
    std::optional<Result<PatchOutcome>> answer;  ///< nothing: it was dropped
    std::size_t allocations = 0;
  };
  /// The edit, with memory that runs out on the solve thread from its beginning to its answer.
  Outcome patchShortOfMemory(const std::string& edit, std::size_t number, Shortage shortage) {
    Outcome outcome;
    std::promise<void> queued, done;
    const auto all_queued = queued.get_future().share();
    // All that follows is taken from the queue together, so that nothing else comes between.
    engine().history([all_queued](const auto&) { all_queued.wait(); });
    engine().history([=](const auto&) { failAllocation(number, kLeastBytes, shortage); });
    auto request = engine::PatchRequest{.patch = edit, .by = "test"};
    request.receipt = {"an id that is longer than what a string holds without memory " + std::to_string(++requests_),
                       1};
    engine().patch(std::move(request), [&](Result<PatchOutcome> answer) {
      outcome.allocations = letAllocate();
      outcome.answer = std::move(answer);
    });
    engine().history([&](const auto&) {
      (void)letAllocate();
      done.set_value();
    });
    queued.set_value();
    done.get_future().wait();
    return outcome;
  }

  static std::string move(int step) {
    return R"([{"op":"replace","path":"/nodes/0/translation","value":[)" + std::to_string(step) + ",0,0]}]";
  }

  /// Of an edit again and again, each time another allocation fails.
  void expectTruthEverywhere(const std::function<std::string(int)>& edit, Shortage shortage) {
    solve(lumpedCube(0.5));
    int step = 0;
    const auto all = patchShortOfMemory(edit(++step), 0, shortage).allocations;
    ASSERT_GT(all, 10U);
    std::set<bool> made;
    const auto stride = std::max<std::size_t>(1, all / 80);
    for (std::size_t number = 1; number <= all; number += stride) {
      ASSERT_TRUE(reaches(State::kConverged));
      const auto before = status().revision;
      const auto text = sceneText();
      const auto outcome = patchShortOfMemory(edit(++step), number, shortage);
      SCOPED_TRACE("allocation " + std::to_string(number) + " of " + std::to_string(all));
      ASSERT_TRUE(outcome.answer);
      made.insert(outcome.answer->has_value());
      const bool there = status().state != State::kFailed;
      const auto told = *outcome.answer ? before + 1 : before;
      EXPECT_EQ(status().revision, told);
      const auto now = there ? sceneText() : std::string();
      if (*outcome.answer) {
        EXPECT_EQ((*outcome.answer)->revision, told);
        EXPECT_NE(now, text);
      } else {
        EXPECT_EQ((*outcome.answer).error().code, ErrorCode::kTooLarge);
        EXPECT_EQ(now, text);
      }
      // The next edit finds nothing of this one in its way.
      const auto next = there ? patch(edit(++step)) : Result<PatchOutcome>();
      if (there) {
        ASSERT_TRUE(next) << next.error().text();
        EXPECT_EQ(next->revision, told + 1);
      }
      const auto last = there ? sceneText() : std::string();
      restart();
      EXPECT_EQ(status().revision, there ? told + 1 : told) << "what is on the disk is not what was told";
      if (there) {
        EXPECT_EQ(sceneText(), last);
      }
    }
    EXPECT_THAT(made, testing::ElementsAre(false, true)) << "before and after the edit is on the disk";
  }

  TemporaryFolder folder_;
  std::shared_ptr<void> watching_;
  int requests_ = 0;
};

TEST_F(Memory, AnEditOfGeometryIsToldAsItIsKeptWhereverAnAllocationFails) {
  expectTruthEverywhere(move, Shortage::kOnce);
}

TEST_F(Memory, AnEditOfGeometryIsToldAsItIsKeptWhereNothingLargeCanBeHadAnyMore) {
  expectTruthEverywhere(move, Shortage::kFromThenOn);
}

TEST_F(Memory, AnEditOfLightIsToldAsItIsKeptWhereverAnAllocationFails) {
  expectTruthEverywhere([](int step) { return emissionPatch(0, 2.0 + step); }, Shortage::kOnce);
}

}  // namespace
}  // namespace radiosity::test
