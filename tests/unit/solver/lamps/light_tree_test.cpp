// Lamps that are drawn from a tree: chances are what is drawn, and no lamp that shines at a receiver is left out.
#include "server/solver/lamps/light_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <random>

#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::solver {
namespace {

class LightTreeTest : public testing::Test {
 protected:
  /// Triangles of all sizes that face all ways, some in one place.
  LightTree make(std::uint32_t count, float size) {
    std::vector<LightPolygon> lights;
    std::vector<float> strengths;
    for (std::uint32_t i = 0; i < count; ++i) {
      LightPolygon light;
      const auto centre = i % 7 == 6 ? glm::vec3(lights.back().corners[0]) : point();
      for (std::size_t k = 0; k < 3; ++k) light.corners[k] = centre + size * point();
      const auto cross = glm::cross(light.corners[1] - light.corners[0], light.corners[2] - light.corners[0]);
      light.normal = glm::normalize(cross);
      light.area = 0.5 * static_cast<double>(glm::length(cross));
      light.key = 2 * i;
      lights.push_back(light);
      strengths.push_back(std::exp2(4.0F * point().x));
    }
    return {std::move(lights), strengths};
  }
  glm::vec3 point() { return {uniform_(random_), uniform_(random_), uniform_(random_)}; }

  std::mt19937 random_{11};
  std::uniform_real_distribution<float> uniform_{-0.5F, 0.5F};
};

double formFactor(const LightPolygon& light, const glm::vec3& from, const glm::vec3& normal) {
  if (glm::dot(from - light.corners[0], light.normal) <= 0.0F) return 0.0;
  return polygonFormFactor(from, normal, std::span(light.corners).first(light.corner_count));
}

TEST_F(LightTreeTest, ChancesAreWhatIsDrawn) {
  constexpr std::uint32_t kDraws = 200'000;
  const auto tree = make(300, 0.05F);
  for (int receiver = 0; receiver < 10; ++receiver) {
    const auto from = point(), normal = glm::normalize(point());
    std::map<std::uint32_t, std::pair<std::uint32_t, double>> drawn;
    for (std::uint32_t i = 0; i < kDraws; ++i) {
      const auto draw = tree.draw(from, normal, (i + 0.5) / kDraws);
      ++drawn[draw.light].first;
      drawn[draw.light].second = draw.chance;
    }
    // In vain, where bounds hold more than the lights within them.
    double all = drawn.contains(scene::kNone) ? static_cast<double>(drawn[scene::kNone].first) / kDraws : 0.0;
    drawn.erase(scene::kNone);
    for (const auto& [light, times] : drawn) {
      // The draws of a light lie in one interval of `u`, so that all but those at its ends are counted exactly.
      EXPECT_NEAR(times.first, times.second * kDraws, 1.5) << light;
      all += times.second;
    }
    EXPECT_LE(all, 1.0 + 1e-4);
    EXPECT_GE(all, 0.995);
  }
}

TEST_F(LightTreeTest, NothingThatShinesAtAReceiverIsLeftOut) {
  for (const float size : {0.001F, 0.1F, 1.0F}) {
    const auto tree = make(60, size);
    for (int receiver = 0; receiver < 20; ++receiver) {
      const auto from = point(), normal = glm::normalize(point());
      std::map<std::uint32_t, double> drawn;
      for (std::uint32_t i = 0; i < 100'000; ++i) drawn[tree.draw(from, normal, (i + 0.5) / 100'000).light] += 1e-5;
      double all = 0.0, found = 0.0;
      for (std::uint32_t light = 0; light < tree.lights().size(); ++light) {
        const double brings = tree.strength(light) * formFactor(tree.lights()[light], from, normal);
        all += brings;
        if (drawn.contains(light)) found += brings;
      }
      EXPECT_NEAR(found, all, 1e-4 * all) << size;
    }
  }
}

TEST_F(LightTreeTest, WhatFewDrawsSayIsNearerToTheTruthThanDrawnByFlux) {
  const auto tree = make(2000, 0.01F);
  double by_tree = 0.0, by_flux = 0.0;
  constexpr int kReceivers = 200, kDraws = 16;
  for (int receiver = 0; receiver < kReceivers; ++receiver) {
    const auto from = point(), normal = glm::normalize(point());
    const auto brings = [&](std::uint32_t light) {
      return tree.strength(light) * formFactor(tree.lights()[light], from, normal);
    };
    double all = 0.0, drawn = 0.0, flux = 0.0;
    for (std::uint32_t light = 0; light < tree.lights().size(); ++light) all += brings(light);
    for (int i = 0; i < kDraws; ++i) {
      double u = (i + 0.5) / kDraws;
      if (const auto draw = tree.draw(from, normal, u); draw.light != scene::kNone)
        drawn += brings(draw.light) / draw.chance / kDraws;
      const auto light = tree.byFlux(u);
      flux += brings(light) * tree.flux() / (tree.lights()[light].area * tree.strength(light)) / kDraws;
    }
    by_tree += (drawn / all - 1.0) * (drawn / all - 1.0) / kReceivers;
    by_flux += (flux / all - 1.0) * (flux / all - 1.0) / kReceivers;
  }
  EXPECT_LT(by_tree, 0.1 * by_flux);  // draws a tenth as many for the same error
}

TEST_F(LightTreeTest, ByFluxEachLightIsDrawnAsOftenAsItSends) {
  const auto tree = make(100, 0.1F);
  std::vector<double> drawn(100, 0.0);
  for (std::uint32_t i = 0; i < 100'000; ++i) {
    double u = (i + 0.5) / 100'000;
    const auto light = tree.byFlux(u);
    ASSERT_TRUE(u >= 0.0 && u < 1.0);
    drawn[light] += 1.0;
  }
  for (std::uint32_t light = 0; light < 100; ++light)
    EXPECT_NEAR(drawn[light] / 100'000, tree.lights()[light].area * tree.strength(light) / tree.flux(), 1.1e-5);
}

TEST(LightTree, OneLightIsAlwaysDrawnAndNoneNever) {
  LightPolygon light;
  light.corners = {glm::vec3(0.0F), {0.1F, 0.0F, 0.0F}, {0.0F, 0.1F, 0.0F}};
  light.normal = {0.0F, 0.0F, 1.0F};
  light.area = 0.005;
  const std::vector<float> strength{1.0F};
  const LightTree one({light}, strength);
  const auto draw = one.draw({0.0F, 0.0F, 0.5F}, {0.0F, 0.0F, -1.0F}, 0.3);
  EXPECT_EQ(draw.light, 0U);
  EXPECT_EQ(draw.chance, 1.0);
  EXPECT_EQ(one.draw({0.0F, 0.0F, -0.5F}, {0.0F, 0.0F, 1.0F}, 0.3).light, scene::kNone);  // behind it
  EXPECT_EQ(one.draw({0.0F, 0.0F, 0.5F}, {0.0F, 0.0F, 1.0F}, 0.3).light, scene::kNone);   // facing away
  EXPECT_EQ(LightTree({}, {}).draw({}, {0.0F, 0.0F, 1.0F}, 0.3).light, scene::kNone);
}

}  // namespace
}  // namespace radiosity::solver
