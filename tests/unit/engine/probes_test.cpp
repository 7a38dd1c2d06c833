// Grids of probes: they come and change by patches, without any change of the light, and follow edits of light.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <utility>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/block_room.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using testing::HasSubstr;

class ProbeGrids : public EngineTest {
 protected:
  Result<engine::ProbeReport> probes(engine::ProbeRequest request = {}) {
    return call<engine::ProbeReport>([&](auto done) { engine().probes(request, "test", std::move(done)); });
  }
  Result<engine::PatchOutcome> add(const std::string& place, const std::string& spacing = "0.5") {
    const auto node = std::to_string(nlohmann::json::parse(sceneText())["nodes"].size());
    return patch(R"([{"op": "add", "path": "/nodes/-", "value": {"name": "grid", "translation": )" + place +
                 R"(, "extras": {"radiosityProbes": {"size": [1, 1, 1], "spacing": )" + spacing +
                 R"(}}}}, {"op": "add", "path": "/scenes/0/nodes/-", "value": )" + node + "}]");
  }
  /// Of probes that are asked for again, and of the same once others were asked for, so that they are made anew.
  void expectAnew(double spacing, const std::vector<float>& before) {
    const auto kept = probes({spacing});
    ASSERT_TRUE(kept) << kept.error().text();
    ASSERT_TRUE(probes({1.7 * spacing}));
    const auto made = probes({spacing});
    ASSERT_TRUE(made) << made.error().text();
    EXPECT_EQ(kept->grids[0].values, made->grids[0].values);
    EXPECT_NE(kept->grids[0].values, before);
  }
};

constexpr std::size_t kRing = engine::kProbeValues - 1;

TEST_F(ProbeGrids, OfASceneWithoutAnyAreNotFound) {
  solve(blockRoom());
  const auto report = probes();
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(report.error().message, HasSubstr("radiosityProbes"));
}

TEST_F(ProbeGrids, ThatPatchesBringHaveLightAndChangeNone) {
  solve(blockRoom());
  const auto before = light();
  const auto added = add("[1, 1.2, 1]");
  ASSERT_TRUE(added) << added.error().text();
  EXPECT_EQ(added->affected_surfaces, 0U);
  EXPECT_EQ(added->affected_shots, 0U);
  const auto report = probes();
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->revision, added->revision);
  ASSERT_EQ(report->grids.size(), 1U);
  const auto& grid = report->grids.front();
  EXPECT_EQ(grid.name, "grid");
  EXPECT_EQ(grid.counts, (std::array<std::uint32_t, 3>{2, 2, 2}));
  EXPECT_NEAR(grid.first.x, 0.75, 1e-12);
  ASSERT_EQ(grid.values.size(), 8 * engine::kProbeValues);
  for (std::size_t i = 0; i < 8; ++i) {
    const auto* probe = &grid.values[i * engine::kProbeValues];
    EXPECT_GT(probe[0], 0.0F);
    EXPECT_GT(probe[27], 0.0F) << "its standard error";
    EXPECT_LT(probe[27], 0.2F * probe[0]);
    EXPECT_EQ(probe[kRing], 0.0F);
  }
  EXPECT_EQ(light(), before);
}

TEST_F(ProbeGrids, WithoutLightArePlacesAlone) {
  solve(blockRoom());
  const auto report = probes({0.5, false});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->grids.front().counts, (std::array<std::uint32_t, 3>{4, 4, 4}));
  EXPECT_FALSE(report->grids.front().node);
  EXPECT_TRUE(report->grids.front().values.empty());
}

// All of what arrives at a probe is in proportion to what the only lamp shines with.
TEST_F(ProbeGrids, FollowEditsOfLightToTheBitsOfNewOnes) {
  solve(blockRoom());
  const auto before = probes({0.4});
  ASSERT_TRUE(before) << before.error().text();
  ASSERT_TRUE(patch(R"([{"op": "replace", "path": "/materials/1/emissiveFactor", "value": [0.5, 0.5, 0.5]}])"));
  ASSERT_TRUE(eventually([&] { return status().state == State::kConverged; }));
  const auto after = probes({0.4});
  ASSERT_TRUE(after);
  double sum = 0.0, of_before = 0.0;
  for (std::size_t i = 0; i < after->grids[0].values.size(); i += engine::kProbeValues) {
    sum += after->grids[0].values[i];
    of_before += before->grids[0].values[i];
  }
  EXPECT_NEAR(sum / of_before, 0.5, 0.02) << "of a solve to a fifth";
  ASSERT_TRUE(probes({0.7}));  // what was kept is not that of the next
  EXPECT_EQ(probes({0.4})->grids[0].values, after->grids[0].values);
}

