#include "common/task.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

#include "common/parallel.h"

namespace radiosity {
namespace {

TEST(Task, WithoutOneAnInterruptionPointDoesNothing) {
  EXPECT_EQ(currentTask(), nullptr);
  EXPECT_NO_THROW(interruptionPoint());
  EXPECT_NO_THROW(interruptionPoint(1, 2));
}

TEST(Task, InterruptsTheThreadThatHasItOnceItIsCancelled) {
  Task task;
  {
    const TaskScope scope(&task);
    EXPECT_NO_THROW(interruptionPoint());
    task.cancel();
    EXPECT_THROW(interruptionPoint(), Interrupted);
    std::thread([] { EXPECT_NO_THROW(interruptionPoint()); }).join();
  }
  EXPECT_NO_THROW(interruptionPoint());
}

TEST(Task, AScopeWithinAnotherGivesItBack) {
  Task outer, inner;
  const TaskScope scope(&outer);
  {
    const TaskScope none(nullptr);
    EXPECT_EQ(currentTask(), nullptr);
    const TaskScope other(&inner);
    EXPECT_EQ(currentTask(), &inner);
  }
  EXPECT_EQ(currentTask(), &outer);
}

TEST(Task, IsThatOfAllWhoTakeShares) {
  Task task;
  const TaskScope scope(&task);
  std::vector<const Task*> seen(64, nullptr);
  inTurns(seen.size(), [&](std::size_t part) { seen[part] = currentTask(); });
  EXPECT_TRUE(std::ranges::all_of(seen, [&](const Task* of) { return of == &task; }));
}

TEST(Task, EndsALoopOverSharesBeforeItsNextPart) {
  Task task;
  const TaskScope scope(&task);
  std::atomic<std::size_t> done{0};
  const auto work = [&](std::size_t) {
    ++done;
    task.cancel();
  };
  EXPECT_THROW(inTurns(100'000, work), Interrupted);
  EXPECT_LE(done, mostShares()) << "each thread ends with what it was at";
}

TEST(Task, EndsASortThatIsInterruptible) {
  Task task;
  const TaskScope scope(&task);
  std::vector<int> numbers{3, 1, 2};
  std::ranges::sort(numbers, interruptible(std::less<>()));
  EXPECT_EQ(numbers, (std::vector<int>{1, 2, 3}));
  task.cancel();
  EXPECT_THROW(std::ranges::sort(numbers, interruptible(std::less<>())), Interrupted);
}

TEST(Task, ItsFractionIsOfAllStagesAndNeverFalls) {
  Task task;
  EXPECT_EQ(task.fraction(), 0.0);
  task.beginStage(0.25);
  task.tellProgress(0.5);
  EXPECT_DOUBLE_EQ(task.fraction(), 0.125);
  task.beginStage(1.0);
  EXPECT_DOUBLE_EQ(task.fraction(), 0.25);
  task.tellProgress(0.5);
  task.tellProgress(0.1);
  EXPECT_DOUBLE_EQ(task.fraction(), 0.625);
  task.tellProgress(7.0);
  EXPECT_DOUBLE_EQ(task.fraction(), 1.0);
}

TEST(Task, TellsOfProgressAtOnceAndThenTenTimesASecondAtMost) {
  std::atomic<int> told{0};
  Task task([&] { ++told; });
  task.beginStage(1.0);
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 1; i <= 1000; ++i) task.tellProgress(i / 1000.0);
  const auto tenths = (std::chrono::steady_clock::now() - begin) / std::chrono::milliseconds(100);
  EXPECT_GE(told, 1);
  EXPECT_LE(told, 1 + tenths);
}

}  // namespace
}  // namespace radiosity
