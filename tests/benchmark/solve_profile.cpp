// Error against time inside one process: solves a scene round by round and prints, after each, the time, the solver's
// own estimate and the truth against the path tracer on the same leaves.
//
//   solve_profile SCENE.glb [--seconds 5] [--error 0.002] [--texels 16000] [--samples 4096] [--workers 1] [--reference
//   FILE]
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

#include "server/gpu/gpu_transport.h"
#include "server/scene/document.h"
#include "server/scene/patch_scene.h"
#include "server/solver/shooting_solver.h"
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
  oracle::Footprint footprint;
};

/// Leaves wholly covered by one plane and not buried: there a texel mean is a mean over a parallelogram.
std::vector<Leaf> fullLeaves(const scene::PatchScene& patches) {
  std::vector<Leaf> leaves;
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& place = patches.leaves[surface.first_leaf + i];
      if (place.triangle == scene::kNone || !place.full || surface.first_node[0] == scene::kNone) continue;
      const auto& frame = patches.triangles[place.triangle];
      const auto corner = [&](std::uint32_t x, std::uint32_t y) {
        return glm::dvec3(frame.origin + static_cast<float>(i % surface.width + x) * frame.du +
                          static_cast<float>(i / surface.width + y) * frame.dv) *
                   patches.scale +
               patches.centre;
      };
      Leaf leaf;
      leaf.node = surface.first_node[0] + i;
      leaf.area = static_cast<double>(patches.node_area[leaf.node]);
      const glm::dvec3 normal(frame.normal);
      leaf.footprint.pieces = {{{corner(0, 0), corner(1, 0), corner(1, 1)}, normal},
                               {{corner(0, 0), corner(1, 1), corner(0, 1)}, normal}};
      leaves.push_back(std::move(leaf));
    }
  }
  return leaves;
}

std::vector<glm::dvec3> reference(const std::string& scene, const std::vector<Leaf>& leaves, std::uint32_t samples,
                                  const std::string& cache) {
  std::vector<glm::dvec3> values(leaves.size());
  if (std::ifstream in(cache, std::ios::binary);
      in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(glm::dvec3))))
    return values;
  const oracle::PathTracer tracer(oracle::readGlb(scene));
  std::vector<oracle::Footprint> footprints;
  for (const auto& leaf : leaves) footprints.push_back(leaf.footprint);
  oracle::PathOptions options;
  options.samples = samples;
  const auto traced = tracer.irradiance(footprints, options);
  double noise = 0.0, square = 0.0;
  for (std::size_t i = 0; i < traced.size(); ++i) {
    values[i] = traced[i].mean_lux;
    noise += leaves[i].area * glm::dot(traced[i].standard_error, traced[i].standard_error);
    square += leaves[i].area * glm::dot(values[i], values[i]);
  }
  std::printf("reference: %zu leaves, own error %.3f %%\n", leaves.size(), 100.0 * std::sqrt(noise / square));
  if (!cache.empty())
    std::ofstream(cache, std::ios::binary)
        .write(reinterpret_cast<const char*>(values.data()),
               static_cast<std::streamsize>(values.size() * sizeof(glm::dvec3)));
  return values;
}

void printTruth(const std::vector<Leaf>& leaves, const std::vector<glm::dvec3>& truth,
                const std::vector<glm::vec3>& solved) {
  double difference = 0.0, square = 0.0, mine = 0.0, theirs = 0.0;
  std::vector<double> relative;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const glm::dvec3 value(solved[leaves[i].node]), d = value - truth[i];
    difference += leaves[i].area * glm::dot(d, d);
    square += leaves[i].area * glm::dot(truth[i], truth[i]);
    const double l = value.x + value.y + value.z, t = truth[i].x + truth[i].y + truth[i].z;
    mine += leaves[i].area * l;
    theirs += leaves[i].area * t;
    relative.push_back(std::abs(l - t) / std::max(t, 1e-12));
  }
  std::sort(relative.begin(), relative.end());
  std::printf(" | truth: rms %6.3f %%  median %6.3f %%  p99 %6.2f %%  mean ratio %.4f",
              100.0 * std::sqrt(difference / square), 100.0 * relative[relative.size() / 2],
              100.0 * relative[relative.size() * 99 / 100], mine / theirs);
}

