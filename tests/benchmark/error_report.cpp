#include "tests/benchmark/error_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace radiosity::benchmark {
namespace {

using nlohmann::json;

template <typename Rows, typename Time, typename Error>
std::vector<ErrorAtTime> curveOf(const Rows& rows, Time time, Error error) {
  std::vector<ErrorAtTime> curve;
  for (const auto& row : rows) curve.push_back({time(row), error(row)});
  return curve;
}

/// Those with a limit of time, and the one that was asked for an error, as they took longer.
std::vector<SolveRow> measuredRows(const SceneSeries& series) {
  std::vector<SolveRow> rows;
  const auto measured = [](const SolveRow& row) { return row.measured; };
  std::copy_if(series.rows.begin(), series.rows.end(), std::back_inserter(rows), measured);
  if (series.asked && series.asked->measured) rows.push_back(*series.asked);
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.seconds < b.seconds; });
  return rows;
}

/// A bake's rendering alone: what it took beyond the set-up that all bakes of the scene share.
double renderSeconds(const CyclesRow& row, const LinearCost& cost) {
  return std::max(row.seconds - cost.setup_seconds, 0.5 * cost.seconds_a_sample * row.samples);
}

std::optional<Summary::Ratio> ratioOf(const std::optional<TimeToError>& ours,
                                      const std::optional<TimeToError>& theirs) {
  if (!ours || !theirs || !(theirs->seconds > 0.0) || theirs->kind == TimeToError::Kind::kAtMost) return {};
  return Summary::Ratio{ours->seconds / theirs->seconds, ours->kind == TimeToError::Kind::kAtMost};
}

void summarizeCycles(const SceneSeries& series, const std::vector<SolveRow>& rows, Summary& summary) {
  constexpr double kMonteCarlo = -0.5;
  const auto plain = [](const auto& row) { return row.plain.solverRms(); };
  summary.plain = timeToError(curveOf(
                                  rows, [](const auto& row) { return row.seconds; }, plain),
                              kGoal);
  summary.plain_wall = timeToError(curveOf(
                                       rows, [](const auto& row) { return row.wall_seconds; }, plain),
                                   kGoal);
  const auto& cycles = *series.cycles;
  std::vector<TimedSamples> timed;
  for (const auto& row : cycles.rows) timed.push_back({static_cast<double>(row.samples), row.seconds});
  summary.cycles_cost = fitLinearCost(timed);
  if (!summary.cycles_cost) return;
  const auto& cost = *summary.cycles_cost;
  const auto rendering = [&](const CyclesRow& row) { return renderSeconds(row, cost); };
  summary.cycles = timeToError(curveOf(cycles.rows, rendering, plain), kGoal, kMonteCarlo);
  if (summary.cycles) {
    summary.cycles_wall = summary.cycles;
    summary.cycles_wall->seconds += cycles.start_seconds + cost.setup_seconds;
  }
  summary.ratio = ratioOf(summary.plain, summary.cycles);
  summary.ratio_wall = ratioOf(summary.plain_wall, summary.cycles_wall);
  if (summary.plain || rows.empty()) return;
  const auto best =
      *std::min_element(rows.begin(), rows.end(), [&](const auto& a, const auto& b) { return plain(a) < plain(b); });
  const auto theirs = timeToError(curveOf(cycles.rows, rendering, plain), plain(best), kMonteCarlo);
  if (const auto ratio = ratioOf(TimeToError{best.seconds}, theirs))
    summary.ratio_at_best = {plain(best), ratio->value};
}

/// A tenth, and a little for limits that were overrun: of rows at 1, 2, 5 and 10 s all belong to the last decade.
constexpr double kLate = 0.09;

json orNull(const std::optional<double>& value) { return value ? json(*value) : json(nullptr); }
json orNull(const std::optional<Summary::Ratio>& ratio) {
  return ratio ? json{{"value", ratio->value}, {"at_most", ratio->at_most}} : json(nullptr);
}

json toJson(const std::optional<TimeToError>& time) {
  if (!time) return nullptr;
  constexpr const char* kKinds[] = {"interpolated", "at most", "extrapolated"};
  return {{"seconds", time->seconds}, {"how", kKinds[static_cast<int>(time->kind)]}};
}

json toJson(const SolveRow& row) {
  json out{{"asked_seconds", row.asked_seconds}, {"exit_code", row.exit_code}, {"wall_seconds", row.wall_seconds}};
  if (!row.measured) return out;
  out["seconds"] = row.seconds;
  out["shots"] = row.shots;
  out["stated"] = {{"total", row.stated.total},
                   {"residual", row.stated.residual},
                   {"sampling", row.stated.sampling},
                   {"variation", row.stated.variation},
                   {"discretization", row.stated.discretization}};
  out["surface"] = accuracy::toJson(row.surface);
  out["solver"] = accuracy::toJson(row.solver);
  out["total"] = accuracy::toJson(row.total);
  out["plain"] = accuracy::toJson(row.plain);
  out["stated_over_true"] = row.resolved() ? json(row.stated.total / row.solver.solverRms()) : json(nullptr);
  return out;
}

json toJson(const CyclesSeries& cycles) {
  json rows = json::array();
  for (const auto& row : cycles.rows) {
    rows.push_back({{"samples", row.samples}, {"seconds", row.seconds}, {"plain", accuracy::toJson(row.plain)}});
  }
  return {{"version", cycles.version},
          {"missing", cycles.missing},
          {"start_seconds", cycles.start_seconds},
          {"rows", rows}};
}

