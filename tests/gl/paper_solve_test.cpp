// The paper's algorithm to the letter against the default one, on the Cornell box: other links, other light transport,
// other stopping rule, same physics.
#include <gtest/gtest.h>

#include <memory>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/pipeline/make_solver.h"

namespace radiosity {
namespace {

struct Solved {
  std::vector<double> surface_flux;  ///< received, summed over channels
  double total = 0.0;
  std::uint64_t scatter_shots = 0;
};

Solved solveCornell(bool paper) {
  const auto document = scene::loadDocument(std::string(RADIOSITY_BINARY_DIR) + "/scenes/cornell.glb");
  EXPECT_TRUE(document.has_value()) << document.error().text();
  const auto imported = scene::importScene(*document);
  EXPECT_TRUE(imported.has_value());
  scene::ChartOptions charts;
  charts.texel_budget = 4000;
  const auto patches = std::make_shared<const scene::PatchScene>(*scene::buildPatchScene(*imported, charts));
  const auto transport = gpu::makeInProcessTransport();
  EXPECT_TRUE(transport.has_value()) << transport.error().text();
  EXPECT_TRUE((*transport)->setScene(patches));
  solver::SolverSettings settings;
  settings.method = paper ? Method::kPaper : Method::kShooting;
  settings.target_error = paper ? 0.004 : 0.02;  // of the paper: light that is still unshot, all of which is missing
  const auto solver = solver::makeSolver(patches, scene::shadePatches(*imported, *patches), **transport, settings);
  for (int i = 0; i < 20'000; ++i) {
    const auto outcome = solver->step();
    EXPECT_TRUE(outcome.has_value()) << outcome.error().text();
    if (!outcome || *outcome == solver::StepOutcome::kConverged) break;
  }
  Solved solved;
  const auto light = solver->irradiance();
  for (const auto& surface : patches->surfaces) {
    double flux = 0.0;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const auto node = surface.first_node[0] + leaf;
      const glm::vec3 h = light[node];
      flux += static_cast<double>((h.x + h.y + h.z) * patches->node_area[node]);
    }
    solved.surface_flux.push_back(flux);
    solved.total += flux;
  }
  solved.scatter_shots = solver->transportCounters().scatter_shots;
  return solved;
}

TEST(PaperMode, GivesEverySurfaceOfTheCornellBoxTheLightThatTheDefaultGivesIt) {
  const Solved paper = solveCornell(true), usual = solveCornell(false);
  EXPECT_GT(paper.scatter_shots, 100U) << "all light is scattered from hemicubes";
  EXPECT_NEAR(paper.total / usual.total, 1.0, 0.02);
  ASSERT_EQ(paper.surface_flux.size(), usual.surface_flux.size());
  for (std::size_t s = 0; s < usual.surface_flux.size(); ++s) {
    // One round of some hundred shots leaves each big surface within a few percent; the small ones are noisier.
    if (usual.surface_flux[s] < 0.03 * usual.total) continue;
    EXPECT_NEAR(paper.surface_flux[s] / usual.surface_flux[s], 1.0, 0.05) << "surface " << s;
  }
}

}  // namespace
}  // namespace radiosity