/// Which surfaces are wrong, and which way.
void printSurfaces(const scene::PatchScene& patches, const std::vector<Leaf>& leaves,
                   const std::vector<glm::dvec3>& truth, const std::vector<glm::vec3>& solved) {
  for (std::size_t s = 0; s < patches.surfaces.size() && s < 40; ++s) {
    const auto first = patches.surfaces[s].first_node[0];
    const auto count = patches.surfaces[s].width * patches.surfaces[s].height;
    double mine = 0.0, theirs = 0.0, difference = 0.0, square = 0.0, worst = 0.0;
    std::uint32_t worst_leaf = 0;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      if (leaves[i].node < first || leaves[i].node >= first + count) continue;
      const glm::dvec3 value(solved[leaves[i].node]), d = value - truth[i];
      mine += leaves[i].area * (value.x + value.y + value.z);
      theirs += leaves[i].area * (truth[i].x + truth[i].y + truth[i].z);
      difference += leaves[i].area * glm::dot(d, d);
      square += leaves[i].area * glm::dot(truth[i], truth[i]);
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
                           const std::vector<glm::dvec3>& truth, const std::vector<glm::vec3>& solved) {
  const auto& s = patches.surfaces[surface];
  std::vector<std::string> rows(s.height, std::string(s.width, ' '));
  double mean = 0.0, count = 0.0;
  const auto each = [&](auto visit) {
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const auto local = leaves[i].node - s.first_node[0];
      if (leaves[i].node >= s.first_node[0] && local < s.width * s.height) visit(i, local);
    }
  };
  each([&](std::size_t i, std::uint32_t) { mean += truth[i].y, count += 1.0; });
  mean /= count;
  each([&](std::size_t i, std::uint32_t local) {
    const double off = (static_cast<double>(solved[leaves[i].node].y) - truth[i].y) / mean;
    const int step = std::min(25, static_cast<int>(std::abs(off) * 20.0));
    rows[local / s.width][local % s.width] = static_cast<char>(step == 0 ? '.' : (off > 0 ? 'A' : 'a') + step);
  });
  for (const auto& row : rows) std::printf("  %s\n", row.c_str());
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
  const auto leaves = fullLeaves(*patches);
  const auto truth =
      reference(file, leaves, static_cast<std::uint32_t>(number("--samples", 4096)), options["--reference"]);
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
  settings.paper_mode = options.count("--paper") != 0;
  settings.planner.gather_nodes = number("--gather", 1) != 0.0;  // 0: reflected light is scattered instead
  settings.planner.shooters_a_round =
      static_cast<std::uint32_t>(number("--shooters", settings.planner.shooters_a_round));
  settings.planner.resolution = static_cast<std::uint32_t>(number("--resolution", settings.planner.resolution));
  settings.planner.light_points = static_cast<std::uint32_t>(number("--light-points", settings.planner.light_points));
  settings.planner.light_resolution =
      static_cast<std::uint32_t>(number("--light-resolution", settings.planner.light_resolution));
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
    std::printf("%7.3f s round %3u shots %6llu+%llu | stated %6.3f %% (residual %.3f sampling %.3f disc %.3f)", seconds,
                solver.rounds() - (*outcome == solver::StepOutcome::kConverged ? 0 : 1),
                static_cast<unsigned long long>(c.scatter_shots), static_cast<unsigned long long>(c.gather_points),
                100 * e.total, 100 * e.residual, 100 * e.sampling, 100 * e.discretization);
    printTruth(leaves, truth, solver.irradiance());
    std::printf(" | render %.2f acc %.2f gather %.2f\n", c.render_seconds, c.accumulate_seconds, c.gather_seconds);
    if (last) break;
  }
  if (options.count("--surfaces") != 0) printSurfaces(*patches, leaves, truth, solver.irradiance());
  if (options.count("--map") != 0) {
    printMap(*patches, static_cast<std::uint32_t>(number("--map", 0)), leaves, truth, solver.irradiance());
  }
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
  std::map<std::string, std::string> options;
  for (int i = 2; i + 1 < argc; i += 2) options[argv[i]] = argv[i + 1];
  return radiosity::profile(argv[1], options);
}