json toJson(const SceneSeries& series) {
  const auto summary = summarize(series);
  json rows = json::array();
  for (const auto& row : series.rows) rows.push_back(toJson(row));
  return {{"scene", series.name},
          {"unmeasured", series.unmeasured},
          {"sky", series.sky},
          {"patches", series.patches},
          {"polygons", series.polygons},
          {"gl_renderer", series.renderer},
          {"reference",
           {{"texels", series.reference_texels},
            {"plain_texels", series.plain_texels},
            {"points", series.reference_points},
            {"texel_noise", series.texel_noise},
            {"undecided_area", series.undecided},
            {"cut_area", series.cut},
            {"hidden_area", series.hidden},
            {"note", series.reference_note},
            {"point_noise", series.point_noise},
            {"seconds", series.reference_seconds},
            {"from_disk", series.reference_from_disk},
            {"exact", series.reference_exact}}},
          {"rows", rows},
          {"asked", series.asked ? toJson(*series.asked) : json(nullptr)},
          {"cycles", series.cycles ? toJson(*series.cycles) : json(nullptr)},
          {"slope", orNull(summary.slope)},
          {"late_slope", orNull(summary.late_slope)},
          {"texels_limit_from", orNull(summary.texels_limit_from)},
          {"slope_to_limit", orNull(summary.slope_to_limit)},
          {"stated_over_true", orNull(summary.stated_over_true)},
          {"to_2_percent",
           {{"solver", toJson(summary.to_goal)},
            {"plain", toJson(summary.plain)},
            {"plain_wall", toJson(summary.plain_wall)},
            {"cycles_render", toJson(summary.cycles)},
            {"cycles_wall", toJson(summary.cycles_wall)},
            {"ratio", orNull(summary.ratio)},
            {"ratio_wall", orNull(summary.ratio_wall)}}},
          {"ratio_at_best", summary.ratio_at_best
                                ? json{{"error", summary.ratio_at_best->error}, {"ratio", summary.ratio_at_best->ratio}}
                                : json(nullptr)}};
}

}  // namespace

Summary summarize(const SceneSeries& series) {
  Summary summary;
  const auto rows = measuredRows(series);
  const auto seconds = [](const SolveRow& row) { return row.seconds; };
  const auto error = [](const SolveRow& row) { return row.solver.solverRms(); };
  auto resolved = rows;
  std::erase_if(resolved, [](const SolveRow& row) { return !row.resolved(); });
  summary.slope = logLogSlope(curveOf(resolved, seconds, error));
  auto late = resolved;
  std::erase_if(late, [&](const SolveRow& row) { return row.seconds < kLate * resolved.back().seconds; });
  summary.late_slope = logLogSlope(curveOf(late, seconds, error));
  const auto limit =
      std::ranges::find_if(rows, [](const SolveRow& row) { return row.stated.discretization > row.stated.total; });
  if (limit != rows.end()) summary.texels_limit_from = limit->seconds;
  auto falling = resolved;
  std::erase_if(falling, [&](const SolveRow& row) {
    const bool lacks_bounces = row.stated.residual > 0.5 * row.stated.total;
    return lacks_bounces || row.seconds > summary.texels_limit_from.value_or(row.seconds);
  });
  summary.slope_to_limit = logLogSlope(curveOf(falling, seconds, error));
  std::vector<double> ratios;
  for (const auto& row : resolved) ratios.push_back(row.stated.total / row.solver.solverRms());
  summary.stated_over_true = geometricMean(ratios);
  summary.to_goal = timeToError(curveOf(rows, seconds, error), kGoal);
  if (series.cycles && !series.cycles->rows.empty()) summarizeCycles(series, rows, summary);
  return summary;
}

json toJson(const RunDescription& run, const std::vector<SceneSeries>& scenes) {
  json all = json::array();
  for (const auto& series : scenes) all.push_back(toJson(series));
  return {{"mode", run.mode}, {"cores", run.cores}, {"load", run.load}, {"processor", run.processor}, {"scenes", all}};
}

ErrorPlot plotOf(const SceneSeries& series) {
  ErrorPlot plot{series.name,
                 {{"solver error", "#1f5fa8", {}, false},
                  {"at the surface", "#b0492c", {}, false},
                  {"stated", "#777777", {}, false}},
                 kGoal};
  for (const auto& row : measuredRows(series)) {
    if (row.resolved()) plot.curves[0].points.emplace_back(row.seconds, row.solver.solverRms());
    plot.curves[1].points.emplace_back(row.seconds, row.surface.rms());
    plot.curves[2].points.emplace_back(row.seconds, row.stated.total);
  }
  const auto summary = summarize(series);
  if (series.cycles && summary.cycles_cost) {
    plot.curves.push_back({"Cycles, rendering", "#7a3fa0", {}, false});
    for (const auto& row : series.cycles->rows) {
      plot.curves.back().points.emplace_back(renderSeconds(row, *summary.cycles_cost), row.plain.solverRms());
    }
  }
  double first = 1e300, last = 0.0;
  for (const auto& curve : plot.curves) {
    for (const auto& [seconds, value] : curve.points) first = std::min(first, seconds), last = std::max(last, seconds);
  }
  if (last > 0.0 && !series.reference_exact) {
    plot.curves.push_back(
        {"noise of reference", "#c0a030", {{first, series.texel_noise}, {last, series.texel_noise}}, true});
  }
  return plot;
}

}  // namespace radiosity::benchmark
