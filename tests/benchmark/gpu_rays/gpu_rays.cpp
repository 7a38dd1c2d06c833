// gpu_rays SCENE...: rays a second that compute shaders cast on a graphics card, as leaves of a scene draw them and
// towards a lamp, for each kind of tree and way to walk it; and sweeps of the equation over kept hits. Every answer is
// held against the processor's. Prints the fastest of each, writes all to gpu_rays.json; fails if an answer is wrong.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/gpu/gl/egl_context.h"
#include "tests/benchmark/gpu_rays/ray_caster.h"
#include "tests/benchmark/gpu_rays/ray_sets.h"
#include "tests/benchmark/gpu_rays/sweep.h"
#include "tests/benchmark/gpu_rays/wide_tree.h"

namespace {

using namespace radiosity;
using namespace radiosity::benchmarks;
using nlohmann::json;

struct Options {
  std::vector<std::string> scenes;
  std::uint64_t texels = 27382;
  std::uint32_t rays = 64, sweep_texels = 4'000'000;
  std::vector<std::uint32_t> widths{2, 4, 8}, groups{64, 128}, shared{0, 8}, loops{0, 1}, fetching{0, 270'336};
  float triangle_cost = 0.3F;
  std::vector<std::string> orders{"leaf", "number", "direction", "lamp"};
  int repetitions = 7;
  std::string shaders = RADIOSITY_SOURCE_DIR "/tests/benchmark/gpu_rays/shaders";
  std::filesystem::path output = "gpu_rays";
};

constexpr std::pair<const char*, RayOrder> kOrders[] = {
    {"leaf", RayOrder::kByLeaf}, {"number", RayOrder::kByNumber}, {"direction", RayOrder::kByDirection}};

/// One run of the program.
class Bench {
 public:
  Bench(const Options& options, const gpu::EglContext& context)
      : options_(options), context_(context), caster_(context, options.shaders) {}

  Result<void> measure(const std::string& name) {
    const auto scene = RayScene::load(name, options_.texels);
    if (!scene) return tl::unexpected(scene.error());
    scene_ = std::filesystem::path(name).stem().string();
    const auto& triangles = (*scene)->triangles();
    std::printf("\n%s: %zu triangles, %zu leaves\n", scene_.c_str(), triangles.size(), (*scene)->leafCount());
    std::vector<WideTree> trees;
    for (const auto width : options_.widths) {
      trees.push_back(buildWideTree(triangles, {.width = width, .triangle = options_.triangle_cost}));
      std::printf("  tree of %u: %zu nodes, depth %u, %zu bytes\n", width, trees.back().nodes.size(),
                  trees.back().depth, 4 * (nodeWords(trees.back()).size() + 12 * triangles.size()));
    }
    for (const auto& [order_name, order] : kOrders) {
      if (std::ranges::find(options_.orders, order_name) == options_.orders.end()) continue;
      const auto set = inOrder((*scene)->leafRays(options_.rays), order, options_.rays);
      if (const auto done = measureSet(triangles, trees, set, order_name); !done) return done;
    }
    if (std::ranges::find(options_.orders, "lamp") == options_.orders.end()) return {};
    return measureSet(triangles, trees, (*scene)->lampRays(options_.rays), "towards a lamp");
  }

  Result<void> measureSweeps(const std::string& name) {
    const auto scene = RayScene::load(name, options_.texels);
    if (!scene) return tl::unexpected(scene.error());
    std::printf("\nsweeps, %s\n", name.c_str());
    const auto leaves = static_cast<std::uint32_t>((*scene)->leafCount());
    const auto copies = std::max(1U, options_.sweep_texels / std::max(1U, leaves));
    for (const std::uint32_t of_each : {16U, 64U}) {
      const auto hits = (*scene)->leafHits(of_each);
      for (const auto many : copies > 1 ? std::vector{1U, copies} : std::vector{1U}) {
        const auto sweeps = timeSweeps(context_, options_.shaders, hits, of_each, many, options_.repetitions);
        if (!sweeps) return tl::unexpected(sweeps.error());
        for (const auto& sweep : *sweeps) addSweep(sweep);
      }
    }
    const auto trip = timeRoundTrip(context_, options_.shaders);
    if (!trip) return tl::unexpected(trip.error());
    std::printf("  asked and answered: %.1f us\n", 1e6 * *trip);
    round_trip_s_ = *trip;
    return {};
  }