// What is kept of the scene before must not be told of the next.
TEST_F(ProbeGrids, AfterABlockIsMovedAreTheBitsOfNewOnes) {
  solve(blockRoom());
  const auto before = probes({0.4});
  ASSERT_TRUE(before) << before.error().text();
  ASSERT_TRUE(patch(R"([{"op": "add", "path": "/nodes/2/translation", "value": [1.4, 0, 1.3]}])"));
  ASSERT_TRUE(eventually([&] { return status().state == State::kConverged; }));
  expectAnew(0.4, before->grids[0].values);
}

TEST_F(ProbeGrids, AfterAMetalIsRecolouredAreTheBitsOfNewOnes) {
  auto scene = blockRoom();
  scene.materials[2].metallic = 1.0;
  scene.materials[2].roughness = 0.2;
  solve(scene);
  const auto before = probes({0.4});
  ASSERT_TRUE(before) << before.error().text();
  ASSERT_TRUE(patch(
      R"([{"op": "add", "path": "/materials/2/pbrMetallicRoughness/baseColorFactor", "value": [0.1, 0.9, 0.3, 1]}])"));
  ASSERT_TRUE(eventually([&] { return status().state == State::kConverged; }));
  expectAnew(0.4, before->grids[0].values);
}

// Half a spacing from a sheet, on either side, where one layer would lie in it.
TEST_F(ProbeGrids, OfAFlatSceneHaveTwoLayers) {
  auto scene = blockRoom();
  scene.objects.resize(1);
  scene.objects[0] = {"floor", {}, {}};
  test_scenes::appendBox(scene.objects[0], {0.0, 0.0, 0.0}, {2.0, 0.01, 2.0}, test_scenes::allFaces(1));
  solve(scene);
  const auto report = probes({0.5});
  ASSERT_TRUE(report) << report.error().text();
  const auto& grid = report->grids[0];
  EXPECT_EQ(grid.counts, (std::array<std::uint32_t, 3>{4, 2, 4}));
  EXPECT_NEAR(grid.first.y, 0.005 - 0.25, 1e-6);
  for (std::size_t i = 0; i < grid.values.size(); i += engine::kProbeValues) EXPECT_GT(grid.values[i], 0.0F);
}

TEST_F(ProbeGrids, InsideABlockAreFilledFromOutside) {
  solve(blockRoom());
  const auto report = probes({0.25});
  ASSERT_TRUE(report) << report.error().text();
  std::size_t filled = 0;
  for (std::size_t i = 0; i < report->grids[0].values.size(); i += engine::kProbeValues) {
    const auto* probe = &report->grids[0].values[i];
    filled += probe[kRing] > 0.0F ? 1 : 0;
    EXPECT_GT(probe[0], 0.0F) << i;
  }
  EXPECT_GT(filled, 0U);
  EXPECT_LT(filled, 64U);
}

TEST_F(ProbeGrids, OfTooManyProbesOrOutsideTheSceneAreRefused) {
  solve(blockRoom());
  const auto many = probes({2e-4});
  ASSERT_FALSE(many);
  EXPECT_EQ(many.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(many.error().where, "spacing");
  EXPECT_THAT(many.error().message, HasSubstr("makes 1e+12 probes"));
  ASSERT_TRUE(add("[9, 1, 1]"));
  const auto outside = probes();
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, ErrorCode::kInvalidScene);
  EXPECT_THAT(outside.error().where, HasSubstr("/extras/radiosityProbes"));
  EXPECT_THAT(outside.error().message,
              HasSubstr("lies outside of the scene, which reaches from (0, 0, 0) to (2, 2, 2)"));
  EXPECT_FALSE(add("[1, 1, 1]", "0.0001"));
}

// In a closed room of one emission and reflectance radiance is E / (1 - rho) from everywhere: sqrt(4 pi) times that in
// band 0, and nothing else.
TEST_F(ProbeGrids, InAFurnaceHaveItsRadianceFromAllSides) {
  solve(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(10.0)));
  const auto report = probes({0.5});
  ASSERT_TRUE(report) << report.error().text();
  const double radiance = 10.0 / 0.5;
  for (std::size_t i = 0; i < report->grids[0].values.size(); i += engine::kProbeValues) {
    const auto* probe = &report->grids[0].values[i];
    EXPECT_NEAR(probe[0], std::sqrt(4.0 * std::numbers::pi) * radiance, 0.02 * 3.5449 * radiance);
    for (std::size_t h = 1; h < 9; ++h)
      EXPECT_NEAR(probe[3 * h], 0.0, 5.0 * static_cast<double>(probe[27 + 3 * h]) + 1e-3) << h;
  }
}

}  // namespace
}  // namespace radiosity::test
