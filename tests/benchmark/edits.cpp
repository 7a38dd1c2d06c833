// edits [SCENE...]: how long live edits take beside a full solve of the same scene, as edited, to the same stated error
// in the same run: until the first changed tile is published, and until the scene is solved again. Writes edits.json
// and edits.md. The engine with the server's own workers; no network.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/check.h"
#include "common/freed_memory.h"
#include "server/engine/loop/solve_loop.h"
#include "server/gpu/workers/gpu_transport.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"

namespace {

using namespace radiosity;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr auto kPatience = std::chrono::minutes(10);

struct Options {
  std::vector<std::string> scenes{"room_small", "room_seminar"};
  double error = 0.02;
  int repetitions = 3, workers = 0;
  bool in_process = false;
  std::string only;
  std::filesystem::path output = "edits";
};

double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Of all threads of this process; with --in-process that is all there is, and other programs do not count.
double processorSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Notes when the first lightmaps of a revision are published and when it is solved.
class Watcher final : public engine::Listener {
 public:
  struct Times {
    double first_tile_s = 0.0, solved_s = 0.0, processor_s = 0.0;
    std::uint64_t shots = 0;
    double error = 0.0;
  };

  void begin(std::uint64_t revision) {
    const std::scoped_lock lock(mutex_);
    revision_ = revision;
    start_ = Clock::now();
    processor_start_ = processorSeconds();
    first_tile_.reset();
    solved_.reset();
    published_ = false;
  }
  /// Nothing when the solve failed or took too long.
  std::optional<Times> finish() {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kPatience, [&] { return solved_.has_value(); }) || failed_) return std::nullopt;
    auto times = *solved_;
    times.first_tile_s = first_tile_.value_or(times.solved_s);
    return times;
  }

  void onProgress(const engine::Status& status) override {
    const std::scoped_lock lock(mutex_);
    failed_ = status.state == engine::SolveState::kFailed || status.state == engine::SolveState::kLimited;
    if (status.revision < revision_ || solved_ || (status.state != engine::SolveState::kConverged && !failed_)) return;
    solved_ = Times{0.0, since(start_), processorSeconds() - processor_start_, status.shots, status.error.total};
    changed_.notify_all();
  }
  void onLightmaps(const std::shared_ptr<const engine::Lightmaps>& lightmaps) override {
    const std::scoped_lock lock(mutex_);
    if (lightmaps->revision < revision_ || first_tile_) return;
    // The first publication on new pages shows the light that was there before, unless the new light was waited for.
    if (!std::exchange(published_, true) && lightmaps->layout != layout_ && !lightmaps->final) {
      layout_ = lightmaps->layout;
      return;
    }
    // A tile counts when its light changed in this very version.
    for (const auto& page : lightmaps->pages) {
      for (const auto& mip : page->tile_version) {
        if (std::ranges::find(mip, lightmaps->tile_version) != mip.end()) first_tile_ = since(start_);
      }
    }
  }
  void onScenePatched(std::uint64_t, const std::string&, const std::string&) override {}
  void onSceneLoaded(std::uint64_t) override {}

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  Clock::time_point start_;
  double processor_start_ = 0.0;
  std::uint64_t revision_ = 0, layout_ = 0;
  std::optional<double> first_tile_;
  std::optional<Times> solved_;
  bool failed_ = false, published_ = false;
};

/// A row of the table: what is done, and the share of a full solve that it should cost.
struct Edit {
  const char* name;
  const char* patch;  ///< empty: undo
  double target;
  bool is_dark = false;  ///< nothing shines then, and nothing is solved: it is held against the scene before
};

