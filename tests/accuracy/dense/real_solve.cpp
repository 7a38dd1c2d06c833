#include "tests/accuracy/dense/real_solve.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <stdexcept>
#include <tuple>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/pipeline/make_solver.h"
#include "tests/scenes/glb_writer.h"

namespace radiosity::accuracy {
namespace {

template <typename T>
T valueOf(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().text());
  return std::move(*result);
}

oracle::Corners cornersOf(const scene::PatchScene& patches, const scene::Surface& surface, std::uint32_t x,
                          std::uint32_t y) {
  const auto& frame = patches.triangles[surface.first_triangle];
  const auto at = [&](std::uint32_t u, std::uint32_t v) {
    const glm::dvec3 unit =
        glm::dvec3(frame.origin) + double(u) * glm::dvec3(frame.du) + double(v) * glm::dvec3(frame.dv);
    return unit * patches.scale + patches.centre;
  };
  oracle::Corners corners{at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)};
  if (glm::dot(oracle::unitNormal(corners), glm::dvec3(frame.normal)) < 0.0) {
    std::reverse(corners.begin(), corners.end());
  }
  return corners;
}

std::vector<SolvedTexel> texelsOf(const scene::PatchScene& patches, const scene::PatchMaterials& materials,
                                  const std::vector<glm::vec3>& irradiance) {
  std::vector<SolvedTexel> texels;
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    const auto& surface = patches.surfaces[s];
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      if (!surface.planar || !patches.leaves[surface.first_leaf + leaf].full) {
        throw std::runtime_error("a texel is not whole: choose a size that divides every edge");
      }
      const auto node = surface.first_node[0] + leaf;
      texels.push_back({{cornersOf(patches, surface, leaf % surface.width, leaf / surface.width),
                         materials.reflectance[node], materials.emission[node]},
                        irradiance[node],
                        s,
                        leaf % surface.width,
                        leaf / surface.width});
    }
  }
  return texels;
}

}  // namespace

std::vector<oracle::DensePatch> RealSolve::patches() const {
  std::vector<oracle::DensePatch> all;
  for (const auto& texel : texels) all.push_back(texel.patch);
  return all;
}

RealSolve solveReally(const test_scenes::TestScene& scene, const SolveOptions& options) {
  const auto document = valueOf(scene::parseDocument(scene.name + ".glb", test_scenes::encodeGlb(scene)));
  const auto imported = valueOf(scene::importScene(document));
  scene::ChartOptions charts;
  charts.texel_size_m = options.texel_size_m;
  const auto patches = std::make_shared<const scene::PatchScene>(valueOf(scene::buildPatchScene(imported, charts)));
  const auto materials = scene::shadePatches(imported, *patches);
  const auto transport = valueOf(gpu::makeInProcessTransport());
  if (const auto set = transport->setScene(patches); !set) throw std::runtime_error(set.error().text());
  solver::SolverSettings settings;
  settings.target_error = options.target_error;
  settings.seed = options.seed;
  settings.method = options.method;
  settings.within_leaves = false;  // the dense solution is one of lumped patches
  const auto solver = solver::makeSolver(patches, materials, *transport, settings);
  auto outcome = solver::StepOutcome::kSlice;
  while (outcome != solver::StepOutcome::kConverged && outcome != solver::StepOutcome::kExhausted)
    outcome = valueOf(solver->step());
  return {texelsOf(*patches, materials, solver->irradiance()), solver->error(), solver->energy(), solver->rounds()};
}

Difference compare(const RealSolve& solve, std::span<const glm::dvec3> dense_irradiance_lux) {
  double square = 0.0, difference = 0.0, area = 0.0, received = 0.0, expected = 0.0, worst = 0.0;
  std::map<std::uint32_t, std::pair<glm::dvec3, double>> surfaces;
  for (std::size_t i = 0; i < solve.texels.size(); ++i) {
    const auto& dense = dense_irradiance_lux[i];
    const glm::dvec3 off = solve.texels[i].irradiance_lux - dense;
    const double a = oracle::area(solve.texels[i].patch.corners);
    area += a;
    square += a * glm::dot(dense, dense);
    difference += a * glm::dot(off, off);
    worst = std::max({worst, std::abs(off.x), std::abs(off.y), std::abs(off.z)});
    received += a * (dense.x + dense.y + dense.z + off.x + off.y + off.z);
    expected += a * (dense.x + dense.y + dense.z);
    auto& [sum, surface_area] = surfaces[solve.texels[i].surface];
    sum += a * off;
    surface_area += a;
  }
  const double typical = std::sqrt(square / (3.0 * area));
  Difference found{std::sqrt(difference / square), worst / typical, received / expected - 1.0, 0.0};
  for (const auto& [index, surface] : surfaces) {
    const glm::dvec3 off = glm::abs(surface.first / surface.second) / typical;
    found.surface = std::max({found.surface, off.x, off.y, off.z});
  }
  return found;
}

double spreadInsideTexels(const RealSolve& solve, const oracle::DenseSolution& dense,
                          std::span<const oracle::Corners> occluders) {
  constexpr int kPoints = 3;  // a side
  double square = 0.0, spread = 0.0;
  for (std::size_t i = 0; i < solve.texels.size(); ++i) {
    const auto& c = solve.texels[i].patch.corners;
    const auto normal = oracle::unitNormal(c);
    const double a = oracle::area(c) / (kPoints * kPoints);
    for (int p = 0; p < kPoints * kPoints; ++p) {
      const double u = (p % kPoints + 0.5) / kPoints, v = (p / kPoints + 0.5) / kPoints;
      const glm::dvec3 point = c[0] + u * (c[1] - c[0]) + v * (c[3] - c[0]);
      glm::dvec3 h(0.0);
      for (std::size_t j = 0; j < solve.texels.size(); ++j) {
        h += oracle::pointToPolygon(point, normal, solve.texels[j].patch.corners, occluders) * dense.radiosity_lux[j];
      }
      const glm::dvec3 off = h - dense.irradiance_lux[i];
      spread += a * glm::dot(off, off);
    }
    square += a * kPoints * kPoints * glm::dot(dense.irradiance_lux[i], dense.irradiance_lux[i]);
  }
  return std::sqrt(spread / square);
}

double spreadInsideBlocks(const RealSolve& solve, std::span<const glm::dvec3> dense_irradiance_lux,
                          std::uint32_t side) {
  std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>, std::pair<glm::dvec3, double>> blocks;
  const auto blockOf = [&](const SolvedTexel& t) -> auto& { return blocks[{t.surface, t.x / side, t.y / side}]; };
  for (std::size_t i = 0; i < solve.texels.size(); ++i) {
    const double a = oracle::area(solve.texels[i].patch.corners);
    auto& [sum, area] = blockOf(solve.texels[i]);
    sum += a * dense_irradiance_lux[i];
    area += a;
  }
  double square = 0.0, spread = 0.0;
  for (std::size_t i = 0; i < solve.texels.size(); ++i) {
    const double a = oracle::area(solve.texels[i].patch.corners);
    const auto& [sum, area] = blockOf(solve.texels[i]);
    const glm::dvec3 off = sum / area - dense_irradiance_lux[i];
    spread += a * glm::dot(off, off);
    square += a * glm::dot(dense_irradiance_lux[i], dense_irradiance_lux[i]);
  }
  return std::sqrt(spread / square);
}

}  // namespace radiosity::accuracy