  [[nodiscard]] bool wasWrong() const { return wrong_; }
  [[nodiscard]] json report() const {
    return {
        {"renderer", context_.renderer()}, {"rays", rows_}, {"sweeps", sweeps_}, {"roundTripSeconds", round_trip_s_}};
  }

 private:
  Result<void> measureSet(const std::vector<scene::Bvh::Triangle>& triangles, const std::vector<WideTree>& trees,
                          const RaySet& set, const std::string& name) {
    if (set.rays.empty()) return {};
    const auto right = askProcessor(triangles, set);
    const double millions = 1e-6 * static_cast<double>(set.rays.size());
    const auto met =
        std::ranges::count_if(right.hits, [&](auto hit) { return set.any ? hit == 1 : hit != scene::kNone; });
    std::printf("  %s: %.2f M rays, %.1f %% meet something; the processor: %.1f M rays/s\n", name.c_str(), millions,
                1e-4 * static_cast<double>(met) / millions, millions / right.seconds);
    caster_.setRays(set);
    double best = 0.0;
    std::string fastest;
    for (const auto& tree : trees) {
      caster_.setTree(tree, triangles);
      for (const auto& variant : variantsOf(tree.width, set.rays.size())) {
        const auto cast = caster_.cast(variant, options_.repetitions);
        if (!cast) return tl::unexpected(cast.error());
        const auto differences = compare(triangles, set, right.hits, cast->hits);
        // Where surfaces lie in one place either may be told, but not often.
        wrong_ = wrong_ || differences.wrong > 0 || 100 * differences.all > set.rays.size();
        const double rate = millions / cast->seconds;
        addRow(name, variant, set.rays.size(), rate, millions / right.seconds, differences);
        if (rate <= best) continue;
        best = rate;
        fastest = textOf(variant);
      }
    }
    std::printf("    fastest: %.1f M rays/s: %s\n", best, fastest.c_str());
    return {};
  }

  [[nodiscard]] std::vector<Variant> variantsOf(std::uint32_t width, std::size_t rays) const {
    // llvmpipe leaves a loop after 65,536 turns, and few of its threads fetch all the rays.
    constexpr std::size_t kMostOfSoftware = 2048;
    const bool may_fetch = !context_.software() || rays <= kMostOfSoftware;
    std::vector<Variant> variants;
    for (const auto group : options_.groups)
      for (const auto shared : options_.shared)
        for (const auto loops : options_.loops)
          for (const auto fetching : options_.fetching)
            if (fetching == 0 || may_fetch) variants.push_back({width, shared, group, loops != 0, fetching});
    return variants;
  }

  static std::string textOf(const Variant& variant) {
    return "tree of " + std::to_string(variant.width) + ", " + std::to_string(variant.shared_stack) +
           " entries shared, groups of " + std::to_string(variant.group) +
           (variant.whole_loops ? ", whole loops" : "") + (variant.fetching > 0 ? ", threads fetch rays" : "");
  }

  void addRow(const std::string& set, const Variant& variant, std::size_t rays, double rate, double processor_rate,
              const Differences& differences) {
    rows_.push_back({{"scene", scene_},
                     {"set", set},
                     {"width", variant.width},
                     {"group", variant.group},
                     {"sharedStack", variant.shared_stack},
                     {"wholeLoops", variant.whole_loops},
                     {"fetching", variant.fetching},
                     {"rays", rays},
                     {"millionsASecond", rate},
                     {"processorMillionsASecond", processor_rate},
                     {"different", differences.all},
                     {"examined", differences.examined},
                     {"wrong", differences.wrong}});
    std::printf("    %8.1f M rays/s, %zu answers differ, %zu of %zu wrong: %s\n", rate, differences.all,
                differences.wrong, differences.examined, textOf(variant).c_str());
  }