constexpr Edit kEdits[] = {
    {"light recoloured", R"([{"op":"replace","path":"/materials/@lamp_light/emissiveFactor","value":[0.9,0.5,0.2]}])",
     0.05},
    {"undo", "", 0.05},
    {"light switched off", R"([{"op":"replace","path":"/materials/@lamp_light/emissiveFactor","value":[0,0,0]}])", 0.05,
     true},
    {"light switched on", "", 0.05},
    {"wall repainted",
     R"([{"op":"replace","path":"/materials/%WALL%/pbrMetallicRoughness/baseColorFactor","value":[0.3,0.3,0.6,1]}])",
     0.10},
    {"undo of the paint", "", 0.05},
    {"chair moved", R"([{"op":"replace","path":"/nodes/@chair1/translation","value":%CHAIR%}])", 0.20},
    {"undo of the move", "", 0.20},
    {"table added",
     R"([{"op":"add","path":"/nodes/-","value":{"name":"new table","mesh":%TABLE%,"translation":[0,0,0.4],
          "scale":[0.5,0.5,0.5]}},{"op":"add","path":"/scenes/0/nodes/-","value":%NODES%}])",
     0.20},
    {"undo of the table", "", 0.20},
};

struct Row {
  double target = 0.0;
  std::vector<double> first_tile_s, solved_s, ratio, processor_s, processor_ratio, shots;
};

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

class Bench {
 public:
  Bench(const Options& options, std::string scene) : options_(options), scene_(std::move(scene)) {}

  Result<json> run() {
    engine::EngineOptions engine_options;
    engine_options.settings.target_error = options_.error;
    engine_options.settings.texels = scene_ == "room_seminar" ? 27382 : 13742;  // of the paper
    engine_options.make_transport = [options = options_]() -> Result<std::unique_ptr<solver::Transport>> {
      if (options.in_process) return gpu::makeInProcessTransport();
      return gpu::makeWorkerTransport({options.workers, RADIOSITYD});
    };
    auto engine = engine::makeEngine(std::move(engine_options));
    if (!engine) return tl::unexpected(engine.error());
    engine_ = std::move(*engine);
    engine_->addListener(watcher_);
    watching_ = engine_->watch(engine::Quantity::kIrradiance);  // nothing is published for nobody
    for (int i = 0; i < options_.repetitions; ++i) {
      if (const auto done = repetition(); !done) return tl::unexpected(done.error());
    }
    return report();
  }

 private:
  template <typename T, typename Ask>
  static Result<T> call(const Ask& ask) {
    std::promise<Result<T>> promise;
    ask([&](Result<T> result) { promise.set_value(std::move(result)); });
    return promise.get_future().get();
  }

  Result<Watcher::Times> finish(const char* what) {
    const auto times = watcher_->finish();
    if (times) return *times;
    return fail(ErrorCode::kInternal, engine_->status().failure, scene_ + ": " + what);
  }

  Result<Watcher::Times> solveWhole(const SharedBytes& glb) {
    watcher_->begin(++revision_);
    const auto loaded =
        call<engine::LoadOutcome>([&](auto done) { engine_->loadBytes(scene_ + ".glb", glb, {}, std::move(done)); });
    if (!loaded) return tl::unexpected(loaded.error());
    return finish("full solve");
  }

  /// The scene as it is now, whose buffers are those of `original`.
  SharedBytes savedAs(const Bytes& original) {
    auto text = call<engine::Engine::SceneText>([&](auto done) { engine_->sceneText(std::move(done)); })->gltf;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    constexpr std::size_t kLength = 8, kJsonLength = 12, kJson = 20;  // of a GLB, where its parts are
    std::uint32_t before = 0;
    std::memcpy(&before, &original[kJsonLength], sizeof before);
    Bytes glb(original.size() - before + text.size());
    std::copy_n(original.begin(), kJson, glb.begin());
    std::copy_n(reinterpret_cast<const Bytes::value_type*>(text.data()), text.size(), glb.begin() + kJson);
    std::copy(original.begin() + static_cast<std::ptrdiff_t>(kJson + before), original.end(),
              glb.begin() + static_cast<std::ptrdiff_t>(kJson + text.size()));
    const auto now = static_cast<std::uint32_t>(text.size()), all = static_cast<std::uint32_t>(glb.size());
    std::memcpy(&glb[kJsonLength], &now, sizeof now);
    std::memcpy(&glb[kLength], &all, sizeof all);
    return std::make_shared<const Bytes>(std::move(glb));
  }

