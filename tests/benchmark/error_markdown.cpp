// The Markdown side of error_report.h.
#include <fmt/format.h>

#include "tests/benchmark/error_report.h"

namespace radiosity::benchmark {
namespace {

std::string percent(double value) { return fmt::format("{:.2f}", 100.0 * value); }

std::string orDash(const std::optional<double>& value) { return value ? fmt::format("{:.2f}", *value) : "-"; }

std::string orDash(const std::optional<TimeToError>& time) {
  if (!time) return "not reached";
  constexpr const char* kMarks[] = {"", "<= ", "~ "};
  return fmt::format("{}{:.2f}", kMarks[static_cast<int>(time->kind)], time->seconds);
}

/// With what it lies between, where that is wider than a tenth of it to either side.
std::string truth(const SolveRow& row) {
  constexpr double kWide = 0.2;
  if (row.resolved()) {
    const auto rms = row.solver.solverRms();
    const auto [low, high] = row.solver.solverRange();
    if (high - low < kWide * rms) return percent(rms);
    return fmt::format("{} ({} to {})", percent(rms), percent(low), percent(high));
  }
  return "< " + percent(SolveRow::kResolved * row.solver.reference_noise);
}

std::string outcome(const SolveRow& row) { return fmt::format("{:.2f}, {}", row.seconds, truth(row)); }

std::string cyclesTime(const SceneSeries& series, const Summary& summary) {
  return series.cycles && !series.cycles->rows.empty() ? orDash(summary.cycles) : "-";
}

std::string orDash(const std::optional<Summary::Ratio>& ratio) {
  if (!ratio) return "-";
  return fmt::format("{}{:.3f}", ratio->at_most ? "<= " : "", ratio->value);
}

std::string ratioText(const Summary& summary) {
  if (!summary.ratio_at_best) return orDash(summary.ratio);
  return fmt::format("{:.2f} at {} %", summary.ratio_at_best->ratio, percent(summary.ratio_at_best->error));
}

std::string slopes(const Summary& summary) {
  const auto from = summary.texels_limit_from ? fmt::format("{:.2f}", *summary.texels_limit_from) : "-";
  return fmt::format("{}, {}; {}", orDash(summary.slope_to_limit), from, orDash(summary.late_slope));
}

const char* const kSurfaceColumns = "RMS % | median % | p95 % | p99 % | mean ratio | leaks";

/// As many leaks as lie where rays leave the scene are leaks for certain; others may lie in solids.
std::string surfaceCells(const accuracy::SurfaceError& error) {
  const auto leaks = error.leaks == 0 ? std::string("0") : fmt::format("{} ({} open)", error.leaks, error.open_leaks);
  return fmt::format("{} | {} | {} | {} | {:.4f} | {}", percent(error.rms()), percent(error.median), percent(error.p95),
                     percent(error.p99), error.mean_ratio, leaks);
}

std::string surfaceTable(const std::vector<SceneSeries>& scenes) {
  std::string out = fmt::format(
      "\nAt the surface, asked for 2 %:\n\n| scene | stated % | {} | points compared | not in these figures, of the "
      "area "
      "|\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---|\n",
      kSurfaceColumns);
  for (const auto& series : scenes) {
    if (!series.unmeasured.empty() || series.rows.empty()) continue;
    const auto& row = series.asked ? *series.asked : series.rows.back();
    out += fmt::format("| {} | {} | {} | {} of {} | {} |\n", series.name, percent(row.stated.total),
                       surfaceCells(row.surface), row.surface.compared, row.surface.points,
                       accuracy::leftOutText(row.surface));
  }
  return out;
}

std::string summaryTable(const std::vector<SceneSeries>& scenes) {
  std::string out =
      "| scene | polygons | patches | s to 2 % | asked for 2 %: s, true % | last row: s, true % | stated / true | "
      "slope to texels' limit, from s; late | Cycles: s to 2 % | ours / Cycles | whole commands "
      "|\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n";
  for (const auto& series : scenes) {
    if (!series.unmeasured.empty()) {
      out += fmt::format("| {} | {} | {} | not judged: {} | | | | | | | |\n", series.name, series.polygons,
                         series.patches, series.unmeasured);
      continue;
    }
    const auto summary = summarize(series);
    const auto& last = series.rows.back();
    out += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", series.name, series.polygons,
                       series.patches, orDash(summary.to_goal), series.asked ? outcome(*series.asked) : "-",
                       outcome(last), orDash(summary.stated_over_true), slopes(summary), cyclesTime(series, summary),
                       ratioText(summary), orDash(summary.ratio_wall));
  }
  return out;
}

std::string solveTable(const SceneSeries& series) {
  std::string out = fmt::format(
      "| solve s | wall s | at the surface: {} | solver RMS % | median % | p99 % | bias % | total RMS % | stated % | "
      "stated / true | discretization stated % | shots "
      "|\n|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
      kSurfaceColumns);
  for (const auto& row : series.rows) {
    if (!row.measured) continue;
    out += fmt::format("| {:.2f} | {:.2f} | {} | {} | {} | {} | {:+.2f} | {} | {} | {} | {} | {} |\n", row.seconds,
                       row.wall_seconds, surfaceCells(row.surface), truth(row), percent(row.solver.median),
                       percent(row.solver.p99), 100.0 * row.solver.bias, percent(row.total.solverRms()),
                       percent(row.stated.total),
                       row.resolved() ? fmt::format("{:.2f}", row.stated.total / row.solver.solverRms()) : "-",
                       percent(row.stated.discretization), row.shots);
  }
  return out;
}

std::string cyclesTable(const SceneSeries& series, const Summary& summary) {
  const auto& cycles = *series.cycles;
  if (cycles.rows.empty()) return fmt::format("\nCycles: no figures ({}).\n", cycles.missing);
  std::string out = fmt::format(
      "\nCycles {} on the same texels, those that both can be judged on ({} of {}):\n\n"
      "| samples | bake s | solver RMS % | median % | p99 % | bias % |\n|---:|---:|---:|---:|---:|---:|\n",
      cycles.version, series.plain_texels, series.reference_texels);
  for (const auto& row : cycles.rows) {
    out += fmt::format("| {} | {:.2f} | {} | {} | {} | {:+.2f} |\n", row.samples, row.seconds,
                       percent(row.plain.solverRms()), percent(row.plain.median), percent(row.plain.p99),
                       100.0 * row.plain.bias);
  }
  if (summary.cycles_cost) {
    out += fmt::format(
        "\nA bake takes {:.2f} s before it renders, the program {:.2f} s before it bakes. To 2 % RMS on these texels: "
        "ours {} s of solving, {} s in all; Cycles {} s of rendering, {} s in all. Ours over Cycles: {}; whole "
        "commands: "
        "{}.\n",
        summary.cycles_cost->setup_seconds, cycles.start_seconds, orDash(summary.plain), orDash(summary.plain_wall),
        orDash(summary.cycles), orDash(summary.cycles_wall), ratioText(summary), orDash(summary.ratio_wall));
  }
  return out;
}

std::string referenceText(const SceneSeries& series) {
  if (series.reference_exact) {
    return fmt::format("Reference: the closed form, exact, at {} texels and {} points.", series.reference_texels,
                       series.reference_points);
  }
  auto text = fmt::format(
      "Reference: path traced, {} texels with noise {} % (subtracted), {} points with {} %; {:.0f} s to trace{}.",
      series.reference_texels, percent(series.texel_noise), series.reference_points, percent(series.point_noise),
      series.reference_seconds, series.reference_from_disk ? ", kept from an earlier run" : "");
  if (!series.reference_note.empty()) text += " It was traced " + series.reference_note + ".";
  text += fmt::format(" Not in the solver error, of the texels' area: cut by an edge {} %, hidden {} %.",
                      percent(series.cut), percent(series.hidden));
  if (series.undecided > 0.0)
    text += fmt::format(
        " {} % of the area is left out of the solver error: models are so open there that it has no answer what of a "
        "texel is inside.",
        percent(series.undecided));
  return text;
}

/// Until when the error is worth lowering without finer texels.
std::string limitText(const Summary& summary) {
  if (!summary.texels_limit_from) return "The size of texels limits nothing yet.";
  return fmt::format(
      "From {:.2f} s on the size of texels is most of what the lightmap is off by, and it says so; until then the "
      "slope "
      "is {}.",
      *summary.texels_limit_from, orDash(summary.slope_to_limit));
}

std::string sceneSection(const SceneSeries& series) {
  std::string out = fmt::format("\n## {}\n\n", series.name);
  if (!series.unmeasured.empty()) return out + "Not judged: " + series.unmeasured + ".\n";
  const auto summary = summarize(series);
  if (!series.sky.empty()) out += fmt::format("Nothing in it shines: lit by a sky (`--sky {}`). ", series.sky);
  out += fmt::format("{} polygons, {} patches; {}. {}\n\n![{} against time]({}.svg)\n\n", series.polygons,
                     series.patches, series.renderer, referenceText(series), series.name, series.name);
  out += solveTable(series);
  if (series.asked) {
    const auto& row = *series.asked;
    out += fmt::format(
        "\nAsked for a stated 2 %: {:.2f} s of solving, {:.2f} s in all; stated {} %, true {} %. At the surface ({}): "
        "{}.\n",
        row.seconds, row.wall_seconds, percent(row.stated.total), truth(row), kSurfaceColumns,
        surfaceCells(row.surface));
    if (const auto text = accuracy::leftOutText(row.surface); !text.empty())
      out += "Not in these figures, of the area: " + text + ".\n";
  }
  out += fmt::format("\nSlope of solver RMS in log-log: {}; over the last decade of time {}. {}\n",
                     orDash(summary.slope), orDash(summary.late_slope), limitText(summary));
  if (series.cycles) out += cyclesTable(series, summary);
  return out;
}

}  // namespace

