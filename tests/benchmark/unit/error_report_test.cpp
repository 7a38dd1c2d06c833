#include "tests/benchmark/error_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace radiosity::benchmark {
namespace {

using testing::HasSubstr;
using testing::Not;

oracle::ErrorMetrics metrics(double rms, double noise) {
  oracle::ErrorMetrics m;
  m.relative_rms = std::hypot(rms, noise);
  m.reference_noise = noise;
  return m;
}

SolveRow rowAt(double seconds, double truth, double stated) {
  SolveRow row;
  row.asked_seconds = row.seconds = seconds;
  row.wall_seconds = seconds + 0.5;
  row.measured = true;
  row.stated.total = stated;
  row.solver = row.total = row.plain = metrics(truth, 0.003);
  row.surface.rms_with_noise = row.surface.p95 = truth;
  row.surface.mean_ratio = 0.97;
  row.surface.points = 200, row.surface.compared = 150, row.surface.dark = 40, row.surface.buried = 10;
  row.surface.leaks = 7, row.surface.open_leaks = 3;
  return row;
}

/// Ours is 0.02 / t; Cycles 0.2 / sqrt(samples) at 10 ms a sample and 1 s of set-up.
SceneSeries series() {
  SceneSeries out;
  out.name = "a<b";
  for (const double t : {0.5, 2.0}) out.rows.push_back(rowAt(t, 0.02 / t, 0.03 / t));
  out.cycles.emplace();
  out.cycles->version = "3.4.1";
  out.cycles->start_seconds = 2.0;
  for (const int samples : {4, 16, 64}) {
    out.cycles->rows.push_back({samples, 1.0 + 0.01 * samples, metrics(0.2 / std::sqrt(samples), 0.003)});
  }
  return out;
}

TEST(Summary, StatedIsComparedWithTheTruthWithoutTheReferencesNoise) {
  const auto summary = summarize(series());
  EXPECT_NEAR(summary.stated_over_true.value(), 1.5, 1e-9);
  EXPECT_NEAR(summary.slope.value(), -1.0, 1e-9);
  EXPECT_NEAR(summary.to_goal->seconds, 1.0, 1e-9);
}

TEST(Summary, ACurveThatHasFlattenedHasAFlatLateSlope) {
  SceneSeries flat;
  for (const double t : {0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0})
    flat.rows.push_back(rowAt(t, std::max(0.02, 0.02 / t), 0.02));
  const auto summary = summarize(flat);
  EXPECT_NEAR(summary.late_slope.value(), 0.0, 1e-9);
  EXPECT_LT(summary.slope.value(), -0.3);
}

TEST(Summary, TheSlopeToTheLimitOfTexelsLeavesOutWhatComesBeforeAllBouncesAndAfterIt) {
  SceneSeries series;
  for (const double t : {0.1, 0.2, 0.5, 1.0, 2.0, 5.0}) {
    const double error = t < 1.5 ? 0.01 / t : 0.009;
    series.rows.push_back(rowAt(t, t < 0.15 ? 0.9 : error, t < 0.15 ? 0.9 : error));
    series.rows.back().stated.residual = t < 0.15 ? 0.8 : 0.0;
    series.rows.back().stated.discretization = 0.012;
  }
  const auto summary = summarize(series);
  EXPECT_EQ(summary.texels_limit_from, 1.0);
  EXPECT_NEAR(summary.slope_to_limit.value(), -1.0, 1e-9);
  EXPECT_GT(summary.late_slope.value(), -0.6);
  for (auto& row : series.rows) row.stated.discretization = 0.0;
  EXPECT_FALSE(summarize(series).texels_limit_from);
  EXPECT_GT(summarize(series).slope_to_limit.value(), -0.6);
}

TEST(Summary, CyclesIsChargedForRenderingAndInAllForItsWholeRun) {
  const auto summary = summarize(series());
  EXPECT_NEAR(summary.cycles_cost->setup_seconds, 1.0, 1e-9);
  EXPECT_NEAR(summary.cycles->seconds, 1.0, 1e-9);  // 100 samples
  EXPECT_EQ(summary.cycles->kind, TimeToError::Kind::kExtrapolated);
  EXPECT_NEAR(summary.cycles_wall->seconds, 4.0, 1e-9);
  EXPECT_NEAR(summary.ratio.value().value, 1.0, 1e-9);
  EXPECT_NEAR(summary.ratio_wall.value().value, summary.plain_wall->seconds / 4.0, 1e-9);
}

TEST(Summary, ABoundGivesARatioThatIsOne) {
  auto bounded = series();
  bounded.rows.erase(bounded.rows.begin());
  const auto summary = summarize(bounded);
  EXPECT_EQ(summary.plain->kind, TimeToError::Kind::kAtMost);
  EXPECT_TRUE(summary.ratio.value().at_most);
  EXPECT_NEAR(summary.ratio.value().value, bounded.rows.front().seconds, 1e-9);
}

TEST(Summary, ARunThatWasAskedForAnErrorIsARowOfTheCurve) {
  auto asked = series();
  asked.asked = asked.rows.front();
  asked.asked->seconds = 0.01;
  asked.asked->plain = metrics(0.015, 0.003);
  const auto summary = summarize(asked);
  EXPECT_TRUE(summary.ratio.value().at_most);
  EXPECT_NEAR(summary.ratio.value().value, 0.01, 1e-9);
}

TEST(Summary, ACurveThatNeverReachesTheGoalIsComparedAtItsBest) {
  auto high = series();
  for (auto& row : high.rows) row.plain = metrics(0.1 / std::sqrt(row.seconds), 0.003);
  const auto summary = summarize(high);
  EXPECT_FALSE(summary.ratio);
  ASSERT_TRUE(summary.ratio_at_best);
  EXPECT_NEAR(summary.ratio_at_best->error, 0.1 / std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(summary.ratio_at_best->ratio, 2.0 / 0.08, 1e-6);  // Cycles is there with 8 samples
}

TEST(Summary, RowsLostInTheReferencesNoiseDecideNothing) {
  auto lost = series();
  lost.rows.push_back(rowAt(8.0, 0.0001, 0.01));
  EXPECT_FALSE(lost.rows.back().resolved());
  EXPECT_NEAR(summarize(lost).stated_over_true.value(), 1.5, 1e-9);
}

TEST(Report, JsonHoldsRowsAndSummaryAndMarkdownHasATableRow) {
  const RunDescription run{"Quick", 2, 0.5, "a processor"};
  const auto json = toJson(run, {series()});
  EXPECT_EQ(json["scenes"][0]["rows"].size(), 2U);
  EXPECT_NEAR(json["scenes"][0]["rows"][1]["stated_over_true"].get<double>(), 1.5, 1e-9);
  EXPECT_EQ(json["scenes"][0]["to_2_percent"]["cycles_render"]["how"], "extrapolated");
  const auto text = toMarkdown(run, {series()});
  EXPECT_THAT(text, HasSubstr("| a<b | 0 | 0 | 1.00 |"));
  EXPECT_THAT(text, HasSubstr("Cycles 3.4.1"));
  EXPECT_EQ(json["scenes"][0]["rows"][1]["surface"]["leaks"], 7);
  EXPECT_NEAR(json["scenes"][0]["rows"][1]["surface"]["p95"].get<double>(), 0.01, 1e-9);
  EXPECT_THAT(text,
              HasSubstr("| a<b | 1.50 | 1.00 | 0.00 | 1.00 | 0.00 | 0.9700 | 7 (3 open) | 150 of 200 | dark in truth "
                        "20.0 %, buried in solids 5.0 % |"));
  const auto bars = [&text](const char* from) {
    const auto line = text.substr(text.find(from), text.find('\n', text.find(from)) - text.find(from));
    return std::count(line.begin(), line.end(), '|');
  };
  EXPECT_EQ(bars("| scene |"), bars("| a<b |"));
  EXPECT_EQ(bars("| solve s |"), bars("| 0.50 |"));
}

TEST(Report, ASceneWithoutTruthSaysWhyAndHasNoFigures) {
  SceneSeries dark;
  dark.name = "dark";
  dark.unmeasured = "nothing in it shines";
  const auto text = toMarkdown({}, {dark});
  EXPECT_THAT(text, HasSubstr("not judged: nothing in it shines"));
  EXPECT_THAT(text, Not(HasSubstr("dark.svg")));
}

TEST(Plot, LeavesOutWhatIsLostInNoiseAndEscapesNames) {
  auto lost = series();
  lost.rows.push_back(rowAt(8.0, 0.0001, 0.01));
  const auto plot = plotOf(lost);
  EXPECT_EQ(plot.curves[0].points.size(), 2U);
  EXPECT_EQ(plot.curves[2].points.size(), 3U);
  const auto svg = toSvg(plot);
  EXPECT_THAT(svg, HasSubstr("a&lt;b"));
  EXPECT_THAT(svg, HasSubstr("Cycles"));
}

TEST(Plot, WithoutPointsIsStillADrawing) {
  const auto svg = toSvg({"empty", {{"none", "#000", {}, false}}, 0.02});
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace radiosity::benchmark
