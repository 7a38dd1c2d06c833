// Measuring planes as files have them: where they lie, their grids, and what is refused.
#include "server/scene/import/import_planes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "tests/unit/scene/expect_refused.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::expectRefused;
using test::GltfBuilder;
using Json = nlohmann::json;

constexpr const char* kPointer = "/nodes/0/extras/radiosityPlane";

GltfBuilder withPlane(const Json& plane, Json node = Json::object()) {
  GltfBuilder builder;
  node["extras"]["radiosityPlane"] = plane;
  builder.node(std::move(node));
  return builder;
}

std::vector<MeasuringPlane> planesOf(const GltfBuilder& builder) {
  const auto scene = builder.scene();
  EXPECT_TRUE(scene) << scene.error().text();
  return scene ? *readPlanes(*builder.document()) : std::vector<MeasuringPlane>();
}

MeasuringPlane importedPlane(const GltfBuilder& builder) {
  const auto planes = planesOf(builder);
  EXPECT_EQ(planes.size(), 1U);
  return planes.empty() ? MeasuringPlane{} : planes.front();
}

TEST(MeasuringPlanes, LieInTheXZPlaneOfTheirNodeAndLookAlongY) {
  const auto plane = importedPlane(withPlane({{"width", 2.0}, {"depth", 3.0}, {"columns", 4}, {"rows", 2}},
                                             {{"name", "desk"}, {"translation", {1, 0.75, 2}}}));
  EXPECT_EQ(plane.name, "desk");
  EXPECT_EQ(plane.normal, glm::dvec3(0, 1, 0));
  EXPECT_EQ(plane.pointAt(0, 0), glm::dvec3(0.25, 0.75, 1.25));
  EXPECT_EQ(plane.pointAt(3, 1), glm::dvec3(1.75, 0.75, 2.75));
}

TEST(MeasuringPlanes, AreTurnedMirroredAndScaledWithTheirNode) {
  const double half = std::sqrt(0.5);
  const auto plane = importedPlane(withPlane({{"width", 2.0}, {"depth", 3.0}, {"columns", 1}, {"rows", 1}},
                                             {{"rotation", {half, 0, 0, half}}, {"scale", {-2, 1, 1}}}));
  EXPECT_NEAR(glm::length(plane.across), 4.0, 1e-12);
  EXPECT_NEAR(glm::distance(plane.normal, glm::dvec3(0, 0, 1)), 0.0, 1e-12) << "+y was turned there, mirrored or not";
}

TEST(MeasuringPlanes, AMarginIsTakenFromAllSides) {
  const auto plane =
      importedPlane(withPlane({{"width", 5.0}, {"depth", 4.0}, {"margin", 0.5}, {"columns", 1}, {"rows", 1}}));
  EXPECT_EQ(plane.across, glm::dvec3(4, 0, 0));
  EXPECT_EQ(plane.down, glm::dvec3(0, 0, 3));
  EXPECT_EQ(plane.pointAt(0, 0), glm::dvec3(0.0));
}

// EN 12464-1:2021, table 1 rounds p: 1 m 0.2, 5 m 0.6, 10 m 1, 50 m 3, 100 m 5 m.
TEST(MeasuringPlanes, HaveTheGridOfTheStandard) {
  const auto grid = [](double width, double depth) {
    const auto found = usualGrid(width, depth);
    return std::pair(found.columns, found.rows);
  };
  using Grid = std::pair<std::uint64_t, std::uint64_t>;
  EXPECT_EQ(grid(1.0, 1.0), Grid(5, 5));
  EXPECT_EQ(grid(5.0, 5.0), Grid(8, 8)) << "p = 0.615 m";
  EXPECT_EQ(grid(10.0, 10.0), Grid(10, 10));
  EXPECT_EQ(grid(10.0, 6.0), Grid(10, 6)) << "below 2 : 1 the longer side counts";
  EXPECT_EQ(grid(6.0, 10.0), Grid(6, 10));
  EXPECT_EQ(grid(10.0, 5.0), Grid(16, 8)) << "at 2 : 1 the shorter side counts";
  EXPECT_EQ(grid(10.0 * (1.0 - 1e-12), 5.0), Grid(16, 8)) << "as a plane that is turned has it";
  EXPECT_EQ(grid(100.0, 100.0), Grid(20, 20));
  EXPECT_EQ(grid(1000.0, 1000.0), Grid(100, 100)) << "no cell is wider than 10 m";
  EXPECT_EQ(grid(0.01, 0.01), Grid(1, 1)) << "p is 0.008 m there";
}

TEST(MeasuringPlanes, OfHiddenNodesAreLeftOut) {
  auto builder = withPlane({{"width", 2.0}, {"depth", 3.0}});
  builder.gltf["extensionsUsed"] = {"KHR_node_visibility"};
  builder.gltf["nodes"][0]["extensions"]["KHR_node_visibility"]["visible"] = false;
  EXPECT_TRUE(planesOf(builder).empty());
}

TEST(MeasuringPlanes, ATargetMayNameOneOfBoth) {
  const auto plane = importedPlane(withPlane({{"width", 2.0}, {"depth", 3.0}, {"target", {{"uniformity", 0.6}}}}));
  EXPECT_EQ(plane.target.uniformity, 0.6);
  EXPECT_FALSE(plane.target.lux);
}