std::string toMarkdown(const RunDescription& run, const std::vector<SceneSeries>& scenes) {
  std::string out = fmt::format(
      "# Error against time\n\n{} run on {} cores of {}; load when it began {:.1f} (0: the machine was ours alone).\n\n"
      "At the surface: bilinear lookups in the lit file at points spread evenly over all surfaces and both sides, as "
      "an "
      "engine does it, of the mean of red, green and blue, RMS over the mean of the truth. Leaks: lit in the file "
      "above "
      "a twentieth of the mean where the truth is below a hundredth of it; open ones can be seen for certain. Total: "
      "the "
      "same points, dark ones too, over the RMS of the light, as the server states it. Solver error, to find causes: "
      "means of whole texels over their visible part, likewise. All are against the path tracer, RMS with its noise "
      "subtracted (medians, p95 and p99 contain it). Stated: what the server says itself. Each row is a fresh "
      "`radiosity solve`. `<=`: the "
      "first "
      "row was below already; `~`: extrapolated as time^-0.5; `<`: lost in the reference's noise.\n\n",
      run.mode, run.cores, run.processor, run.load);
  out += summaryTable(scenes);
  out += surfaceTable(scenes);
  for (const auto& series : scenes) out += sceneSection(series);
  return out;
}

}  // namespace radiosity::benchmark
