// Grids of probes as files have them: where they lie, how many probes they have, and what is refused.
#include "server/scene/import/import_probes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "tests/unit/scene/expect_refused.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::expectRefused;
using test::GltfBuilder;
using ::testing::HasSubstr;
using Json = nlohmann::json;

const std::string kProbesPointer = "/nodes/0/extras/radiosityProbes";

GltfBuilder withProbes(const Json& probes, Json node = Json::object()) {
  GltfBuilder builder;
  node["extras"]["radiosityProbes"] = probes;
  builder.node(std::move(node));
  return builder;
}

ProbeGrid importedGrid(const GltfBuilder& builder) {
  EXPECT_TRUE(builder.scene()) << builder.scene().error().text();
  const auto grids = *readProbeGrids(*builder.document());
  EXPECT_EQ(grids.size(), 1U);
  return grids.empty() ? ProbeGrid{} : grids.front();
}

TEST(ProbeGrids, AreBoxesAroundTheirNodeWithProbesInTheMiddleOfCells) {
  const auto grid = importedGrid(
      withProbes({{"size", {2.0, 1.0, 3.0}}, {"spacing", 0.8}}, {{"name", "room"}, {"translation", {1, 0.5, 2}}}));
  EXPECT_EQ(grid.name, "room");
  EXPECT_EQ(grid.node, 0U);
  EXPECT_EQ(grid.counts, (std::array<std::uint32_t, 3>{3, 2, 4}));
  EXPECT_NEAR(glm::distance(grid.first(), glm::dvec3(1.0 / 3.0, 0.25, 0.875)), 0.0, 1e-12);
  EXPECT_NEAR(glm::distance(grid.step(2), glm::dvec3(0.0, 0.0, 0.75)), 0.0, 1e-12);
}

TEST(ProbeGrids, AreTurnedAndScaledWithTheirNodeAndTheSpacingStays) {
  const double half = std::sqrt(0.5);
  const auto grid = importedGrid(withProbes({{"size", {1.0, 1.0, 1.0}}, {"spacing", 0.5}},
                                            {{"rotation", {0, half, 0, half}}, {"scale", {2, 1, 1}}}));
  EXPECT_EQ(grid.counts, (std::array<std::uint32_t, 3>{4, 2, 2}));
  EXPECT_NEAR(glm::distance(grid.step(0), glm::dvec3(0.0, 0.0, -0.5)), 0.0, 1e-12);
}

TEST(ProbeGrids, OfAWholeNumberOfSpacingsHaveSoManyCells) {
  EXPECT_EQ(importedGrid(withProbes({{"size", {0.3, 0.6, 0.9}}, {"spacing", 0.1}})).counts,
            (std::array<std::uint32_t, 3>{3, 6, 9}));
}

TEST(ProbeGrids, OfHiddenNodesAreCheckedAlone) {
  const Json hidden{{"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}};
  const auto builder = withProbes({{"size", {1, 1, 1}}, {"spacing", 0.5}}, hidden);
  EXPECT_TRUE(readProbeGrids(*builder.document())->empty());
  expectRefused(withProbes({{"size", {1, 1, 1}}}, hidden), ErrorCode::kInvalidScene, kProbesPointer + "/spacing",
                "must be a number of metres");
}

TEST(ProbeGrids, ThatAreWrongAreRefusedByTheirPlace) {
  const auto refused = [](const Json& probes, const std::string& below, const char* why) {
    expectRefused(withProbes(probes), ErrorCode::kInvalidScene, kProbesPointer + below, why);
  };
  refused(3, "", "must be an object");
  refused({{"spacing", 1}}, "/size", "three numbers");
  refused({{"size", {1, 1}}, {"spacing", 1}}, "/size", "three numbers");
  refused({{"size", {1, 1, 0}}, {"spacing", 1}}, "/size", "three numbers");
  refused({{"size", {1, 1, 1}}, {"spacing", -1}}, "/spacing", "above 0");
  refused({{"size", {1, 1, 1}}, {"spacing", "near"}}, "/spacing", "above 0");
}

TEST(ProbeGrids, OfTooManyProbesAreRefusedWithASpacingThatWouldDo) {
  const auto many = withProbes({{"size", {10, 10, 10}}, {"spacing", 0.001}});
  expectRefused(many, ErrorCode::kTooLarge, kProbesPointer + "/spacing", "makes 1e+12 probes");
  const auto scene = many.scene();
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().message, HasSubstr("a spacing of 0.16 m would do"));
  EXPECT_TRUE(withProbes({{"size", {10, 10, 10}}, {"spacing", 0.16}}).scene());
}

TEST(ProbeGrids, OfAllNodesTogetherAreBounded) {
  GltfBuilder builder;
  for (int i = 0; i < 2; ++i)
    builder.node({{"extras", {{"radiosityProbes", {{"size", {10, 10, 10}}, {"spacing", 0.18}}}}}});
  expectRefused(builder, ErrorCode::kTooLarge, "/nodes/1/extras/radiosityProbes/spacing", "of other grids");
}

}  // namespace
}  // namespace radiosity::scene
