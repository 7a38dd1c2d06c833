#include "client/cli/progress_line.h"

#include <gmock/gmock.h>

#include <limits>
#include <utility>

namespace radiosity::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(ProgressFraction, isLogarithmicBetweenOneAndTheTarget) {
  EXPECT_DOUBLE_EQ(progressFraction(1.0, 0.01), 0.0);
  EXPECT_DOUBLE_EQ(progressFraction(0.1, 0.01), 0.5);
  EXPECT_DOUBLE_EQ(progressFraction(0.01, 0.01), 1.0);
}

TEST(ProgressFraction, staysInRangeForAnyInput) {
  EXPECT_EQ(progressFraction(5.0, 0.01), 0.0);
  EXPECT_EQ(progressFraction(0.0, 0.01), 1.0);
  EXPECT_EQ(progressFraction(kNan, 0.01), 0.0);
  EXPECT_EQ(progressFraction(0.5, 0.0), 0.0);
  EXPECT_EQ(progressFraction(0.5, 1.0), 1.0);
}

TEST(BytesText, hasAUnitThatFits) {
  EXPECT_EQ(bytesText(0), "0 B");
  EXPECT_EQ(bytesText(812), "812 B");
  EXPECT_EQ(bytesText(4242), "4.2 kB");
  EXPECT_EQ(bytesText(9'960), "10 kB");
  EXPECT_EQ(bytesText(37'400), "37 kB");
  EXPECT_EQ(bytesText(999'600), "1.0 MB");
  EXPECT_EQ(bytesText(1'500'000), "1.5 MB");
  EXPECT_EQ(bytesText(23'000'000'000), "23 GB");
}

TEST(TransferText, saysHowMuchOfWhatWhereThatIsKnown) {
  EXPECT_EQ(transferText(37'400, 1'500'000), "37 kB of 1.5 MB, 2 %");
  EXPECT_EQ(transferText(812, 0), "812 B");
}

TEST(ProgressLine, showsErrorTargetRateAndTimeLeft) {
  const ProgressView view{.state = "solving",
                          .error = 0.1,
                          .target_error = 0.01,
                          .shots = 12345,
                          .shots_per_second = 2300.7,
                          .seconds = 3.21,
                          .seconds_left = 65.0};
  const auto line = progressLine(view, 200);
  EXPECT_EQ(line,
            "solving [############............] error 10 % of 1 %  12,345 shots, 2,300/s  3.2 s, 1 min 05 s left");
}

TEST(ProgressLine, hasPartsOfTheErrorWhereAsked) {
  const ProgressView view{.state = "solving", .residual = 0.001, .sampling = 0.02, .show_parts = true};
  EXPECT_THAT(progressLine(view, 300), HasSubstr("residual 0.1 %, sampling 2 %"));
}

TEST(ProgressLine, saysNoTimeLeftOnceThere) {
  const ProgressView view{.state = "converged", .error = 0.01, .target_error = 0.02, .seconds_left = 4.0};
  EXPECT_THAT(progressLine(view, 200), Not(HasSubstr("left")));
}

TEST(ProgressLine, statesNoErrorWhereNoLightArrives) {
  const ProgressView view{
      .state = "converged", .error = 0.0, .show_parts = true, .unlit = "no light arrives: \x1b[31m"};
  EXPECT_THAT(progressLine(view, 300), HasSubstr("converged [########################] no light arrives:  [31m"));
  EXPECT_THAT(progressLine(view, 300), Not(HasSubstr("error")));
}

TEST(ProgressLine, tellsOfALoadHowMuchOfItIsDone) {
  ProgressView view{.state = "loading", .error = 0.02, .load_fraction = 0.5};
  EXPECT_EQ(progressLine(view, 300), "loading [############............] 50 %");
  EXPECT_EQ(progressLine(view, 40), "loading 50 %");
  for (const auto& [fraction, text] : {std::pair(7.0, "100 %"), std::pair(-1.0, " 0 %"), std::pair(kNan, " 0 %")}) {
    view.load_fraction = fraction;
    EXPECT_THAT(progressLine(view, 300), HasSubstr(text));
  }
}

TEST(ProgressLine, takesAnyRateThatAServerMayState) {
  for (const auto& [rate, text] :
       {std::pair(1e300, " 1,000,000,000,000,000,000/s"), std::pair(-1.0, " 0/s"), std::pair(kNan, " 0/s")}) {
    EXPECT_THAT(progressLine({.state = "solving", .shots_per_second = rate}, 300), HasSubstr(text));
  }
}

TEST(ProgressLine, neverExceedsTheTerminal) {
  const ProgressView solving{.state = "solving", .seconds_left = 1.0, .show_parts = true};
  const ProgressView loading{.state = "loading", .load_fraction = 0.5};
  for (int columns = 1; columns < 200; ++columns)
    for (const auto& view : {solving, loading})
      EXPECT_LE(progressLine(view, columns).size(), static_cast<std::size_t>(columns));
}

TEST(Text, ofDurations) {
  EXPECT_EQ(durationText(0.0), "0.0 s");
  EXPECT_EQ(durationText(9.94), "9.9 s");
  EXPECT_EQ(durationText(9.96), "10 s");
  EXPECT_EQ(durationText(59.6), "1 min 00 s");
  EXPECT_EQ(durationText(3605.0), "1 h 00 min");
  EXPECT_EQ(durationText(kNan), "?");
  EXPECT_EQ(durationText(-1.0), "?");
}

TEST(Text, ofCountsAndPercentages) {
  EXPECT_EQ(countText(0), "0");
  EXPECT_EQ(countText(999), "999");
  EXPECT_EQ(countText(1000), "1,000");
  EXPECT_EQ(countText(1234567), "1,234,567");
  EXPECT_EQ(countText(std::numeric_limits<std::uint64_t>::max()), "18,446,744,073,709,551,615");
  EXPECT_EQ(percentText(0.0198), "1.98 %");
  EXPECT_EQ(percentText(kNan), "?");
}

}  // namespace
}  // namespace radiosity::cli
