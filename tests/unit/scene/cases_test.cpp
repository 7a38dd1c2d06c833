// Small inputs, each beside one that says the same in another way and is known to be right: both must become the same
// scene.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {
namespace {

namespace fs = std::filesystem;

class Cases : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(folder_)) GTEST_SKIP() << "no shared cases here";
  }

  [[nodiscard]] Scene read(const std::string& name) const {
    std::ifstream file(folder_ / (name + ".glb"), std::ios::binary);
    const Bytes bytes{std::istreambuf_iterator<char>(file), {}};
    const auto document = parseDocument(name + ".glb", bytes);
    EXPECT_TRUE(document) << name;
    auto scene = importScene(*document);
    EXPECT_TRUE(scene) << scene.error().text();
    return std::move(*scene);
  }

  /// Of every patch, to what 8 bits of a texture and rounding leave.
  void expectSameReflectance(const std::string& one, const std::string& other) const {
    const Scene a = read(one), b = read(other);
    ChartOptions options;
    options.texel_budget = 2000;
    const auto charts_a = buildPatchScene(a, options).value(), charts_b = buildPatchScene(b, options).value();
    ASSERT_EQ(charts_a.nodeCount(), charts_b.nodeCount());
    const auto in_a = shadePatches(a, charts_a), in_b = shadePatches(b, charts_b);
    for (std::uint32_t n = 0; n < charts_a.nodeCount(); ++n) {
      ASSERT_EQ(charts_a.node_area[n], charts_b.node_area[n]);
      if (!(charts_a.node_area[n] > 0.0F)) continue;
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(in_a.reflectance[n][c], in_b.reflectance[n][c], 1e-5) << n;
    }
  }

  const fs::path folder_ = fs::path(RADIOSITY_SHARED_DIR) / "cases";
};

TEST_F(Cases, aMetallicAtlasReadOnItsDielectricHalfIsNoMetal) {
  expectSameReflectance("metal-atlas-dielectric-half", "metal-atlas-none");
}

TEST_F(Cases, coloursBehindACutOutDoNotMatter) { expectSameReflectance("mask-hidden-black", "mask-hidden-white"); }

TEST_F(Cases, specularGlossinessReflectsAsItsMetallicRoughnessTwin) {
  expectSameReflectance("specgloss", "specgloss-reference");
}

TEST_F(Cases, aSpotOfEqualConesIsOneWithAHardEdge) {
  const auto equal = read("spot-equal-cones"), reference = read("spot-reference");
  ASSERT_EQ(equal.lights.size(), 1U);
  auto light = equal.lights[0];
  light.inner_cone_rad = reference.lights.at(0).inner_cone_rad;
  EXPECT_EQ(light, reference.lights[0]);
  EXPECT_NEAR(equal.lights[0].inner_cone_rad, light.inner_cone_rad, 1.1e-3) << "the edge that the reference has";
  EXPECT_THAT(equal.warnings, testing::Contains(testing::HasSubstr("/spot/innerConeAngle")));
}

TEST_F(Cases, aMirroredCameraSeesWhatAPlainOneDoes) {
  const auto mirrored = read("camera-mirrored").cameras.at(0).world, plain = read("camera-plain").cameras.at(0).world;
  for (int c = 0; c < 4; ++c) EXPECT_EQ(mirrored[c], plain[c]);
}

/// Lamps of 100 cd hang 2 m above the origin of each plate: 100 lux are 1 m below them, 44.4 lux 1.5 m.
TEST_F(Cases, morphWeightsLiftEachPlateAsItsNodeSays) {
  const auto scene = read("pose-morph-weights");
  ASSERT_EQ(scene.instances.size(), 2U);
  const auto height = [&](std::size_t instance) {
    const auto& at = scene.instances[instance];
    return (at.world * glm::dvec4(scene.primitives[at.primitive].positions.at(0), 1.0)).y;
  };
  EXPECT_NEAR(height(0), 1.0, 1e-6);
  EXPECT_NEAR(height(1), 0.5, 1e-6);
}

}  // namespace
}  // namespace radiosity::scene
