// What a scene does not need and is skipped: each row does the same work with a skip or without it, or counts what the
// skip left out. `./dev bench skips`.
#include <benchmark/benchmark.h>

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "server/gpu/draw/hemicube_renderer.h"
#include "server/solver/patches/side.h"
#include "tests/benchmark/built_scenes.h"
#include "tests/benchmark/whole_solve.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::benchmarks {
namespace {

struct Image {
  const char* name;
  gpu::Culling culling;
};
/// Each with all skips of those before it.
constexpr Image kImages[] = {
    {"every triangle drawn for every face", {.faces = false, .backs = false, .samples = false, .hidden = false}},
    {"without what is behind the shooter or outside a face", {.backs = false, .samples = false, .hidden = false}},
    {"and backs of closed solids", {.samples = false, .hidden = false}},
    {"and triangles between the samples", {.hidden = false}},
    {"and what is hidden by others", {}},
};

/// One item buffer (N = 64): culling, drawing, readback. Arguments: polygons of the room, skips.
void imageSkip(benchmark::State& state) {
  const auto& variant = kImages[state.range(1)];
  state.SetLabel(variant.name);
  const auto scene = roomOf(state.range(0));
  auto context = gpu::EglContext::create();
  if (!context) return state.SkipWithError(context.error().text().c_str());
  auto renderer = gpu::HemicubeRenderer::create(**context, gpu::Drawing::kByProcessor);
  auto uploaded = gpu::GpuScene::upload(**context, scene);
  if (!renderer || !uploaded || !renderer->setScene(std::move(*uploaded), variant.culling))
    return state.SkipWithError("the scene cannot be drawn");
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  std::vector<gpu::HemicubeView> views;
  for (int i = 0; i < 40; ++i) {  // half from walls, half from furniture
    const auto surface = i % 2 == 0 ? random() % 6 : 6 + random() % (scene->surfaces.size() - 6);
    views.push_back(
        {test::shotFrom(*scene, static_cast<std::uint32_t>(surface), unit(random), unit(random), 64, random).frame});
  }
  solver::TransportCounters counters;
  const auto step = renderer->capacity(64);
  std::vector<std::uint32_t> pixels;
  std::size_t next = 0, shots = 0;
  for (auto _ : state) {
    if (next + step > views.size()) next = 0;
    renderer->render(gpu::HemicubePass::kItems, 64, std::span(views).subspan(next, step), counters, pixels);
    benchmark::DoNotOptimize(pixels.data());
    next += step;
    shots += step;
  }
  const auto a_shot = [&](auto sum) { return static_cast<double>(sum) / static_cast<double>(shots); };
  state.counters["shots/s"] = benchmark::Counter(static_cast<double>(shots), benchmark::Counter::kIsRate);
  state.counters["drawn"] = a_shot(counters.triangles_drawn);
  state.counters["between"] = a_shot(counters.triangles_between);
  state.counters["hidden"] = a_shot(counters.triangles_hidden);
  state.counters["empty_faces"] = a_shot(counters.faces_empty);
}

/// What can be switched in a whole solve; the counters say what it changed.
struct Variant {
  const char* name;
  std::function<void(solver::SolverSettings&)> change;
};
const std::vector<Variant>& variants() {
  static const std::vector<Variant> kAll{
      {"default", [](auto&) {}},
      {"links forgotten", [](auto& s) { s.link_memory = 0; }},
      {"links forgotten, reflected light scattered",
       [](auto& s) { s.link_memory = 0, s.planner.gather_nodes = false; }},
      {"links forgotten, nodes hardly ever shot whole",
       [](auto& s) { s.link_memory = 0, s.planner.variation_share /= 16; }},
      {"the paper to the letter", [](auto& s) { s.method = Method::kPaper; }},
  };
  return kAll;
}

/// Arguments: scene, variant. With the paper's way the goal is for what is unshot, and its sampling error stays.
void solveSkip(benchmark::State& state) {
  const auto& variant = variants()[static_cast<std::size_t>(state.range(1))];
  state.SetLabel(std::string(kSceneNames[state.range(0)]) + ", " + variant.name);
  solver::SolverSettings settings;
  settings.target_error = kSolveGoal;
  variant.change(settings);
  runSolve(state, patchesOf(state.range(0)), 0, settings);
}

/// A grey room needs one row of the equation where a coloured texture needs three. Argument: 0 grey, 1 coloured within
/// every wall.
void channelSkip(benchmark::State& state) {
  Patches scene = patchesOf(kCornell);
  state.SetLabel(state.range(0) == 0 ? "every surface of one colour" : "as if every surface were textured");
  if (state.range(0) == 1) {
    auto& reflectance = scene.materials.reflectance;
    for (const auto& side : solver::makeSides(*scene.patches)) {
      std::vector<glm::vec3> colours(side.node_count);
      for (std::uint32_t n = 0; n < side.node_count; ++n)
        colours[n] = (n % 2 == 0 ? 0.999F : 1.0F) * reflectance.side(side.number)[n];
      reflectance.assign(side.number, std::move(colours));
    }
  }
  solver::SolverSettings settings;
  settings.target_error = kSolveGoal;
  runSolve(state, scene, 0, settings);
}

/// Black sides never shoot. Argument: 0 as it is, 1 all surfaces but lamps black: only direct light is left.
void blackSkip(benchmark::State& state) {
  Patches scene = patchesOf(kSmallRoom);
  state.SetLabel(state.range(0) == 0 ? "as it is" : "every surface black");
  if (state.range(0) == 1) {
    scene.materials.reflectance.fill(glm::vec3(0.0F));
  }
  solver::SolverSettings settings;
  settings.target_error = kSolveGoal;
  runSolve(state, scene, 0, settings);
}

/// A closed convex room: render_% is what could be saved at most by not looking who sees whom.
void convexRoom(benchmark::State& state) {
  solver::SolverSettings settings;
  settings.target_error = kSolveGoal / 3.0;
  runSolve(state, patchesOf(kFurnace), 0, settings);
}

BENCHMARK(imageSkip)
    ->ArgNames({"polygons", "skips"})
    ->ArgsProduct({{402, 3138, 60000}, benchmark::CreateDenseRange(0, std::size(kImages) - 1, 1)})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(solveSkip)
    ->ArgNames({"scene", "variant"})
    ->ArgsProduct({{kCornell, kSmallRoom}, benchmark::CreateDenseRange(0, static_cast<int>(variants().size()) - 1, 1)})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(channelSkip)->Arg(0)->Arg(1)->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(blackSkip)->Arg(0)->Arg(1)->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(convexRoom)->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace radiosity::benchmarks
