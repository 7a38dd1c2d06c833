// error_time SCENE...: how the error of `radiosity solve` falls with time, against an independent path tracer. Writes
// error_time.json, error_time.md and a plot of each scene.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/accuracy/compare.h"
#include "tests/accuracy/solve_run.h"
#include "tests/benchmark/error_plot.h"

namespace {

using namespace radiosity;
using nlohmann::json;

#ifndef RADIOSITY_CLIENT
#define RADIOSITY_CLIENT "radiosity"
#endif

struct Options {
  std::vector<std::string> scenes;
  std::vector<double> times{0.1, 0.2, 0.5, 1, 2, 5, 10};
  std::string client = RADIOSITY_CLIENT;
  std::filesystem::path folder = "error_time";
  std::vector<std::string> solve_arguments;
  accuracy::ReferenceOptions reference{.texel_samples = 2048, .point_samples = 2048};
};

/// Keeps the last reference: runs of one scene nearly always have the same texels.
class ReferenceCache {
 public:
  const accuracy::Reference& get(const accuracy::LitScene& lit, const accuracy::ReferenceOptions& options) {
    if (!made_for_ || !accuracy::sameLayout(*made_for_, lit)) {
      reference_ = accuracy::makeReference(lit, options);
      made_for_ = lit;
    }
    return reference_;
  }

 private:
  std::optional<accuracy::LitScene> made_for_;
  accuracy::Reference reference_;
};

json runOnce(const Options& options, const std::filesystem::path& scene, double time, ReferenceCache& references) {
  char limit[32];
  std::snprintf(limit, sizeof limit, "%g", time);
  std::vector<std::string> arguments{"--time-limit", limit, "--error", "0.000001"};
  arguments.insert(arguments.end(), options.solve_arguments.begin(), options.solve_arguments.end());
  const auto run = accuracy::runSolve(options.client, scene, options.folder / scene.stem() / limit, arguments);
  json row{{"asked_seconds", time}, {"exit_code", run.exit_code}, {"wall_seconds", run.wall_seconds}};
  if (run.exit_code != 0 && run.exit_code != 3) return row;
  const auto lit = accuracy::readLitScene(run.output);
  const auto measured = accuracy::measure(lit, references.get(lit, options.reference));
  row["seconds"] = run.report.value("seconds", time);
  row["solver"] = accuracy::toJson(measured.solver);
  row["total"] = accuracy::toJson(measured.total);
  row["stated"] = run.report.value("error", json::object());
  row["shots"] = run.report.value("shots", 0);
  row["patches"] = run.report.value("patches", 0);
  row["gl_renderer"] = run.report.value("gl_renderer", "");
  return row;
}

bool measured(const json& row) { return row.contains("solver"); }

/// Least squares of log error against log time.
double slope(const json& rows) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& row : rows) {
    if (!measured(row)) continue;
    const double t = std::log(row["seconds"].get<double>());
    const double e = std::log(row["solver"]["relative_rms"].get<double>() + 1e-12);
    n += 1, x += t, y += e, xx += t * t, xy += t * e;
  }
  return n < 2 ? 0.0 : (n * xy - x * y) / (n * xx - x * x);
}

