#include "tests/accuracy/stress/leaves.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::accuracy {

solver::SolverSettings settingsOf(double target) {
  solver::SolverSettings settings;
  settings.target_error = target;
  return settings;
}

std::vector<LeafAt> wholeLeaves(const Solve& solve) {
  std::vector<LeafAt> leaves;
  const auto& patches = solve.patches();
  const auto light = solve.solver().irradiance();
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t side = 0; side < 2; ++side) {
      if (surface.first_node[side] == scene::kNone) continue;
      for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
        const auto& point = patches.leaves[surface.first_leaf + leaf];
        if (point.triangle == scene::kNone || !point.full) continue;
        const auto& frame = patches.triangles[point.triangle];
        const auto at = [&](std::uint32_t x, std::uint32_t y) {
          const auto unit =
              glm::dvec3(frame.origin) + double(x) * glm::dvec3(frame.du) + double(y) * glm::dvec3(frame.dv);
          return unit * patches.scale + patches.centre;
        };
        const auto x = leaf % surface.width, y = leaf / surface.width;
        const auto normal = glm::dvec3(side == 0 ? frame.normal : -frame.normal);
        const auto a = at(x, y), b = at(x + 1, y), c = at(x + 1, y + 1), d = at(x, y + 1);
        leaves.push_back(
            {{{{{a, b, c}, normal, oracle::kNoTriangle, {}}, {{a, c, d}, normal, oracle::kNoTriangle, {}}}},
             0.25 * (a + b + c + d),
             glm::dvec3(light[surface.first_node[side] + leaf]),
             surface.instance});
      }
    }
  }
  return leaves;
}

scene::ChartOptions texelsOf(double metres) {
  scene::ChartOptions charts;
  charts.texel_size_m = metres;
  return charts;
}

double offFromPathTracer(const Solve& solve, const test_scenes::TestScene& scene, std::size_t step,
                         std::uint32_t samples) {
  const auto leaves = wholeLeaves(solve);
  std::vector<oracle::Footprint> footprints;
  for (std::size_t i = 0; i < leaves.size(); i += step) footprints.push_back(leaves[i].footprint);
  oracle::PathOptions options;
  options.samples = samples;
  const auto truth = oracle::PathTracer(oracle::triangulate(scene)).irradiance(footprints, options);
  double square = 0.0, noise = 0.0, all = 0.0, sum = 0.0, sum_found = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    // The tracer takes the inside of a bulb with one side for that of a solid, where there is nothing to light.
    if (truth[i].mean_lux == glm::dvec3(0.0)) continue;
    const auto off = leaves[i * step].light - truth[i].mean_lux;
    square += glm::dot(off, off);
    noise += glm::dot(truth[i].standard_error, truth[i].standard_error);
    all += glm::dot(truth[i].mean_lux, truth[i].mean_lux);
    for (int c = 0; c < 3; ++c) sum += truth[i].mean_lux[c], sum_found += leaves[i * step].light[c];
  }
  testing::Test::RecordProperty("tracer_noise", std::to_string(std::sqrt(noise / all)));
  testing::Test::RecordProperty("rms", std::to_string(std::sqrt(square / all)));
  testing::Test::RecordProperty("mean", std::to_string(sum_found / sum - 1.0));
  EXPECT_NEAR(sum_found / sum, 1.0, 0.015);
  return std::sqrt(std::max(0.0, square - noise) / all);
}

}  // namespace radiosity::accuracy
