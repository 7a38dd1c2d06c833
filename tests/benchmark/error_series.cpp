#include "tests/benchmark/error_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>

#include "tests/accuracy/solve_run.h"

namespace radiosity::benchmark {
namespace {

using nlohmann::json;

constexpr double kPatience = 30.0;  // seconds of solving for the run that asks for an error
constexpr const char* kDark = "nothing in it shines";
constexpr int kReached = 0, kTimeLimit = 3;  // exit codes of `radiosity solve` that come with an output

/// What the rows of one scene share. Runs of one scene nearly always have the same texels, so the same reference.
struct Judge {
  std::optional<accuracy::LitScene> lit;
  accuracy::Reference reference;

  void prepare(accuracy::LitScene fresh, const SeriesOptions& options, SceneSeries& series) {
    const bool known = lit && accuracy::sameLayout(*lit, fresh);
    lit = std::move(fresh);
    if (known) return;
    auto found = accuracy::findReference(*lit, options.reference, options.reference_folder);
    reference = std::move(found.reference);
    series.reference_from_disk = found.from_disk;
    series.reference_exact = reference.exact;
    series.reference_seconds = reference.seconds;
    series.reference_texels = reference.texels.size();
    series.reference_points = reference.points.size();
    series.cut = reference.cut_area;
    series.hidden = reference.hidden_area;
    series.plain_texels = 0;
    for (const auto& texel : reference.texels) series.plain_texels += texel.plain ? 1U : 0U;
  }
};

StatedError statedOf(const json& report) {
  const auto error = report.value("error", json::object());
  return {error.value("texels", 0.0), error.value("residual", 0.0), error.value("sampling", 0.0),
          error.value("variation", 0.0), error.value("discretization", 0.0)};
}

/// What makes the truth unknown: no light, or something that the reference does not model.
std::string whyNotJudged(const json& report, const accuracy::LitScene& lit) {
  if (!(report.value("energy", json::object()).value("emitted", 0.0) > 0.0)) return kDark;
  std::string text;
  for (const auto& warning : lit.traced().warnings) {
    if (warning.find("not modelled") != std::string::npos) text += (text.empty() ? "" : "; ") + warning;
  }
  return text.empty() ? text : "by the reference, " + text;
}

/// Judged in the scene as it was before, where the reference's reader knows all that is in it.
accuracy::LitScene readJudged(const std::filesystem::path& output, const std::filesystem::path& scene,
                              SceneSeries& series) {
  try {
    series.reference_note.clear();
    return accuracy::readLitScene(output, scene);
  } catch (const std::exception& error) {
    series.reference_note = fmt::format("in the lit file, since the scene could not be read ({})", error.what());
    return accuracy::readLitScene(output);
  }
}

SolveRow solveOnce(const std::filesystem::path& scene, double time, double error, const SeriesOptions& options,
                   Judge& judge, SceneSeries& series) {
  SolveRow row;
  row.asked_seconds = time;
  std::vector<std::string> arguments{"--time-limit", fmt::format("{:g}", time), "--error", fmt::format("{:g}", error)};
  if (!options.chosen_texels) arguments.emplace_back("--means");  // whole texels are compared, as others bake them
  arguments.insert(arguments.end(), options.solve_arguments.begin(), options.solve_arguments.end());
  if (!series.sky.empty()) arguments.insert(arguments.end(), {"--sky", series.sky});
  const auto run =
      accuracy::runSolve(options.client, scene, options.work_folder / series.name, arguments, options.chosen_texels);
  row.exit_code = run.exit_code;
  row.wall_seconds = run.wall_seconds;
  if (run.exit_code != kReached && run.exit_code != kTimeLimit) {
    series.unmeasured =
        run.last_line.empty() ? fmt::format("`radiosity solve` ended with exit code {}", run.exit_code) : run.last_line;
    return row;
  }
  row.seconds = run.report.value("seconds", time);
  row.shots = run.report.value("shots", std::uint64_t{0});
  row.stated = statedOf(run.report);
  series.patches = run.report.value("patches", std::uint64_t{0});
  series.polygons = run.report.value("polygons", std::uint64_t{0});
  series.renderer = run.report.value("gl_renderer", "");
  auto lit = readJudged(run.output, scene, series);
  if (!series.sky.empty()) accuracy::setSky(series.sky, lit);
  if (series.unmeasured = whyNotJudged(run.report, lit); !series.unmeasured.empty()) return row;
  judge.prepare(std::move(lit), options, series);
  const auto measured = accuracy::measure(*judge.lit, judge.reference);
  row.solver = accuracy::measureTexels(judge.lit->pages, judge.reference, accuracy::TexelChoice::kDecided);
  series.undecided = accuracy::undecidedArea(judge.reference);
  row.total = measured.total;
  row.surface = measured.surface;
  row.plain = accuracy::measureTexels(judge.lit->pages, judge.reference, accuracy::TexelChoice::kPlain);
  row.measured = true;
  series.texel_noise = row.solver.reference_noise;
  series.point_noise = row.surface.reference_noise;
  return row;
}

/// False: the truth is unknown, and series.unmeasured says why.
bool solveAll(const std::filesystem::path& scene, const SeriesOptions& options, Judge& judge, SceneSeries& series) {
  for (const double time : options.times) {
    series.rows.push_back(solveOnce(scene, time, options.floor, options, judge, series));
    const auto& row = series.rows.back();
    if (!row.measured) {
      std::fprintf(stderr, "%s: not judged: %s\n", series.name.c_str(), series.unmeasured.c_str());
      return false;
    }
    std::fprintf(
        stderr,
        "%s %g s: at the surface RMS %.2f %%, median %.2f %%, mean ratio %.4f, leaks %zu; solver error %.2f %%, "
        "stated %.2f %%\n",
        series.name.c_str(), time, 100 * row.surface.rms(), 100 * row.surface.median, row.surface.mean_ratio,
        row.surface.leaks, 100 * row.solver.solverRms(), 100 * row.stated.total);
    if (row.exit_code == kReached) break;  // a longer run would stop at the same place
  }
  series.asked = solveOnce(scene, std::max(kPatience, options.times.back()), options.goal, options, judge, series);
  return series.asked->measured;
}

SceneSeries measureUnder(const std::string& sky, const std::filesystem::path& scene, const SeriesOptions& options) {
  SceneSeries series;
  series.name = scene.stem().string();
  series.sky = sky;
  Judge judge;
  try {
    if (!solveAll(scene, options, judge, series)) return series;
    const auto glb = options.work_folder / series.name / (series.name + "-lit.glb");
    if (!options.cycles) return series;
    if (sky.empty()) {
      series.cycles = bakeWithCycles(glb, *judge.lit, judge.reference, options);
    } else {
      series.cycles.emplace().missing = "a sky, which the bake has not, is all its light";
    }
  } catch (const std::exception& error) {  // a scene that the reference's reader refuses; the others go on
    series.unmeasured = error.what();
    std::fprintf(stderr, "%s: not judged: %s\n", series.name.c_str(), error.what());
  }
  return series;
}

}  // namespace

SceneSeries measureScene(const std::filesystem::path& scene, const SeriesOptions& options) {
  auto series = measureUnder("", scene, options);
  return series.unmeasured == kDark && !options.sky.empty() ? measureUnder(options.sky, scene, options) : series;
}

}  // namespace radiosity::benchmark
