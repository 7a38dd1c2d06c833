// Lookups between fitted texels, against light that is known everywhere.
#include "server/scene/lightmap/texel_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "server/scene/charts/build.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

constexpr double kWide = 32.0;  ///< metres, as many leaves

/// A square floor, whose leaves are one metre wide.
PatchScene squareFloor() {
  Scene scene;
  place(scene, floorQuad(kWide));
  ChartOptions options;
  options.texel_size_m = 1.0;
  return buildPatchScene(scene, options).value();
}

/// From 0 to 1 about `edge`, over `width` texels.
double penumbra(double x, double edge, double width) {
  return width > 0.0 ? std::clamp((x - edge) / width + 0.5, 0.0, 1.0) : x > edge ? 1.0 : 0.0;
}

/// Along the rows of a side's texels: the same in all of them.
struct Rows {
  const Surface& surface;
  std::vector<glm::vec3> values;

  [[nodiscard]] double at(std::uint32_t x) const {
    return static_cast<double>(values[surface.first_node[0] + surface.width * (surface.height / 2) + x].x);
  }
  /// Square of what lookups are off by, over all but the ends.
  template <typename Field>
  [[nodiscard]] double offBy(const Field& field) const {
    double sum = 0.0;
    for (double x = 4.0; x < static_cast<double>(surface.width) - 4.0; x += 0.01) {
      const double place = x - 0.5, low = std::floor(place), part = place - low;
      const auto left = static_cast<std::uint32_t>(low);
      const double found = (1.0 - part) * at(left) + part * at(left + 1);
      sum += 0.01 * (found - field(x)) * (found - field(x));
    }
    return sum;
  }
};

/// What leaves have on average of a field of texel coordinates.
template <typename Field>
std::vector<glm::vec3> means(const PatchScene& patches, const Field& field) {
  constexpr int kParts = 200;
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(-1e9F));  // other levels must not be read
  const auto& surface = patches.surfaces[0];
  for (std::uint32_t x = 0; x < surface.width; ++x) {
    double mean = 0.0;
    for (int part = 0; part < kParts; ++part) mean += field(x + (part + 0.5) / kParts) / kParts;
    for (std::uint32_t y = 0; y < surface.height; ++y)
      values[surface.first_node[0] + y * surface.width + x] = glm::vec3(static_cast<float>(mean));
  }
  return values;
}

/// Of what lookups are off by without a fit, as squares, over edges everywhere within a texel.
double partLeft(double width, double* beyond = nullptr) {
  const auto patches = squareFloor();
  double before = 0.0, after = 0.0;
  for (int i = 0; i < 10; ++i) {
    const double edge = 15.05 + 0.1 * i;
    const auto field = [&](double x) { return penumbra(x, edge, width); };
    const Rows plain{patches.surfaces[0], means(patches, field)};
    const Rows fitted{patches.surfaces[0], fitTexels(patches, {plain.values, {}})};
    before += plain.offBy(field);
    after += fitted.offBy(field);
    for (std::uint32_t x = 0; beyond != nullptr && x < patches.surfaces[0].width; ++x)
      *beyond = std::max(*beyond, std::max(fitted.at(x) - 1.0, -fitted.at(x)));
  }
  return after / before;
}

TEST(TexelFit, LookupsAreCloserToPenumbrasThanWithTheLeavesMeans) {
  // The sums of the same splines, found apart from this code: 0.721, 0.475, 0.494.
  EXPECT_NEAR(partLeft(1.0), 0.721, 0.005);
  EXPECT_NEAR(partLeft(2.0), 0.475, 0.005);
  EXPECT_NEAR(partLeft(4.0), 0.494, 0.005);
}

TEST(TexelFit, AnEdgeHasNoRimThatOneSees) {
  double beyond = 0.0;
  EXPECT_NEAR(partLeft(0.0, &beyond), 0.947, 0.005);
  EXPECT_LT(beyond, 0.0626);  // half of an eighth
}

