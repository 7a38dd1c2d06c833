// Probes against the path tracer: its irradiance for many normals at a place tells the spherical harmonics there, since
// each band of them is that of radiance times pi, 2 pi / 3 and pi / 4 (Ramamoorthi and Hanrahan 2001).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "tests/accuracy/solve_run.h"
#include "tests/oracle/gltf_file.h"
#include "tests/oracle/path_tracer.h"

namespace radiosity::accuracy {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::numbers::pi;

constexpr std::size_t kCount = 9;
using Harmonics = std::array<glm::dvec3, kCount>;

std::array<double, kCount> harmonicBasis(const glm::dvec3& d) {
  const double k0 = std::sqrt(0.25 / pi), k1 = std::sqrt(0.75 / pi), k2 = std::sqrt(3.75 / pi);
  return {k0,
          k1 * d.y,
          k1 * d.z,
          k1 * d.x,
          k2 * d.x * d.y,
          k2 * d.y * d.z,
          std::sqrt(1.25 / pi) * (1.5 * d.z * d.z - 0.5),
          k2 * d.x * d.z,
          0.5 * k2 * (d.x * d.x - d.y * d.y)};
}

struct Node {
  glm::dvec3 normal{0.0};
  double weight = 0.0;  ///< solid angle
};

/// Six rows of Gauss and Legendre and twelve columns: exact for products of harmonics up to band 11 in all. Of what
/// irradiance has in bands 4, 6 and 8 nothing is then taken for band 2 or less.
std::vector<Node> sphereRule() {
  constexpr std::array kHeights{0.2386191860831969, 0.6612093864662645, 0.9324695142031521};
  constexpr std::array kWeights{0.4679139345726910, 0.3607615730481386, 0.1713244923791704};
  std::vector<Node> nodes;
  for (std::size_t row = 0; row < 3; ++row) {
    for (const double side : {-1.0, 1.0}) {
      for (int column = 0; column < 12; ++column) {
        const double z = side * kHeights[row], radius = std::sqrt(1.0 - z * z), angle = (column + 0.5) * pi / 6.0;
        nodes.push_back({{radius * std::cos(angle), radius * std::sin(angle), z}, kWeights[row] * pi / 6.0});
      }
    }
  }
  return nodes;
}

struct Truth {
  Harmonics light{}, error{};
};

std::vector<Truth> traced(const oracle::TriangleScene& scene, const std::vector<glm::dvec3>& places,
                          std::uint32_t samples) {
  const auto rule = sphereRule();
  std::vector<oracle::Footprint> footprints;
  for (const auto& place : places)
    for (const auto& node : rule) footprints.push_back(oracle::Footprint::at(place, node.normal));
  const auto found =
      oracle::PathTracer(scene).irradiance(footprints, {.samples = samples, .seed = 7, .leave_out_buried = false});
  std::vector<Truth> truths;
  for (std::size_t p = 0; p < places.size(); ++p) {
    auto& truth = truths.emplace_back();
    for (std::size_t n = 0; n < rule.size(); ++n) {
      const auto& irradiance = found[p * rule.size() + n];
      const auto harmonics = harmonicBasis(rule[n].normal);
      for (std::size_t h = 0; h < kCount; ++h) {
        const double of_band = h == 0 ? pi : h < 4 ? 2.0 * pi / 3.0 : pi / 4.0;
        const double weight = rule[n].weight * harmonics[h] / of_band;
        truth.light[h] += weight * irradiance.mean_lux;
        truth.error[h] += weight * weight * irradiance.standard_error * irradiance.standard_error;
      }
    }
  }
  return truths;
}

fs::path probedSceneFileOf(const std::string& name) {
  const auto built = fs::path(RADIOSITY_BINARY_DIR) / "scenes" / (name + ".glb");
  return fs::exists(built) ? built : fs::path(RADIOSITY_SHARED_DIR) / "scenes" / (name + ".glb");
}

struct Probe {
  glm::dvec3 place{0.0};
  Harmonics light{}, error{};
};

/// Of the first grid, those that were measured, every so many.
std::vector<Probe> readProbes(const fs::path& file, std::size_t most) {
  std::ifstream in(file);
  const auto grid = json::parse(in).at("grids").at(0);
  const auto triple = [](const json& of) { return glm::dvec3(of.at(0), of.at(1), of.at(2)); };
  const std::array<std::size_t, 3> counts = grid.at("counts");
  std::vector<Probe> all;
  for (std::size_t i = 0; i < counts[0] * counts[1] * counts[2]; ++i) {
    if (grid.at("ring").at(i) != 0) continue;
    auto& probe = all.emplace_back();
    const std::array<double, 3> cell{static_cast<double>(i % counts[0]), static_cast<double>(i / counts[0] % counts[1]),
                                     static_cast<double>(i / counts[0] / counts[1])};
    probe.place = triple(grid.at("first"));
    for (std::size_t axis = 0; axis < 3; ++axis) probe.place += cell[axis] * triple(grid.at("steps").at(axis));
    for (std::size_t h = 0; h < kCount; ++h) {
      for (int c = 0; c < 3; ++c) {
        const auto at = 27 * i + 3 * h + static_cast<std::size_t>(c);
        probe.light[h][c] = grid.at("light").at(at);
        probe.error[h][c] = grid.at("standardError").at(at);
      }
    }
  }
  std::vector<Probe> some;
  const auto step = std::max<std::size_t>(1, all.size() / most);
  for (std::size_t i = step / 2; i < all.size() && some.size() < most; i += step) some.push_back(all[i]);
  return some;
}

struct Case {
  std::string scene, spacing;
  /// Of the light, what texels are off by together: radiance of surfaces is that of their texels.
  double texels = 0.005;
};

class SolvedProbes : public testing::TestWithParam<Case> {};

TEST_P(SolvedProbes, HaveTheLightOfThePathTracerAndTellTheirErrorTruly) {
  const auto& test = GetParam();
  const auto file = probedSceneFileOf(test.scene);
  if (!fs::exists(file)) GTEST_SKIP() << file << " is not there";
  const auto folder = fs::path(RADIOSITY_BINARY_DIR) / "accuracy" / ("SolvedProbes." + test.scene);
  fs::create_directories(folder);
  std::vector<std::string> options{"--error",  "0.02",       "--time-limit", "60",
                                   "--probes", test.spacing, "--probes-out", (folder / "probes.json").string()};
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder, options, true);
  ASSERT_TRUE(run.exit_code == 0 || run.exit_code == 3) << run.last_line;
  const auto probes = readProbes(folder / "probes.json", 24);
  ASSERT_GE(probes.size(), 12U);
  const auto scene = oracle::readGlb(file);
  std::vector<glm::dvec3> places;
  for (const auto& probe : probes) places.push_back(probe.place);
  const auto truth = traced(scene, places, 512);
  glm::dvec3 sum(0.0), of_truth(0.0), sum_variance(0.0);
  double off = 0.0, stated = 0.0;  // squares, both by what the light of the probe is
  for (std::size_t p = 0; p < probes.size(); ++p) {
    sum += probes[p].light[0];
    of_truth += truth[p].light[0];
    sum_variance += probes[p].error[0] * probes[p].error[0] + truth[p].error[0];
    for (int c = 0; c < 3; ++c) {
      const double light = truth[p].light[0][c] * truth[p].light[0][c];
      if (!(light > 0.0)) continue;
      for (std::size_t h = 0; h < kCount; ++h) {
        off += (std::pow(probes[p].light[h][c] - truth[p].light[h][c], 2.0) - truth[p].error[h][c]) / light;
        stated += std::pow(probes[p].error[h][c], 2.0) / light;
      }
    }
  }
  const double of_texels = std::pow(test.texels, 2.0) * 3.0 * kCount * static_cast<double>(probes.size());
  const double ratio = std::sqrt((stated + of_texels) / std::max(off, of_texels));
  RecordProperty("ratio", std::to_string(ratio));
  RecordProperty("true", std::to_string(std::sqrt(off / (27.0 * static_cast<double>(probes.size())))));
  RecordProperty("stated", std::to_string(std::sqrt(stated / (27.0 * static_cast<double>(probes.size())))));
  // What the solve was asked for, and three standard errors.
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(sum[c] / of_truth[c], 1.0, 0.02 + 3.0 * std::sqrt(sum_variance[c]) / of_truth[c]) << c;
  EXPECT_GT(ratio, 1.0 / 1.5);
  EXPECT_LT(ratio, 1.5);
}

// Mirrors, glass, lamps and the sky once each; what is plainer is in all of them.
INSTANTIATE_TEST_SUITE_P(Scenes, SolvedProbes,
                         testing::Values(Case{"room_small_mirror", "0.8"}, Case{"room_small_tinted", "0.8"},
                                         Case{"room_lights", "0.8"}, Case{"room_small_open", "0.8"}),
                         [](const auto& info) { return info.param.scene; });

}  // namespace
}  // namespace radiosity::accuracy