  void addSweep(const SweepTimes& sweep) {
    constexpr double kMostError = 1e-5;  // single precision, of 64 summands
    wrong_ = wrong_ || !(sweep.greatest_error < kMostError);
    sweeps_.push_back({{"leaves", sweep.leaves},
                       {"hits", sweep.hits},
                       {"group", sweep.group},
                       {"transposed", sweep.transposed},
                       {"seconds", sweep.seconds},
                       {"bytes", sweep.bytes},
                       {"greatestError", sweep.greatest_error}});
    std::printf("  %zu leaves, %u hits, %s, groups of %u: %.4f ms, %.0f GB/s, error %.1e\n", sweep.leaves, sweep.hits,
                sweep.transposed ? "hit after hit" : "leaf after leaf", sweep.group, 1e3 * sweep.seconds,
                1e-9 * sweep.bytes / sweep.seconds, sweep.greatest_error);
  }

  const Options& options_;
  const gpu::EglContext& context_;
  RayCaster caster_;
  std::string scene_;
  json rows_ = json::array(), sweeps_ = json::array();
  double round_trip_s_ = 0.0;
  bool wrong_ = false;
};

int run(const Options& options) {
  const auto context = gpu::EglContext::create();
  if (!context) return std::fprintf(stderr, "gpu_rays: %s\n", context.error().text().c_str()), 1;
  std::printf("%s\n", (*context)->renderer().c_str());
  Bench bench(options, **context);
  for (const auto& scene : options.scenes) {
    const auto done = bench.measure(scene);
    if (!done) return std::fprintf(stderr, "gpu_rays: %s\n", done.error().text().c_str()), 1;
  }
  const auto done = bench.measureSweeps(options.scenes.back());
  if (!done) return std::fprintf(stderr, "gpu_rays: %s\n", done.error().text().c_str()), 1;
  std::filesystem::create_directories(options.output);
  std::ofstream(options.output / "gpu_rays.json") << bench.report().dump(2) << "\n";
  if (bench.wasWrong()) return std::fprintf(stderr, "gpu_rays: answers are wrong\n"), 1;
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Rays by compute shaders", "gpu_rays");
  if (const char* folder = std::getenv("RADIOSITY_BENCH_OUTPUT")) options.output = folder;
  app.add_option("SCENE", options.scenes, "files, or room:N; sweeps are measured in the last")->required();
  app.add_option("--texels", options.texels, "leaves in all, about")->capture_default_str();
  app.add_option("--rays", options.rays, "of each leaf")->capture_default_str();
  app.add_option("--widths", options.widths, "of trees: 2, 4, 8")->delimiter(',')->capture_default_str();
  app.add_option("--groups", options.groups, "threads of a group")->delimiter(',')->capture_default_str();
  app.add_option("--shared", options.shared, "stack entries in shared memory")->delimiter(',')->capture_default_str();
  app.add_option("--loops", options.loops, "1: whole loops; 0: a thing at each turn")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--triangle-cost", options.triangle_cost, "of a node's, for trees")->capture_default_str();
  app.add_option("--fetching", options.fetching, "threads that fetch rays; 0: one a ray")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--orders", options.orders, "of rays: leaf, number, direction; lamp: towards one")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--sweep-texels", options.sweep_texels, "of large sweeps")->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "of each measurement")->capture_default_str();
  app.add_option("--shaders", options.shaders, "folder of the shaders")->capture_default_str();
  app.add_option("--output", options.output, "folder for gpu_rays.json")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // rows are seen as they are measured
  try {
    return run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "gpu_rays: %s\n", e.what());
    return 1;
  }
}
