#include "tests/accuracy/stress/stress_solve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/solver/pipeline/make_solver.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

template <typename T>
T valueOf(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().text());
  return std::move(*result);
}

}  // namespace

Loaded loadGlb(const std::vector<std::uint8_t>& glb, const scene::ChartOptions& charts) {
  Loaded loaded;
  loaded.scene = valueOf(scene::importScene(valueOf(scene::parseDocument("stress.glb", glb))));
  loaded.patches = std::make_shared<const scene::PatchScene>(valueOf(scene::buildPatchScene(loaded.scene, charts)));
  loaded.materials = scene::shadePatches(loaded.scene, *loaded.patches);
  return loaded;
}

Loaded load(const test_scenes::TestScene& scene, std::uint64_t texels) {
  scene::ChartOptions charts;
  charts.texel_budget = texels;
  return loadGlb(test_scenes::encodeGlb(scene), charts);
}

test_scenes::TestScene litRoom(double scale, glm::dvec3 offset_m) {
  test_scenes::TestScene scene;
  scene.name = "lit_room";
  const auto white = scene.add({"white", {0.7, 0.7, 0.7}, {0, 0, 0}});
  const auto red = scene.add({"red", {0.7, 0.1, 0.1}, {0, 0, 0}});
  const auto blue = scene.add({"blue", {0.2, 0.3, 0.7}, {0, 0, 0}});
  const auto light = scene.add({"light", {0.5, 0.5, 0.5}, {30, 25, 20}});
  test_scenes::Object room{"room", {}, {}}, block{"block", {}, {}};
  appendBox(room, glm::dvec3(0.0), {2.0, 1.5, 2.5}, {red, white, white, white, white, white}, test_scenes::kNoFace,
            true);
  appendBox(block, {0.5, 0.25, 0.75}, {1.25, 0.75, 1.5}, test_scenes::allFaces(blue));
  scene.objects = {room, block, test_scenes::makeCeilingLamp("lamp", {1.0, 1.25, 1.25}, 0.5, 0.5, white, light)};
  for (auto& object : scene.objects) {
    object.origin = scale * object.origin + offset_m;
    for (auto& polygon : object.polygons) {
      for (auto& corner : polygon.corners) corner = scale * corner + offset_m;
    }
  }
  return scene;
}

void paint(Loaded& loaded, float reflectance) { loaded.materials.reflectance.fill(glm::vec3(reflectance)); }

Solve::Solve(const Loaded& loaded, const solver::SolverSettings& settings, int workers) : patches_(loaded.patches) {
  transport_ =
      valueOf(workers == 0 ? gpu::makeInProcessTransport() : gpu::makeWorkerTransport({workers, RADIOSITY_GL_WORKER}));
  if (const auto set = transport_->setScene(patches_); !set) throw std::runtime_error(set.error().text());
  solver_ = solver::makeSolver(patches_, loaded.materials, *transport_, settings, {loaded.scene.lights, {}});
}

bool Solve::run(int most_steps) {
  for (int i = 0; i < most_steps; ++i) {
    const auto outcome = valueOf(solver_->step());
    if (outcome == solver::StepOutcome::kConverged) return true;
    if (outcome == solver::StepOutcome::kExhausted) return false;
  }
  return false;
}

bool Solve::edit(const scene::PatchMaterials& materials) {
  solver_->setMaterials(materials);
  return run();
}

FromConstant compareToConstant(const Solve& solve, double exact) {
  double area = 0.0, sum = 0.0, square = 0.0;
  solve.eachLeaf([&](std::uint32_t, double a, const glm::dvec3& h) {
    for (int c = 0; c < 3; ++c) {
      area += a;
      sum += a * (h[c] / exact - 1.0);
      square += a * (h[c] / exact - 1.0) * (h[c] / exact - 1.0);
    }
  });
  return {sum / area, std::sqrt(square / area)};
}

double largestDifference(const Solve& a, const Solve& b, double scale_of_b) {
  double worst = 0.0, square = 0.0, area = 0.0;
  const auto of_b = b.solver().irradiance();
  a.eachLeaf([&](std::uint32_t node, double leaf, const glm::dvec3& h) {
    const glm::dvec3 off = h - scale_of_b * glm::dvec3(of_b[node]);
    worst = std::max({worst, std::abs(off.x), std::abs(off.y), std::abs(off.z)});
    square += leaf * glm::dot(h, h);
    area += 3.0 * leaf;
  });
  return square > 0.0 ? worst / std::sqrt(square / area) : worst;
}

void expectSound(const Solve& solve) {
  solve.eachLeaf([](std::uint32_t node, double, const glm::dvec3& h) {
    for (int c = 0; c < 3; ++c) {
      ASSERT_TRUE(std::isfinite(h[c])) << "node " << node;
      ASSERT_GE(h[c], 0.0) << "node " << node;
    }
  });
  const auto e = solve.solver().energy();
  for (std::size_t c = 0; c < 3; ++c) {
    const double sum = e.absorbed[c] + e.specular[c] + e.escaped[c] + e.backface[c] + e.unshot[c] + e.imbalance[c];
    EXPECT_NEAR(sum, e.emitted[c], 1e-6 * e.emitted[c]);
  }
}

}  // namespace radiosity::accuracy