TEST(TexelFit, WhatChangesEvenlyStays) {
  const auto patches = squareFloor();
  const Rows ramp{patches.surfaces[0], means(patches, [](double x) { return 10.0 + x; })};
  const Rows fitted{patches.surfaces[0], fitTexels(patches, {ramp.values, {}})};
  for (std::uint32_t x = 0; x < patches.surfaces[0].width; ++x) EXPECT_NEAR(fitted.at(x), ramp.at(x), 1e-4);
}

// Noise bends as the edge of a shadow does: the halves tell it apart.
TEST(TexelFit, NoiseDoesNotGrow) {
  const auto patches = squareFloor();
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0.0F, 1.0F);
  LeafLight light{std::vector<glm::vec3>(patches.nodeCount()), std::vector<glm::vec3>(patches.nodeCount())};
  for (std::size_t n = 0; n < patches.nodeCount(); ++n) {
    for (int c = 0; c < 3; ++c) {
      const float one = noise(random), other = noise(random);
      light.mean[n][c] = 10.0F + 0.5F * (one + other);
      light.difference[n][c] = one - other;
    }
  }
  const auto square = [&](const std::vector<glm::vec3>& values) {
    double sum = 0.0;
    const auto& surface = patches.surfaces[0];
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf)
      for (int c = 0; c < 3; ++c) {
        const double off = static_cast<double>(values[surface.first_node[0] + leaf][c]) - 10.0;
        sum += off * off;
      }
    return sum;
  };
  EXPECT_LT(square(fitTexels(patches, light)), 1.15 * square(light.mean));
  EXPECT_GT(square(fitTexels(patches, {light.mean, {}})), 1.5 * square(light.mean)) << "the test sees nothing";
}

// The visible part of a leaf at a slanted edge is not where its texel is.
TEST(TexelFit, TexelsOfLeavesSeenInPartSayWhatIsInTheirMiddle) {
  Primitive p;
  p.positions = {{0, 0, 0}, {1, 0, 3}, {4, 0, 1}};
  p.indices = {0, 1, 2};
  ChartOptions options;
  options.texel_budget = 500;
  const auto patches = buildPatchScene(sceneOf(p), options).value();
  const auto& surface = patches.surfaces[0];
  const auto ramp = [](const glm::vec2& texel) { return 10.0F + texel.x + 0.5F * texel.y; };
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(0.0F));
  for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
    const auto& point = patches.leaves[surface.first_leaf + leaf];
    const glm::vec2 corner(leaf % surface.width, leaf / surface.width);
    float mean = ramp(point.full ? corner + 0.5F : point.texel);
    if (point.hasSpots()) {
      mean = 0.0F;
      const auto count = patches.spotCount(point);
      for (std::uint32_t k = 0; k < count; ++k) mean += ramp(patches.spot(point, k).texel) / static_cast<float>(count);
    }
    values[surface.first_node[0] + leaf] = glm::vec3(mean);
  }
  const auto fitted = fitTexels(patches, {values, {}});
  double before = 0.0, after = 0.0;
  int in_part = 0;
  for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
    const auto node = surface.first_node[0] + leaf;
    if (patches.node_area[node] < 0.25F * surface.texel_area || patches.leaves[surface.first_leaf + leaf].full)
      continue;
    const float truth = ramp(glm::vec2(leaf % surface.width, leaf / surface.width) + 0.5F);
    before += std::pow(values[node].x - truth, 2.0);
    after += std::pow(fitted[node].x - truth, 2.0);
    ++in_part;
  }
  EXPECT_GT(in_part, 20);
  EXPECT_LT(after, 0.4 * before);
}

TEST(TexelFit, WhatIsToBeShownAsItIsStays) {
  const auto patches = squareFloor();
  const auto edge = means(patches, [](double x) { return penumbra(x, 15.3, 0.0); });
  EXPECT_EQ(fitTexels(patches, {edge, {}, true}), edge);
}

}  // namespace
}  // namespace radiosity::scene::test