void writeMarkdown(std::FILE* out, const json& scene) {
  std::fprintf(out, "\n### %s\n\n", scene["scene"].get<std::string>().c_str());
  std::fprintf(out, "| solve s | solver RMS %% | total RMS %% | median %% | p99 %% | bias %% | stated %% | shots |\n");
  std::fprintf(out, "|---:|---:|---:|---:|---:|---:|---:|---:|\n");
  for (const auto& row : scene["runs"]) {
    if (!measured(row)) {
      std::fprintf(out, "| %g (asked) | failed: exit code %d | | | | | | |\n", row["asked_seconds"].get<double>(),
                   row["exit_code"].get<int>());
      continue;
    }
    const auto percent = [](const json& group, const char* name) { return 100.0 * group.value(name, 0.0); };
    const auto& s = row["solver"];
    std::fprintf(out, "| %.2f | %.2f | %.2f | %.2f | %.2f | %+.2f | %.2f | %ld |\n", row["seconds"].get<double>(),
                 percent(s, "relative_rms"), percent(row["total"], "relative_rms"), percent(s, "median"),
                 percent(s, "p99"), percent(s, "bias"), percent(row["stated"], "total"), row["shots"].get<long>());
  }
  std::fprintf(out, "\nSlope of solver RMS in log-log: %.2f. Reference noise: %.2f %% a texel.\n",
               scene["slope"].get<double>(), 100.0 * scene["reference_noise"].get<double>());
}

benchmark::ErrorPlot plotOf(const json& scene) {
  benchmark::ErrorPlot plot{
      scene["scene"].get<std::string>(),
      {{"solver error", "#1f5fa8", {}}, {"total error", "#b0492c", {}}, {"stated", "#777777", {}}}};
  for (const auto& row : scene["runs"]) {
    if (!measured(row)) continue;
    const double t = row["seconds"].get<double>();
    plot.curves[0].points.emplace_back(t, row["solver"]["relative_rms"].get<double>());
    plot.curves[1].points.emplace_back(t, row["total"]["relative_rms"].get<double>());
    plot.curves[2].points.emplace_back(t, row["stated"].value("total", 0.0));
  }
  return plot;
}

json benchmarkScene(const Options& options, const std::filesystem::path& scene) {
  ReferenceCache references;
  json result{{"scene", scene.stem().string()}, {"runs", json::array()}, {"reference_noise", 0.0}};
  for (const double time : options.times) {
    result["runs"].push_back(runOnce(options, scene, time, references));
    const auto& row = result["runs"].back();
    if (measured(row)) result["reference_noise"] = row["solver"]["reference_noise"];
    std::fprintf(stderr, "%s %g s: %s\n", scene.stem().c_str(), time,
                 measured(row) ? row["solver"].dump().c_str() : "failed");
  }
  result["slope"] = slope(result["runs"]);
  return result;
}

void run(const Options& options) {
  std::filesystem::create_directories(options.folder);
  json all = json::array();
  for (const std::filesystem::path scene : options.scenes) {
    all.push_back(benchmarkScene(options, scene));
    writeMarkdown(stdout, all.back());
    std::ofstream(options.folder / (scene.stem().string() + ".svg")) << benchmark::toSvg(plotOf(all.back()));
  }
  std::ofstream(options.folder / "error_time.json") << all.dump(2) << '\n';
  const auto markdown = options.folder / "error_time.md";
  if (auto* out = std::fopen(markdown.c_str(), "w"); out != nullptr) {
    for (const auto& scene : all) writeMarkdown(out, scene);
    std::fclose(out);
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Error of `radiosity solve` against time, judged by an independent path tracer."};
  app.add_option("SCENE", options.scenes, "GLB files")->required()->check(CLI::ExistingFile);
  app.add_option("--times", options.times, "time limits in seconds")->delimiter(',')->capture_default_str();
  app.add_option("--client", options.client, "the radiosity program")->capture_default_str();
  app.add_option("-o,--output", options.folder, "folder for results")->capture_default_str();
  app.add_option("--reference-samples", options.reference.texel_samples, "paths a texel")->capture_default_str();
  app.add_option("--texels", options.reference.texels, "texels compared; 0: all")->capture_default_str();
  app.add_option("--points", options.reference.points, "surface points compared")->capture_default_str();
  app.add_option("--solve-argument", options.solve_arguments, "passed on to `radiosity solve` (repeat)");
  CLI11_PARSE(app, argc, argv);
  options.reference.point_samples = options.reference.texel_samples;
  try {
    run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error_time: %s\n", error.what());
    return 1;
  }
  return 0;
}