  /// A full solve, then every edit once, then full solves of what the edits made.
  Result<void> repetition() {
    const auto glb = std::make_shared<const Bytes>(test_scenes::encodeGlb(sceneNamed(scene_)));
    const auto full = solveWhole(glb);
    if (!full) return tl::unexpected(full.error());
    add("full solve", 1.0, *full, *full, 0);
    if (names_.empty()) findNames();
    struct Made {
      const Edit& edit;
      Watcher::Times times;
      std::uint64_t shots;
      SharedBytes glb;  ///< null: the scene that was loaded, or nearly
    };
    std::vector<Made> all;
    auto shots = full->shots;
    for (const auto& edit : kEdits) {
      if (edit.patch[0] != '\0') chosen_ = std::string(edit.name).find(options_.only) != std::string::npos;
      if (!chosen_) continue;  // nor what takes it back
      watcher_->begin(++revision_);
      const auto outcome = edit.patch[0] == '\0' ? undo() : patch(filled(edit.patch));
      if (!outcome) return tl::unexpected(outcome.error());
      const auto times = finish(edit.name);
      if (!times) return tl::unexpected(times.error());
      const auto before = shots <= times->shots ? shots : 0;  // a new solver counts from 0
      all.push_back({edit, *times, before, edit.patch[0] == '\0' || edit.is_dark ? nullptr : savedAs(*glb)});
      shots = times->shots;
    }
    for (const auto& made : all) {
      const auto of_this = made.glb ? solveWhole(made.glb) : full;
      if (!of_this) return tl::unexpected(of_this.error());
      add(made.edit.name, made.edit.target, made.times, *of_this, made.shots);
    }
    return {};
  }

  Result<engine::PatchOutcome> undo() {
    return call<engine::PatchOutcome>([&](auto done) { engine_->step({false, {}, "bench"}, std::move(done)); });
  }
  Result<engine::PatchOutcome> patch(const std::string& text) {
    return call<engine::PatchOutcome>(
        [&](auto done) { engine_->patch({.patch = text, .by = "bench"}, std::move(done)); });
  }

  static test_scenes::TestScene sceneNamed(const std::string& name) {
    for (const auto& [known, make] : test_scenes::allScenes())
      if (known == name) return make();
    throw std::runtime_error("no scene " + name);
  }

  void findNames() {
    const auto text = call<engine::Engine::SceneText>([&](auto done) { engine_->sceneText(std::move(done)); });
    RAD_CHECK(text.has_value());
    const auto gltf = json::parse(text->gltf);
    for (const auto& node : gltf["nodes"]) {
      const auto name = node.value("name", "");
      if (name == "chair1") {
        auto at = node["translation"];
        at[0] = at[0].get<double>() + 0.15;
        names_["%CHAIR%"] = at.dump();
      }
      if (name == "table1") names_["%TABLE%"] = node["mesh"].dump();
    }
    for (std::size_t m = 0; m < gltf["materials"].size(); ++m) {
      const auto name = gltf["materials"][m].value("name", "");
      if (name == "red_wall" || name == "blue_wall") names_["%WALL%"] = std::to_string(m);
    }
    names_["%NODES%"] = std::to_string(gltf["nodes"].size());
  }

  std::string filled(std::string text) const {
    for (const auto& [name, value] : names_) {
      for (auto at = text.find(name); at != std::string::npos; at = text.find(name))
        text.replace(at, name.size(), value);
    }
    return text;
  }

  void add(const std::string& name, double target, const Watcher::Times& times, const Watcher::Times& full,
           std::uint64_t shots) {
    if (!rows_.contains(name)) order_.push_back(name);
    auto& row = rows_[name];
    row.target = target;
    row.first_tile_s.push_back(times.first_tile_s);
    row.solved_s.push_back(times.solved_s);
    row.ratio.push_back(times.solved_s / full.solved_s);
    row.processor_s.push_back(times.processor_s);
    row.processor_ratio.push_back(times.processor_s / full.processor_s);
    row.shots.push_back(static_cast<double>(times.shots - std::min(shots, times.shots)));
  }

