// What the engine remembers of how a solve's error fell: bounded, and even in the logarithm of time.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/engine/publish/error_history.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::ErrorHistory;
using engine::kErrorSamples;

engine::ErrorEstimate errorOf(double total) { return {total, total, 0.6 * total, 0.8 * total, 0.0, 0.01}; }

/// Every gap but those of the input itself against the bound that the mean gap sets, and the ends against the input's.
void expectEven(const std::vector<engine::ErrorSample>& kept, const std::vector<double>& given) {
  ASSERT_LE(kept.size(), kErrorSamples);
  EXPECT_EQ(kept.front().seconds, given.front());
  EXPECT_EQ(kept.back().seconds, given.back());
  const double whole = std::log(given.back() / given.front());
  auto at = given.begin();
  for (std::size_t i = 1; i < kept.size(); ++i) {
    ASSERT_LT(kept[i - 1].seconds, kept[i].seconds);
    const auto before = std::find(at, given.end(), kept[i - 1].seconds);
    const auto next = std::find(before, given.end(), kept[i].seconds);
    ASSERT_NE(next, given.end()) << "a sample that was never given";
    if (next - before > 1) {  // something was left out
      EXPECT_LE(std::log(kept[i].seconds / kept[i - 1].seconds), 2.0 * whole / (kErrorSamples - 1)) << i;
    }
    EXPECT_EQ(kept[i].error.total, 1.0 / kept[i].seconds) << "with another's error";
    at = next;
  }
}

TEST(ErrorHistory, KeepsFewSamplesEvenlyInTheLogarithmOfTime) {
  for (const double step_s : {0.01, 0.1, 3.0}) {
    for (const int count : {1, 299, 300, 301, 1000, 40'000}) {
      ErrorHistory history;
      std::vector<double> given;
      for (int i = 1; i <= count; ++i) {
        given.push_back(0.02 + step_s * i);
        history.add(given.back(), errorOf(1.0 / given.back()));
      }
      EXPECT_EQ(history.samples().size(), std::min<std::size_t>(given.size(), kErrorSamples));
      expectEven(history.samples(), given);
    }
  }
}

/// Of ten decades of time, evenly sampled, each has its share.
TEST(ErrorHistory, KeepsAsMuchOfTheFirstSecondAsOfTheLastDay) {
  ErrorHistory history;
  std::vector<double> given;
  for (double t = 1e-3; t < 1e6; t *= 1.002) {
    given.push_back(t);
    history.add(t, errorOf(1.0 / t));
  }
  expectEven(history.samples(), given);
  for (double decade = 1e-3; decade < 0.9e6; decade *= 10.0) {
    const auto in = std::ranges::count_if(
        history.samples(), [&](const auto& s) { return s.seconds >= decade && s.seconds < 10.0 * decade; });
    EXPECT_GE(in, static_cast<int>(kErrorSamples) / 9 / 2 - 1) << decade;
    EXPECT_LE(in, static_cast<int>(kErrorSamples) / 9 * 2) << decade;
  }
}

TEST(ErrorHistory, IsForgottenWhereTimeRunsBackwardsAndTakesTheNewerOfOneTime) {
  ErrorHistory history;
  history.add(0.0, errorOf(1.0));
  EXPECT_TRUE(history.samples().empty()) << "logarithms have no place for it";
  history.add(1.0, errorOf(0.5));
  history.add(2.0, errorOf(0.3));
  history.add(2.0, errorOf(0.2));
  ASSERT_EQ(history.samples().size(), 2U);
  EXPECT_EQ(history.samples().back().error.total, 0.2);
  history.add(0.0, errorOf(1.0));
  EXPECT_TRUE(history.samples().empty());
  history.add(5.0, errorOf(0.2));
  history.add(0.5, errorOf(0.4));
  ASSERT_EQ(history.samples().size(), 1U);
  EXPECT_EQ(history.samples().front().seconds, 0.5);
}

class SolveHistory : public EngineTest {};

TEST_F(SolveHistory, IsWhatTheListenersWereToldOfThePresentSolve) {
  EXPECT_TRUE(engine().solveHistory().samples.empty());
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(test_scenes::lumpedCube(0.5)));
  ASSERT_TRUE(eventually([&] { return engine().solveHistory().samples.size() >= 3; }));
  ASSERT_TRUE(pause());
  const auto history = engine().solveHistory();
  EXPECT_EQ(history.revision, status().revision);
  std::vector<double> told;
  for (const auto& progress : recorder_->progress()) told.push_back(progress.seconds);
  for (const auto& sample : history.samples) EXPECT_THAT(told, testing::Contains(sample.seconds));
  EXPECT_EQ(history.samples.back().seconds, status().seconds);
  EXPECT_EQ(history.samples.back().error.total, status().error.total);
  ASSERT_TRUE(restart());
  EXPECT_LT(engine().solveHistory().samples.size(), history.samples.size()) << "another solve";
}

}  // namespace
}  // namespace radiosity::test
