// Error against time inside one process: solves a scene round by round and prints, after each, the time, the solver's
// own estimate and the truth against the path tracer on the same leaves.
//
//   solve_profile SCENE.glb [--seconds 5] [--error 0.002] [--texels 16000] [--samples 4096] [--workers 1]
//   [--reference FILE]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <glm/geometric.hpp>
#include <map>
#include <string>
#include <vector>

#include "common/freed_memory.h"
#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/outlines.h"
#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/pipeline/make_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "server/solver/solver.h"
#include "tests/oracle/path_tracer.h"
#include "tests/oracle/triangle_scene.h"

namespace radiosity {
namespace {

/// Time that this process used, of all its threads: other work on the machine does not count.
struct Clock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Clock>;
  static time_point now() {
    timespec used{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
    return time_point(std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec));
  }
};

struct Leaf {
  std::uint32_t node = 0;
  double area = 0.0;
  bool full = true;
  oracle::Footprint footprint;
};

/// Of all triangles of a surface, in texels.
double texelArea(const scene::PatchScene& patches, const scene::Surface& surface) {
  double sum = 0.0;
  for (std::uint32_t t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
    std::array<glm::dvec2, 3> c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = patches.vertices[patches.indices[std::size_t{3} * t + k]].texel;
    sum += 0.5 * std::abs((c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[1].y - c[0].y) * (c[2].x - c[0].x));
  }
  return sum;
}

/// Leaves of planes with their outlines; what is buried the path tracer leaves out of the mean by itself.
std::vector<Leaf> planarLeaves(const scene::PatchScene& patches) {
  std::vector<Leaf> leaves;
  const solver::Outlines outlines(patches);
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    const auto& surface = patches.surfaces[s];
    if (!surface.planar) continue;
    const bool known = std::abs(outlines.node(s, surface.level_count - 1, 0, 0).area() - texelArea(patches, surface)) <
                       1e-3 * texelArea(patches, surface);
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& place = patches.leaves[surface.first_leaf + i];
      if (place.triangle == scene::kNone || surface.first_node[0] == scene::kNone) continue;
      if (!place.full && !known) continue;  // its outline is not convex
      const auto& frame = patches.triangles[place.triangle];
      const auto polygon = outlines.node(s, 0, i % surface.width, i / surface.width);
      const auto corner = [&](std::uint32_t k) {
        const auto& texel = polygon.corner[k];
        return (glm::dvec3(frame.origin) + texel.x * glm::dvec3(frame.du) + texel.y * glm::dvec3(frame.dv)) *
                   patches.scale +
               patches.centre;
      };
      Leaf leaf;
      leaf.node = surface.first_node[0] + i;
      leaf.area = static_cast<double>(patches.node_area[leaf.node]);
      leaf.full = place.full;
      if (leaf.area < 0.25 * static_cast<double>(surface.texel_area)) continue;
      const glm::dvec3 normal(frame.normal);
      for (std::uint32_t k = 2; k < polygon.count; ++k)
        leaf.footprint.pieces.push_back({{corner(0), corner(k - 1), corner(k)}, normal});
      leaves.push_back(std::move(leaf));
    }
  }
  return leaves;
}

struct Truth {
  glm::dvec3 mean{0.0}, standard_error{0.0};
  double visible = 1.0;
};

std::vector<Truth> reference(const std::string& scene, const std::vector<Leaf>& leaves, std::uint32_t samples,
                             const std::string& cache) {
  std::vector<Truth> values(leaves.size());
  const auto bytes = static_cast<std::streamsize>(values.size() * sizeof(Truth));
  if (std::ifstream in(cache, std::ios::binary); in.read(reinterpret_cast<char*>(values.data()), bytes)) return values;
  const oracle::PathTracer tracer(oracle::readGlb(scene));
  std::vector<oracle::Footprint> footprints;
  for (const auto& leaf : leaves) footprints.push_back(leaf.footprint);
  oracle::PathOptions options;
  options.samples = samples;
  const auto traced = tracer.irradiance(footprints, options);
  for (std::size_t i = 0; i < traced.size(); ++i)
    values[i] = {traced[i].mean_lux, traced[i].standard_error, traced[i].visible_fraction};
  if (!cache.empty()) {
    std::ofstream(cache, std::ios::binary).write(reinterpret_cast<const char*>(values.data()), bytes);
  }
  return values;
}

