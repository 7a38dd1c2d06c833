// error_time [SCENE...]: how the error of `radiosity solve` falls with time, against an independent path tracer, and
// beside it Cycles, where Blender is installed. Writes error_time.json, error_time.md and a plot of each scene.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/benchmark/error_report.h"
#include "tests/benchmark/error_series.h"

namespace {

using namespace radiosity;
namespace fs = std::filesystem;

#ifndef RADIOSITY_CLIENT
#define RADIOSITY_CLIENT "radiosity"
#endif

struct Options {
  std::vector<std::string> scenes;
  bool full = false, no_cycles = false;
  fs::path output = "error_time";
  benchmark::SeriesOptions series;
};

const fs::path kBuiltIn = fs::path(RADIOSITY_BINARY_DIR) / "scenes";
const fs::path kShared = fs::path(RADIOSITY_SHARED_DIR) / "scenes";

/// Scenes lent for tests, where present: those that lie in the folder itself, and .gltf one folder below. The features
/// are single boxes and triangles, nothing to time.
std::vector<fs::path> sharedScenes() {
  std::vector<fs::path> found;
  if (!fs::is_directory(kShared)) {
    std::fprintf(stderr, "error_time: no shared scenes beside the checkout; only the built-in ones are run\n");
    return found;
  }
  for (const auto& entry : fs::directory_iterator(kShared)) {
    if (entry.path().extension() == ".glb") found.push_back(entry.path());
    if (!entry.is_directory() || entry.path().filename() == "features") continue;
    for (const auto& inner : fs::directory_iterator(entry.path())) {
      if (inner.path().extension() == ".gltf") found.push_back(inner.path());
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<fs::path> chosenScenes(const Options& options) {
  std::vector<fs::path> chosen;
  if (!options.scenes.empty()) {
    for (const auto& name : options.scenes) {
      const auto shared = kShared / (name + ".glb");
      chosen.push_back(fs::exists(name) ? fs::path(name) : fs::exists(shared) ? shared : kBuiltIn / (name + ".glb"));
      if (!fs::exists(chosen.back())) throw std::runtime_error("no scene file or built-in scene " + name);
    }
    return chosen;
  }
  for (const auto* name : {"cornell", "room_small", "room_small_mirror", "furnace_90"})
    chosen.push_back(kBuiltIn / (std::string(name) + ".glb"));
  if (!options.full) return chosen;
  for (const auto* name : {"room_seminar", "furnace", "cornell_double", "room_small_double", "room_seminar_double"})
    chosen.push_back(kBuiltIn / (std::string(name) + ".glb"));
  const auto shared = sharedScenes();
  chosen.insert(chosen.end(), shared.begin(), shared.end());
  return chosen;
}

/// The rooms of the paper have its numbers of patches (Lum, Ma and Max 2002, section 5); other scenes the default.
std::vector<std::string> argumentsFor(const fs::path& scene, const benchmark::SeriesOptions& options) {
  const auto& asked = options.solve_arguments;
  const bool chosen = std::any_of(asked.begin(), asked.end(), [](const auto& a) { return a.rfind("--texel", 0) == 0; });
  auto arguments = asked;
  if (chosen || options.chosen_texels || scene.parent_path() != kBuiltIn) return arguments;
  const auto name = scene.stem().string();
  if (name.rfind("room_small", 0) == 0) arguments.insert(arguments.end(), {"--texels", "13742"});
  if (name.rfind("room_seminar", 0) == 0) arguments.insert(arguments.end(), {"--texels", "27382"});
  return arguments;
}

bool inPath(const std::string& program) {
  if (program.find('/') != std::string::npos) return fs::exists(program);
  std::string path = std::getenv("PATH") != nullptr ? std::getenv("PATH") : "";
  for (std::size_t at = 0; at <= path.size();) {
    const auto end = std::min(path.find(':', at), path.size());
    if (fs::exists(fs::path(path.substr(at, end - at)) / program)) return true;
    at = end + 1;
  }
  return false;
}

benchmark::RunDescription describe(const Options& options) {
  benchmark::RunDescription run{options.full ? "Full" : "Quick", std::thread::hardware_concurrency(), 0.0, "unknown"};
  std::ifstream("/proc/loadavg") >> run.load;
  std::ifstream cpu("/proc/cpuinfo");
  for (std::string line; std::getline(cpu, line);) {
    if (line.rfind("model name", 0) == 0) run.processor = line.substr(line.find(':') + 2);
  }
  return run;
}

void write(const Options& options, const benchmark::RunDescription& run,
           const std::vector<benchmark::SceneSeries>& scenes) {
  std::ofstream(options.output / "error_time.json") << benchmark::toJson(run, scenes).dump(2) << '\n';
  std::ofstream(options.output / "error_time.md") << benchmark::toMarkdown(run, scenes);
  if (!scenes.back().unmeasured.empty()) return;
  std::ofstream(options.output / (scenes.back().name + ".svg")) << benchmark::toSvg(benchmark::plotOf(scenes.back()));
}

void runAll(Options options) {
  fs::create_directories(options.output);
  options.series.reference.point_samples = options.series.reference.texel_samples;
  options.series.work_folder = fs::path(RADIOSITY_BINARY_DIR) / "error_time";
  options.series.reference_folder = fs::path(RADIOSITY_BINARY_DIR) / "references";
  options.series.bake_script = fs::path(RADIOSITY_SOURCE_DIR) / "tests/benchmark/cycles_bake.py";
  options.series.cycles = !options.no_cycles && inPath(options.series.blender);
  if (!options.no_cycles && !options.series.cycles) {
    std::fprintf(stderr, "error_time: no %s here, so nothing is compared with Cycles\n",
                 options.series.blender.c_str());
  }
  const auto description = describe(options);
  std::vector<benchmark::SceneSeries> done;
  for (const auto& scene : chosenScenes(options)) {
    auto series = options.series;
    series.solve_arguments = argumentsFor(scene, options.series);
    done.push_back(benchmark::measureScene(scene, series));
    write(options, description, done);  // after each, so that an interrupted run has something to show
  }
  std::fputs(benchmark::toMarkdown(description, done).c_str(), stdout);
}

void applyMode(CLI::App& app, Options& options) {
  auto& series = options.series;
  if (options.full) return;
  if (app.count("--times") == 0) series.times = {0.1, 0.2, 0.5, 1, 2, 4};
  if (app.count("--reference-samples") == 0) series.reference.texel_samples = 4096;
  if (app.count("--texels") == 0) series.reference.texels = 2000;
  if (app.count("--points") == 0) series.reference.points = 1000;
  if (app.count("--cycles-seconds") == 0) series.cycles_seconds = 8.0;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  options.series.client = RADIOSITY_CLIENT;
  options.series.reference = {.texel_samples = 8192, .texels = 4000, .points = 2000, .closed_form = true};
  auto& series = options.series;
  CLI::App app{
      "Error of `radiosity solve` against time, judged by an independent path tracer, beside Cycles where Blender is "
      "installed. Without scenes: three built-in ones, some minutes; with --full all built-in ones and those in "
      "../shared/scenes, about half an hour. References are kept in the build folder."};
  app.add_option("SCENE", options.scenes, "files, or names of built-in or shared scenes");
  app.add_flag("--full", options.full, "all scenes, all times, finer references");
  app.add_option("--times", series.times, "limits of solve time in seconds; quick: 0.1 to 4")
      ->delimiter(',')
      ->expected(1, 100)
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--floor", series.floor, "stated error at which longer runs are left out")->capture_default_str();
  app.add_option("--client", series.client, "the radiosity program")->capture_default_str();
  app.add_option("-o,--output", options.output, "folder for results")
      ->envname("RADIOSITY_BENCH_OUTPUT")
      ->capture_default_str();
  app.add_option("--reference-samples", series.reference.texel_samples, "paths a texel and point; quick: 4096")
      ->capture_default_str();
  app.add_option("--texels", series.reference.texels, "texels compared, 0: all; quick: 2000")->capture_default_str();
  app.add_option("--points", series.reference.points, "surface points compared; quick: 1000")->capture_default_str();
  app.add_option("--solve-argument", series.solve_arguments, "passed on to `radiosity solve` (repeat)");
  app.add_flag("--chosen", series.chosen_texels, "texels are chosen by the program; else they are of one size");
  app.add_option("--sky", series.sky, "of scenes in which nothing shines, as `radiosity solve` takes it")
      ->capture_default_str();
  app.add_flag("--no-cycles", options.no_cycles, "leave Cycles out");
  app.add_option("--blender", series.blender, "the Blender program")->capture_default_str();
  app.add_option("--cycles-seconds", series.cycles_seconds, "of the longest bake, about; quick: 8")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  applyMode(app, options);
  std::sort(series.times.begin(), series.times.end());
  try {
    runAll(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error_time: %s\n", error.what());
    return 1;
  }
  return 0;
}
