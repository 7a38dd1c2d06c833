// What a benchmark run found, for people and for programs: Markdown, JSON, one plot a scene. Pure functions.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/benchmark/error_analysis.h"
#include "tests/benchmark/error_plot.h"
#include "tests/benchmark/error_series.h"

namespace radiosity::benchmark {

/// The error whose time is compared: relative RMS of whole, visible texels, of which other bakers say the same.
inline constexpr double kGoal = 0.02;

/// What is drawn from a scene's rows.
struct Summary {
  std::optional<double> slope;       ///< of solver error against solve time, resolved rows
  std::optional<double> late_slope;  ///< the same over the last decade of time: whether it still falls
  /// Solve seconds of the first row at which the size of texels is most of what the lightmap is off by, as it says
  /// itself; none where it never is.
  std::optional<double> texels_limit_from;
  std::optional<double> slope_to_limit;    ///< from when all bounces are in until then, that row included
  std::optional<double> stated_over_true;  ///< geometric mean, resolved rows
  std::optional<TimeToError> to_goal;      ///< solver error, solve seconds
  // The same texels for both, from here on (texels that both can be judged on).
  std::optional<TimeToError> plain, plain_wall;    ///< ours: solve seconds, the whole command
  std::optional<TimeToError> cycles, cycles_wall;  ///< Cycles: rendering alone, the whole program
  std::optional<LinearCost> cycles_cost;
  /// Ours over Cycles, smaller is better; none where Cycles' time is a bound.
  struct Ratio {
    double value = 0.0;
    bool at_most = false;  ///< ours was better from its first row on
  };
  std::optional<Ratio> ratio, ratio_wall;
  /// Where ours never comes down to the goal: the same at the smallest error it reached.
  struct RatioAt {
    double error = 0.0, ratio = 0.0;
  };
  std::optional<RatioAt> ratio_at_best;
};
[[nodiscard]] Summary summarize(const SceneSeries& series);

struct RunDescription {
  std::string mode;  ///< "quick" or "full"
  unsigned cores = 0;
  double load = 0.0;  ///< of the machine when the run began, one minute's mean; more than 0 means others ran too
  std::string processor;
};

[[nodiscard]] nlohmann::json toJson(const RunDescription& run, const std::vector<SceneSeries>& scenes);
[[nodiscard]] std::string toMarkdown(const RunDescription& run, const std::vector<SceneSeries>& scenes);
[[nodiscard]] ErrorPlot plotOf(const SceneSeries& series);

}  // namespace radiosity::benchmark