void leaveOutBuried(std::vector<Leaf>& leaves, std::vector<Truth>& truth) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    if (truth[i].visible < 0.25) continue;
    leaves[kept] = leaves[i];
    truth[kept++] = truth[i];
  }
  leaves.resize(kept);
  truth.resize(kept);
}

/// The tracer's own noise is taken out of the squares.
void printTruth(const std::vector<Leaf>& leaves, const std::vector<Truth>& truth,
                const std::vector<glm::vec3>& solved) {
  double square = 0.0, mine = 0.0, theirs = 0.0;
  std::array<double, 2> difference{}, noise{};  // of parts, of full leaves
  std::vector<double> relative;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const glm::dvec3 value(solved[leaves[i].node]), mean = truth[i].mean, d = value - mean;
    const double area = leaves[i].area;
    difference[leaves[i].full ? 1 : 0] += area * glm::dot(d, d);
    noise[leaves[i].full ? 1 : 0] += area * glm::dot(truth[i].standard_error, truth[i].standard_error);
    square += area * glm::dot(mean, mean);
    const double l = value.x + value.y + value.z, t = mean.x + mean.y + mean.z;
    mine += area * l;
    theirs += area * t;
    relative.push_back(std::abs(l - t) / std::max(t, 1e-12));
  }
  std::sort(relative.begin(), relative.end());
  const auto percent = [&](double sum) { return 100.0 * std::sqrt(std::max(0.0, sum) / square); };
  std::printf(
      " | truth: rms %6.3f %% (parts %.3f full %.3f, noise %.3f) median %6.3f %%  p99 %6.2f %%  mean ratio %.4f",
      percent(difference[0] + difference[1] - noise[0] - noise[1]), percent(difference[0] - noise[0]),
      percent(difference[1] - noise[1]), percent(noise[0] + noise[1]), 100.0 * relative[relative.size() / 2],
      100.0 * relative[relative.size() * 99 / 100], mine / theirs);
}

/// Which surfaces are wrong, and which way.
void printSurfaces(const scene::PatchScene& patches, const std::vector<Leaf>& leaves, const std::vector<Truth>& truth,
                   const std::vector<glm::vec3>& solved) {
  for (std::size_t s = 0; s < patches.surfaces.size() && s < 40; ++s) {
    const auto first = patches.surfaces[s].first_node[0];
    const auto count = patches.surfaces[s].width * patches.surfaces[s].height;
    double mine = 0.0, theirs = 0.0, difference = 0.0, square = 0.0, worst = 0.0;
    std::uint32_t worst_leaf = 0;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      if (leaves[i].node < first || leaves[i].node >= first + count) continue;
      const glm::dvec3 value(solved[leaves[i].node]), d = value - truth[i].mean;
      mine += leaves[i].area * (value.x + value.y + value.z);
      theirs += leaves[i].area * (truth[i].mean.x + truth[i].mean.y + truth[i].mean.z);
      difference += leaves[i].area * glm::dot(d, d);
      square += leaves[i].area * glm::dot(truth[i].mean, truth[i].mean);
      if (glm::dot(d, d) > worst) worst = glm::dot(d, d), worst_leaf = leaves[i].node - first;
    }
    std::printf("  surface %2zu %3ux%3u ratio %.4f rms %.2f %% mean %.4g worst off %.3g at (%u, %u)\n", s,
                patches.surfaces[s].width, patches.surfaces[s].height, mine / theirs,
                100.0 * std::sqrt(difference / square), theirs, std::sqrt(worst),
                worst_leaf % patches.surfaces[s].width, worst_leaf / patches.surfaces[s].width);
  }
}