TEST(MeasuringPlanes, OfWrongSizeAreRefused) {
  const auto refused = [](const Json& change, const std::string& where, const std::string& what) {
    Json plane{{"width", 2.0}, {"depth", 3.0}};
    plane.update(change);
    expectRefused(withPlane(plane), ErrorCode::kInvalidScene, kPointer + where, what);
  };
  refused({{"width", 0}}, "/width", "above 0");
  refused({{"width", -1}}, "/width", "above 0");
  refused({{"width", "2"}}, "/width", "above 0");
  refused({{"width", std::numeric_limits<double>::quiet_NaN()}}, "/width", "above 0");  // written as null
  refused({{"depth", 1e300}}, "/depth", "above 0");
  refused({{"columns", 0}}, "/columns", "whole number");
  refused({{"columns", 1'000'000'000}}, "/columns", "from 1 to 250000");
  refused({{"rows", 1.5}}, "/rows", "whole number");
  refused({{"rows", -3}}, "/rows", "whole number");
  refused({{"margin", 1.0}}, "/margin", "half of the shorter side");
  refused({{"target", 500}}, "/target", "lux, uniformity");
  refused({{"target", Json::object()}}, "/target", "lux, uniformity");
  refused({{"target", {{"lux", 0}}}}, "/target/lux", "above 0");
  refused({{"target", {{"lux", 500}, {"uniformity", 1.01}}}}, "/target/uniformity", "at most 1");
  expectRefused(withPlane(7), ErrorCode::kInvalidScene, kPointer, "must be an object");
  expectRefused(withPlane(Json::object()), ErrorCode::kInvalidScene, std::string(kPointer) + "/width", "above 0");
}

TEST(MeasuringPlanes, ThatTheNodeFlattensOrShearsAreRefused) {
  const Json plane{{"width", 2.0}, {"depth", 3.0}};
  expectRefused(withPlane(plane, {{"scale", {0, 1, 1}}}), ErrorCode::kInvalidScene, kPointer, "from 1 um");
  // What has no normal, and what no ray reaches, ended the server.
  expectRefused(withPlane(plane, {{"scale", {1e-155, 1e-155, 1e-155}}}), ErrorCode::kInvalidScene, kPointer,
                "from 1 um");
  for (const double far : {1e10, 2e18, 1e30})
    expectRefused(withPlane(plane, {{"translation", {far, 0, 0}}}), ErrorCode::kInvalidScene, kPointer, "within 1e9 m");
  const Json sheared{1, 0, 0, 0, 0, 1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1};
  expectRefused(withPlane(plane, {{"matrix", sheared}}), ErrorCode::kInvalidScene, kPointer, "rectangle");
}

TEST(MeasuringPlanes, OfTooManyPointsInAllAreRefused) {
  auto builder = withPlane({{"width", 2.0}, {"depth", 3.0}, {"columns", 500}, {"rows", 499}});
  EXPECT_TRUE(builder.scene());
  builder.node({{"extras", {{"radiosityPlane", {{"width", 2.0}, {"depth", 3.0}, {"columns", 501}, {"rows", 1}}}}}});
  expectRefused(builder, ErrorCode::kTooLarge, "/nodes/1/extras/radiosityPlane", "250000 points");
}

TEST(MeasuringPlanes, MayBeSixtyFour) {
  GltfBuilder builder;
  for (int i = 0; i < 64; ++i) builder.node({{"extras", {{"radiosityPlane", {{"width", 1.0}, {"depth", 1.0}}}}}});
  EXPECT_EQ(planesOf(builder).size(), 64U);
  builder.node({{"extras", {{"radiosityPlane", {{"width", 1.0}, {"depth", 1.0}}}}}});
  expectRefused(builder, ErrorCode::kTooLarge, "/nodes/64/extras/radiosityPlane", "more than 64");
}

TEST(MeasuringPlanes, OnWhatAnAnimationMovesAreRefused) {
  auto builder = withPlane({{"width", 2.0}, {"depth", 3.0}});
  const auto times = builder.accessor(std::vector<float>{0, 1}, 5126, "SCALAR", 1);
  builder.gltf["accessors"][times]["min"] = {0};
  builder.gltf["accessors"][times]["max"] = {1};
  const auto places = builder.vec3({0, 0, 0, 1, 0, 0});
  builder.gltf["animations"] = {{{"samplers", {{{"input", times}, {"output", places}}}},
                                 {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
  expectRefused(builder, ErrorCode::kInvalidScene, kPointer, "animation moves");
  builder.node({{"children", {0}}});
  builder.gltf["animations"][0]["channels"][0]["target"]["node"] = 1;
  expectRefused(builder, ErrorCode::kInvalidScene, kPointer, "animation moves");
}

TEST(MeasuringPlanes, OnInstancedNodesAreRefused) {
  auto builder = withPlane({{"width", 2.0}, {"depth", 3.0}});
  const auto places = builder.vec3({0, 0, 0, 1, 0, 0});
  const auto mesh = builder.square();
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  builder.gltf["nodes"][0]["mesh"] = mesh;
  builder.gltf["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = places;
  expectRefused(builder, ErrorCode::kInvalidScene, kPointer, "EXT_mesh_gpu_instancing");
}

}  // namespace
}  // namespace radiosity::scene