  [[nodiscard]] json report() const {
    json rows = json::array();
    for (const auto& name : order_) {
      const auto& row = rows_.at(name);
      rows.push_back({{"edit", name},
                      {"firstTileSeconds", median(row.first_tile_s)},
                      {"solvedSeconds", median(row.solved_s)},
                      {"ratio", median(row.ratio)},
                      {"processorSeconds", median(row.processor_s)},
                      {"processorRatio", median(row.processor_ratio)},
                      {"target", row.target},
                      {"shots", median(row.shots)}});
    }
    return {{"scene", scene_}, {"error", options_.error}, {"rows", rows}};
  }

  const Options& options_;
  std::string scene_;
  std::shared_ptr<Watcher> watcher_ = std::make_shared<Watcher>();
  std::unique_ptr<engine::Engine> engine_;
  std::shared_ptr<void> watching_;
  std::uint64_t revision_ = 0;
  bool chosen_ = true;
  std::map<std::string, std::string> names_;
  std::vector<std::string> order_;
  std::map<std::string, Row> rows_;
};

std::string markdown(const json& scenes, int repetitions) {
  std::string text =
      "# Live edits\n\nMedians of " + std::to_string(repetitions) +
      " runs; \"of a full solve\": of loading and solving the same scene, as edited, to the same stated error in the "
      "same run. Processor time is this process's: with --in-process all there is, and other programs do not "
      "disturb it. Targets: first changed tile in 50 ms.\n";
  char line[256];
  for (const auto& scene : scenes) {
    std::snprintf(line, sizeof line, "\n## %s, to a stated %.3g %%\n\n", scene["scene"].get<std::string>().c_str(),
                  100.0 * scene["error"].get<double>());
    text += line;
    text +=
        "| edit | first changed tile | solved | of a full solve | processor | of a full solve | target | shots |\n"
        "|---|---:|---:|---:|---:|---:|---:|---:|\n";
    for (const auto& row : scene["rows"]) {
      const auto number = [&](const char* member) { return row[member].get<double>(); };
      std::snprintf(line, sizeof line, "| %s | %.1f ms | %.3f s | %.1f %% | %.3f s | %.1f %% | %.0f %% | %.0f |\n",
                    row["edit"].get<std::string>().c_str(), 1e3 * number("firstTileSeconds"), number("solvedSeconds"),
                    100.0 * number("ratio"), number("processorSeconds"), 100.0 * number("processorRatio"),
                    100.0 * number("target"), number("shots"));
      text += line;
    }
  }
  return text;
}

int run(const Options& options) {
  json scenes = json::array();
  for (const auto& scene : options.scenes) {
    const auto result = Bench(options, scene).run();
    if (!result) {
      std::fprintf(stderr, "edits: %s\n", result.error().text().c_str());
      return 1;
    }
    scenes.push_back(*result);
  }
  const auto text = markdown(scenes, options.repetitions);
  std::fputs(text.c_str(), stdout);
  std::filesystem::create_directories(options.output);
  std::ofstream(options.output / "edits.json") << scenes.dump(2) << "\n";
  std::ofstream(options.output / "edits.md") << text;
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  radiosity::keepFreedMemory();  // as radiosityd does
  Options options;
  CLI::App app("How long live edits take, beside full solves", "edits");
  if (const char* folder = std::getenv("RADIOSITY_BENCH_OUTPUT")) options.output = folder;
  app.add_option("SCENE", options.scenes, "room_small, room_seminar")->capture_default_str();
  app.add_option("--error", options.error, "stated error to solve to, as a fraction")->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "runs of each scene")->capture_default_str();
  app.add_option("--workers", options.workers, "render processes; 0: one a core")->capture_default_str();
  app.add_option("--only", options.only, "edits whose name contains this, and what takes them back");
  app.add_flag("--in-process", options.in_process, "render in this process, for its processor time");
  app.add_option("--output", options.output, "folder for edits.json and edits.md")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    return run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "edits: %s\n", e.what());
    return 1;
  }
}