[[maybe_unused]]  /// Errors of one surface's leaves as a picture of characters: tenths of its mean, upper case where
                  /// too bright.
                  void
                  printMap(const scene::PatchScene& patches, std::uint32_t surface, const std::vector<Leaf>& leaves,
                           const std::vector<Truth>& truth, const std::vector<glm::vec3>& solved) {
  const auto& s = patches.surfaces[surface];
  std::vector<std::string> rows(s.height, std::string(s.width, ' '));
  double mean = 0.0, count = 0.0;
  const auto each = [&](auto visit) {
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const auto local = leaves[i].node - s.first_node[0];
      if (leaves[i].node >= s.first_node[0] && local < s.width * s.height) visit(i, local);
    }
  };
  each([&](std::size_t i, std::uint32_t) { mean += truth[i].mean.y, count += 1.0; });
  mean /= count;
  each([&](std::size_t i, std::uint32_t local) {
    const double off = (static_cast<double>(solved[leaves[i].node].y) - truth[i].mean.y) / mean;
    const int step = std::min(25, static_cast<int>(std::abs(off) * 20.0));
    rows[local / s.width][local % s.width] = static_cast<char>(step == 0 ? '.' : (off > 0 ? 'A' : 'a') + step);
  });
  for (const auto& row : rows) std::printf("  %s\n", row.c_str());
}

/// The leaves that contribute most to the error.
void printWorst(const scene::PatchScene& patches, const std::vector<Leaf>& leaves, const std::vector<Truth>& truth,
                const std::vector<glm::vec3>& solved, std::size_t count) {
  std::vector<std::pair<double, std::size_t>> order;
  double square = 0.0, all = 0.0;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const glm::dvec3 d = glm::dvec3(solved[leaves[i].node]) - truth[i].mean, noise = truth[i].standard_error;
    square += leaves[i].area * glm::dot(truth[i].mean, truth[i].mean);
    order.emplace_back(leaves[i].area * (glm::dot(d, d) - glm::dot(noise, noise)), i);
    all += order.back().first;
  }
  std::sort(order.begin(), order.end(), std::greater<>());
  double sum = 0.0;
  for (std::size_t k = 0; k < std::min(count, order.size()); ++k) {
    const auto& leaf = leaves[order[k].second];
    sum += order[k].first;
    std::size_t s = 0;
    while (patches.surfaces[s].first_node[0] == scene::kNone || leaf.node < patches.surfaces[s].first_node[0] ||
           leaf.node - patches.surfaces[s].first_node[0] >= patches.surfaces[s].width * patches.surfaces[s].height)
      ++s;
    const auto local = leaf.node - patches.surfaces[s].first_node[0];
    const auto& mean = truth[order[k].second].mean;
    const auto& corner = leaf.footprint.pieces[0].corners[0];
    const auto& normal = leaf.footprint.pieces[0].normal;
    std::printf("  at (%.3f, %.3f, %.3f) facing (%.1f, %.1f, %.1f)", corner.x, corner.y, corner.z, normal.x, normal.y,
                normal.z);
    std::printf(
        "  surface %3zu (%ux%u) leaf (%u, %u) %s area %.2f (%.2f): %.4g, true %.4g +- %.2g; %.1f %% of the square\n", s,
        patches.surfaces[s].width, patches.surfaces[s].height, local % patches.surfaces[s].width,
        local / patches.surfaces[s].width, leaf.full ? "full" : "part",
        leaf.area / static_cast<double>(patches.surfaces[s].texel_area), truth[order[k].second].visible,
        solved[leaf.node].y, mean.y, truth[order[k].second].standard_error.y, 100.0 * order[k].first / all);
  }
  std::printf("  together %.1f %% of the square of %.3f %%\n", 100.0 * sum / all, 100.0 * std::sqrt(all / square));
}

/// Whose samples the sampling error comes from: parts of its square.
void printSpread(const solver::Solver& any) {
  const auto* solver = dynamic_cast<const solver::LinkedSolver*>(&any);
  if (solver == nullptr) return;
  double lights = 0.0, roulette = 0.0, nodes = 0.0, light_samples = 0.0, node_samples = 0.0, half_played = 0.0;
  for (const auto& shooter : solver->system().shooters()) {
    const double spread = shooter.spread();
    const double samples = shooter.column[0].samples() + shooter.column[1].samples();
    if (shooter.column[0].samples() == 0 || shooter.column[1].samples() == 0) half_played += 1.0;
    (shooter.isLight() ? light_samples : node_samples) += samples;
    (shooter.isLight() ? lights : shooter.weight[0] != 1.0 || shooter.weight[1] != 1.0 ? roulette : nodes) += spread;
  }
  const double all = std::max(1e-300, lights + roulette + nodes) / 100.0;
  std::printf(
      "          spread: lights %.1f %% (%.0f samples) roulette %.1f %% nodes %.1f %% (%.0f samples); %.0f of %zu "
      "shooters in one half only\n",
      lights / all, light_samples, roulette / all, nodes / all, node_samples, half_played,
      solver->system().shooters().size());
}

int profile(const std::string& file, std::map<std::string, std::string> options) {
  const auto number = [&](const char* name, double fallback) {
    return options.count(name) != 0 ? std::atof(options[name].c_str()) : fallback;
  };
  auto document = scene::loadDocument(file);
  if (!document) return std::fprintf(stderr, "%s\n", document.error().text().c_str()), 2;
  const auto imported = scene::importScene(*document);
  if (!imported) return std::fprintf(stderr, "%s\n", imported.error().text().c_str()), 2;
  scene::ChartOptions charts;
  charts.texel_budget = static_cast<std::uint64_t>(number("--texels", 16000));
  auto begin = Clock::now();
  auto built = scene::buildPatchScene(*imported, charts);
  if (!built) return std::fprintf(stderr, "%s\n", built.error().text().c_str()), 2;
  const auto patches = std::make_shared<const scene::PatchScene>(std::move(*built));
  const auto materials = scene::shadePatches(*imported, *patches);
  std::printf("%s: %llu polygons, %zu surfaces, %zu nodes, %zu leaves, built in %.3f s\n", file.c_str(),
              static_cast<unsigned long long>(patches->polygons), patches->surfaces.size(), patches->nodeCount(),
              patches->leaves.size(), std::chrono::duration<double>(Clock::now() - begin).count());
  auto leaves = planarLeaves(*patches);
  std::printf("%zu leaves with spots of %zu bytes\n", patches->spots.listCount(), patches->spots.bytes());
  auto truth = reference(file, leaves, static_cast<std::uint32_t>(number("--samples", 4096)), options["--reference"]);
  leaveOutBuried(leaves, truth);
  const int workers = static_cast<int>(number("--workers", 0));
  auto transport =
      workers == 0 ? gpu::makeInProcessTransport() : gpu::makeWorkerTransport({workers, options["--worker-program"]});
  if (!transport) return std::fprintf(stderr, "%s\n", transport.error().text().c_str()), 1;
  if (const auto set = (*transport)->setScene(patches); !set)
    return std::fprintf(stderr, "%s\n", set.error().text().c_str()), 1;
  std::printf("%s\n", (*transport)->description().c_str());
  solver::SolverSettings settings;
  settings.target_error = number("--error", 0.002);
  settings.seed = static_cast<std::uint64_t>(number("--seed", 1));
  settings.method = options.count("--paper") != 0 ? Method::kPaper : Method::kGather;
  settings.planner.gather_nodes = number("--gather", 1) != 0.0;  // 0: reflected light is scattered instead
  settings.planner.first_shooters = static_cast<std::uint32_t>(number("--shooters", settings.planner.first_shooters));
  settings.planner.resolution = static_cast<std::uint32_t>(number("--resolution", settings.planner.resolution));
  settings.planner.light_points = static_cast<std::uint32_t>(number("--light-points", settings.planner.light_points));
  settings.planner.light_resolution =
      static_cast<std::uint32_t>(number("--light-resolution", settings.planner.light_resolution));
  settings.planner.node_resolution =
      static_cast<std::uint32_t>(number("--node-resolution", settings.planner.node_resolution));
  settings.planner.pairs_a_wave = static_cast<std::uint32_t>(number("--pairs", settings.planner.pairs_a_wave));
  settings.planner.level_bias = static_cast<float>(number("--bias", 0.0));
  begin = Clock::now();
  std::unique_ptr<solver::Solver> made;
  if (number("--linked", 1) != 0.0) {
    made = solver::makeSolver(patches, materials, **transport, settings);
  } else {
    made = std::make_unique<solver::ShootingSolver>(patches, materials, **transport, settings);
  }
  auto& solver = *made;
  double seconds = std::chrono::duration<double>(Clock::now() - begin).count(), shown = 0.0;
  while (seconds < number("--seconds", 5)) {
    begin = Clock::now();
    const auto outcome = solver.step();
    if (!outcome) return std::fprintf(stderr, "%s\n", outcome.error().text().c_str()), 1;
    seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    const bool last = *outcome == solver::StepOutcome::kConverged || *outcome == solver::StepOutcome::kExhausted;
    if (*outcome == solver::StepOutcome::kSlice) continue;
    if (!last && ((*outcome == solver::StepOutcome::kShot && number("--all", 0) == 0.0) || seconds < 1.15 * shown))
      continue;
    if (*outcome == solver::StepOutcome::kShot) solver.assess();
    shown = seconds;
    const auto& e = solver.error();
    const auto& c = solver.transportCounters();
    std::printf(
        "%7.3f s round %3u shots %6llu+%llu | stated %6.3f %% (residual %.3f sampling %.3f variation %.3f disc %.3f)",
        seconds, solver.rounds() - (*outcome == solver::StepOutcome::kConverged ? 0 : 1),
        static_cast<unsigned long long>(c.scatter_shots), static_cast<unsigned long long>(c.gather_points),
        100 * e.total, 100 * e.residual, 100 * e.sampling, 100 * e.variation, 100 * e.discretization);
    printTruth(leaves, truth, solver.irradiance());
    std::printf(" | render %.2f acc %.2f gather %.2f\n", c.render_seconds, c.accumulate_seconds, c.gather_seconds);
    if (options.count("--spread") != 0) printSpread(solver);
    if (last) break;
  }
  if (options.count("--surfaces") != 0) printSurfaces(*patches, leaves, truth, solver.irradiance());
  if (options.count("--map") != 0) {
    printMap(*patches, static_cast<std::uint32_t>(number("--map", 0)), leaves, truth, solver.irradiance());
  }
  if (options.count("--worst") != 0)
    printWorst(*patches, leaves, truth, solver.irradiance(), static_cast<std::size_t>(number("--worst", 20)));
  const auto energy = solver.energy();
  const auto& counters = solver.plannerCounters();
  std::printf("shooters %llu, of which gathered %llu; roulette kills %llu\n",
              static_cast<unsigned long long>(counters.shooters),
              static_cast<unsigned long long>(counters.gathered_nodes),
              static_cast<unsigned long long>(counters.roulette_kills));
  std::printf("energy: emitted %.6g absorbed %.6g escaped %.6g backface %.6g unshot %.6g imbalance %.6g\n",
              energy.emitted[0], energy.absorbed[0], energy.escaped[0], energy.backface[0], energy.unshot[0],
              energy.imbalance[0]);
  return 0;
}

}  // namespace
}  // namespace radiosity

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "usage: solve_profile SCENE.glb [--option value ...]\n"), 2;
  radiosity::keepFreedMemory();  // as radiosityd does
  std::map<std::string, std::string> options;
  for (int i = 2; i + 1 < argc; i += 2) options[argv[i]] = argv[i + 1];
  return radiosity::profile(argv[1], options);
}
