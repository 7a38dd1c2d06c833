// What each glTF feature becomes, on files small enough to read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <numbers>

#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/imported.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using test::imported;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using Json = nlohmann::json;

/// The place where `builder` is refused; "" when it is accepted.
std::string refusedAt(const GltfBuilder& builder, const ImportLimits& limits = {}) {
  const auto scene = builder.scene(limits);
  return scene ? "" : scene.error().where;
}

TEST(Import, nodesPlaceTheirMeshesInTheWorld) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"translation", {10, 0, 0}}, {"scale", {2, 2, 2}}, {"children", {1, 2}}});
  builder.node({{"mesh", mesh}, {"translation", {1, 0, 0}}});
  builder.node({{"mesh", mesh}, {"scale", {-1, 1, 1}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.instances.size(), 2U);
  EXPECT_EQ(scene.primitives.size(), 1U);  // two nodes, one mesh
  EXPECT_EQ(scene.instances[0].world[3], glm::dvec4(12, 0, 0, 1));
  EXPECT_EQ(scene.instances[0].node, 1U);
  EXPECT_LT(glm::determinant(scene.instances[1].world), 0.0);
}

TEST(Import, gpuInstancingMakesOneInstanceAnElement) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  const auto translations = builder.vec3({0, 0, 0, 0, 5, 0});
  const auto scales = builder.vec3({1, 1, 1, 3, 3, 3});
  const Json attributes = {{"TRANSLATION", translations}, {"SCALE", scales}};
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  builder.node({{"mesh", mesh},
                {"translation", {1, 0, 0}},
                {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.instances.size(), 2U);
  EXPECT_EQ(scene.instances[1].world * glm::dvec4(1, 1, 0, 1), glm::dvec4(4, 8, 0, 1));
}

TEST(Import, stripsAndFansKeepTheirFacing) {
  for (const int mode : {5, 6}) {
    GltfBuilder builder;
    const auto mesh = builder.square();
    auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
    primitive["mode"] = mode;
    primitive["indices"] = mode == 5 ? builder.indices({0, 1, 3, 2}) : builder.indices({0, 1, 2, 3});
    builder.node({{"mesh", mesh}});
    const auto scene = imported(builder);
    const auto& p = scene.primitives.at(0);
    ASSERT_EQ(p.indices.size(), 6U) << mode;
    for (std::size_t i = 0; i < 6; i += 3) {
      const auto& a = p.positions[p.indices[i]];
      const auto normal = glm::cross(p.positions[p.indices[i + 1]] - a, p.positions[p.indices[i + 2]] - a);
      EXPECT_EQ(normal, glm::dvec3(0, 0, 1)) << mode;
    }
  }
}

TEST(Import, bytesAndIntsAndNoIndicesMeanTheSame) {
  for (int kind = 0; kind < 3; ++kind) {
    GltfBuilder builder;
    const auto mesh = builder.square();
    auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
    if (kind == 0) primitive["indices"] = builder.accessor<std::uint8_t>({0, 1, 2}, 5121, "SCALAR", 1);
    if (kind == 1) primitive["indices"] = builder.accessor<std::uint32_t>({0, 1, 2}, 5125, "SCALAR", 1);
    if (kind == 2) primitive.erase("indices");  // 4 corners: one triangle and a rest
    builder.node({{"mesh", mesh}});
    EXPECT_THAT(imported(builder).primitives.at(0).indices, ElementsAre(0, 1, 2)) << kind;
  }
}

TEST(Import, sparseValuesReplaceTheirElements) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["meshes"][mesh]["primitives"][0]["indices"] = builder.indices({0, 1, 3});
  const auto which = builder.indices({1, 3});
  const auto values = builder.vec3({9, 0, 0, 0, 8, 0});
  auto& accessor = builder.gltf["accessors"][0];
  accessor["sparse"] = {{"count", 2},
                        {"indices", {{"bufferView", which}, {"componentType", 5123}}},
                        {"values", {{"bufferView", values}}}};
  builder.node({{"mesh", mesh}});
  const auto positions = imported(builder).primitives.at(0).positions;
  EXPECT_THAT(positions, ElementsAre(glm::dvec3(0), glm::dvec3(9, 0, 0), glm::dvec3(1, 1, 0), glm::dvec3(0, 8, 0)));
  accessor.erase("bufferView");  // then the rest is zero
  EXPECT_EQ(builder.scene()->primitives.at(0).positions[2], glm::dvec3(0));
}

TEST(Import, sparseIndicesOutOfOrderOrRangeAreRefused) {
  for (const auto& list : {std::vector<std::uint16_t>{3, 1}, std::vector<std::uint16_t>{1, 4}}) {
    GltfBuilder builder;
    const auto mesh = builder.square();
    const auto which = builder.indices(list);
    const auto values = builder.vec3({9, 0, 0, 0, 8, 0});
    builder.gltf["accessors"][0]["sparse"] = {{"count", 2},
                                              {"indices", {{"bufferView", which}, {"componentType", 5123}}},
                                              {"values", {{"bufferView", values}}}};
    builder.node({{"mesh", mesh}});
    EXPECT_EQ(refusedAt(builder), "test.glb: /accessors/0/sparse/indices");
  }
}

TEST(Import, quantizedPositionsAndColoursAreScaled) {
  GltfBuilder builder;
  const auto positions =
      builder.accessor<std::int16_t>({0, 0, 0, 0, 32767, 0, 0, 0, 0, 32767, 0, 0}, 5122, "VEC3", 4);  // stride 8
  builder.gltf["bufferViews"][0]["byteStride"] = 8;
  builder.gltf["accessors"][positions]["normalized"] = true;
  const auto colors = builder.accessor<std::uint8_t>({255, 0, 51, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 5121, "VEC3", 4);
  builder.gltf["bufferViews"][1]["byteStride"] = 4;
  builder.gltf["accessors"][colors]["normalized"] = true;
  builder.gltf["extensionsRequired"] = {"KHR_mesh_quantization"};
  const Json attributes = {{"POSITION", positions}, {"COLOR_0", colors}};
  builder.gltf["meshes"].push_back({{"primitives", {{{"attributes", attributes}}}}});
  builder.node({{"mesh", 0}});
  const auto scene = imported(builder);
  EXPECT_EQ(scene.primitives.at(0).positions[1], glm::dvec3(1, 0, 0));
  EXPECT_EQ(scene.primitives.at(0).color0[0], glm::vec4(1.0F, 0.0F, 0.2F, 1.0F));
}

TEST(Import, badTrianglesAreDroppedAndCounted) {
  GltfBuilder builder;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto positions = builder.vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0, nan, 0, 0});
  // Good, its copy, its back (kept), a line, a repeated corner, a corner that is no number.
  const auto index = builder.indices({0, 1, 2, 1, 2, 0, 0, 2, 1, 0, 1, 3, 0, 0, 2, 0, 1, 4});
  builder.gltf["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", positions}}}, {"indices", index}}}}});
  builder.node({{"mesh", 0}});
  const auto scene = imported(builder);
  EXPECT_THAT(scene.primitives.at(0).indices, ElementsAre(0, 1, 2, 0, 2, 1));
  EXPECT_EQ(scene.triangles_dropped, 4U);
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("/meshes/0/primitives/0")));
}

TEST(Import, pointsAndLinesAreSkippedWithAWarning) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["meshes"][mesh]["primitives"][0]["mode"] = 1;
  builder.node({{"mesh", mesh}});
  const auto scene = imported(builder);
  EXPECT_TRUE(scene.instances.empty());
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("points and lines")));
}

Json spotOf(double inner, double outer) {
  return {{"type", "spot"}, {"spot", {{"innerConeAngle", inner}, {"outerConeAngle", outer}}}};
}

TEST(Import, oddConesOfSpotsAreLitWithAWarning) {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"KHR_lights_punctual"};
  const std::string lights = "/extensions/KHR_lights_punctual/lights";
  builder.gltf[Json::json_pointer(lights)] =
      Json::array({spotOf(0.5, 0.5), spotOf(0.7, 0.5), spotOf(0.1, 2.0), spotOf(0.1, 0.5)});
  for (std::size_t i = 0; i < 4; ++i) builder.node({{"extensions", {{"KHR_lights_punctual", {{"light", i}}}}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.lights.size(), 4U);
  EXPECT_EQ(scene.lights[0].inner_cone_rad, 0.5);
  EXPECT_EQ(scene.lights[1].inner_cone_rad, 0.5);
  EXPECT_EQ(scene.lights[1].outer_cone_rad, 0.5);
  EXPECT_DOUBLE_EQ(scene.lights[2].outer_cone_rad, std::numbers::pi / 2);
  EXPECT_THAT(scene.warnings,
              ElementsAre(HasSubstr(lights + "/0/spot/innerConeAngle"), HasSubstr(lights + "/1/spot/innerConeAngle"),
                          HasSubstr(lights + "/2/spot/outerConeAngle: is above pi/2")));
  builder.gltf[Json::json_pointer(lights + "/3/spot/outerConeAngle")] = 0.0;
  EXPECT_EQ(refusedAt(builder), "test.glb: " + lights + "/3/spot/outerConeAngle");
}

TEST(Import, camerasIgnoreScale) {
  const auto poseWith = [](const Json& scale, const Json& above) {
    GltfBuilder builder;
    builder.gltf["cameras"] =
        Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}}});
    builder.node({{"scale", above}, {"children", {1}}});
    builder.node({{"camera", 0}, {"translation", {1, 2, 3}}, {"rotation", {0.5, 0.5, 0.5, 0.5}}, {"scale", scale}});
    return imported(builder).cameras.at(0).world;
  };
  const auto plain = poseWith({1, 1, 1}, {1, 1, 1});
  EXPECT_EQ(plain[3], glm::dvec4(1, 2, 3, 1));
  for (const Json& scale : {Json{-1, 1, 1}, Json{1, 1, -1}, Json{-2, -3, -4}, Json{0.1, 7, 2}, Json{0, 0, 0}})
    EXPECT_EQ(poseWith(scale, {1, 1, 1}), plain) << scale;
  // Nodes above it move it and turn its view, as they do the room that hangs there, too.
  const auto mirrored = poseWith({1, 1, 1}, {-2, 2, 2});
  EXPECT_EQ(mirrored[3], glm::dvec4(-2, 4, 6, 1));
  EXPECT_LT(glm::distance(mirrored[2], plain[2] * glm::dvec4(-1, 1, 1, 1)), 1e-12);
  EXPECT_LT(glm::distance(mirrored[1], plain[1] * glm::dvec4(-1, 1, 1, 1)), 1e-12);
  EXPECT_NEAR(glm::determinant(mirrored), 1.0, 1e-12);
}

TEST(Import, lightsAndCamerasComeInWorldSpace) {
  GltfBuilder builder;
  builder.gltf["extensionsRequired"] = {"KHR_lights_punctual"};
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"] =
      Json::array({{{"type", "spot"}, {"intensity", 100}, {"color", {1, 0.5, 0}}, {"spot", {{"outerConeAngle", 0.5}}}},
                   {{"type", "point"}, {"range", 7}}});
  builder.gltf["cameras"] =
      Json::array({{{"type", "perspective"}, {"name", "eye"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}}});
  const double half = std::numbers::sqrt2 / 2;
  builder.node({{"rotation", {-half, 0, 0, half}},  // looks down
                {"translation", {1, 2, 3}},
                {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  builder.node({{"camera", 0}, {"extensions", {{"KHR_lights_punctual", {{"light", 1}}}}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.lights.size(), 2U);
  EXPECT_EQ(scene.lights[0].kind, LightKind::kSpot);
  EXPECT_EQ(scene.lights[0].intensity, glm::vec3(100, 50, 0));
  EXPECT_LT(glm::distance(scene.lights[0].direction, glm::dvec3(0, -1, 0)), 1e-12);
  EXPECT_EQ(scene.lights[0].position, glm::dvec3(1, 2, 3));
  EXPECT_EQ(scene.lights[1].range, 7.0);
  ASSERT_EQ(scene.cameras.size(), 1U);
  EXPECT_EQ(scene.cameras[0].yfov_rad, 0.7);
}

TEST(Import, hiddenNodesHideWhatIsBelowThem) {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"KHR_node_visibility"};
  builder.node({{"children", {1}}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  builder.node({{"mesh", builder.square()}});
  EXPECT_FALSE(imported(builder).instances.at(0).visible);
}

TEST(Import, onlyTheNamedSceneIsPlaced) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}});
  builder.node({{"mesh", mesh}});
  builder.gltf["scenes"] = Json::array({{{"nodes", {0, 1}}}, {{"nodes", {1}}}});
  builder.gltf["scene"] = 1;
  const auto scene = imported(builder);
  ASSERT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(scene.instances[0].node, 1U);
}

TEST(Import, everyFaultIsRefusedAtItsPlace) {
  const auto faulty = [](const std::string& pointer, const Json& value) {
    GltfBuilder builder;
    builder.gltf["materials"] = Json::array({Json::object()});
    builder.node({{"mesh", builder.square()}, {"children", {1}}});
    builder.node(Json::object());
    builder.gltf[Json::json_pointer(pointer)] = value;
    return refusedAt(builder);
  };
  EXPECT_EQ(faulty("/nodes/0/mesh", 1), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(faulty("/nodes/0/mesh", -1), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(faulty("/nodes/0/mesh", 4294967296), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(faulty("/nodes/0/mesh", "0"), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(faulty("/nodes/0/translation", {1, 2}), "test.glb: /nodes/0/translation");
  EXPECT_EQ(faulty("/nodes/0/translation", {1, 2, 1e300}), "test.glb: /nodes/0/translation/2");
  EXPECT_EQ(faulty("/nodes/0/rotation", {0, 0, 0, 0}), "test.glb: /nodes/0/rotation");
  EXPECT_EQ(faulty("/nodes/1/children", {0}), "test.glb: /nodes/0/children");
  EXPECT_EQ(faulty("/nodes/0/children", {1, 1}), "test.glb: /nodes/0/children/1");
  EXPECT_EQ(faulty("/accessors/0/count", 5), "test.glb: /accessors/0/count");
  EXPECT_EQ(faulty("/accessors/0/count", 2147483647), "test.glb: /accessors/0/count");
  EXPECT_EQ(faulty("/accessors/0/count", 18446744073709551615ULL), "test.glb: /accessors/0/count");
  EXPECT_EQ(faulty("/accessors/0/count", 2.5), "test.glb: /accessors/0/count");
  EXPECT_EQ(faulty("/accessors/0/byteOffset", 4), "test.glb: /accessors/0/count");
  EXPECT_EQ(faulty("/accessors/0/componentType", 5130), "test.glb: /accessors/0/componentType");
  EXPECT_EQ(faulty("/accessors/0/componentType", 1), "test.glb: /accessors/0/componentType");
  EXPECT_EQ(faulty("/accessors/0/type", "VEC2"), "test.glb: /meshes/0/primitives/0/attributes/POSITION");
  EXPECT_EQ(faulty("/accessors/0/type", "VEC9"), "test.glb: /accessors/0/type");
  EXPECT_EQ(faulty("/accessors/1/componentType", 5126), "test.glb: /accessors/1/count");
  EXPECT_EQ(faulty("/accessors/0/count", 3), "test.glb: /accessors/1");  // an index points past the vertices
  EXPECT_EQ(faulty("/bufferViews/0/byteLength", 4096), "test.glb: /bufferViews/0/byteLength");
  EXPECT_EQ(faulty("/bufferViews/0/byteStride", 2), "test.glb: /bufferViews/0/byteStride");
  EXPECT_EQ(faulty("/materials/0/alphaMode", "SHINY"), "test.glb: /materials/0/alphaMode");
  EXPECT_EQ(faulty("/materials/0/emissiveFactor", {-1, 0, 0}), "test.glb: /materials/0/emissiveFactor/0");
  EXPECT_EQ(faulty("/meshes/0/primitives/0/mode", 7), "test.glb: /meshes/0/primitives/0/mode");
  EXPECT_EQ(faulty("/extensionsRequired", {"EXT_magic"}), "test.glb: /extensionsRequired/0");
  EXPECT_EQ(faulty("/asset/version", "1.0"), "test.glb: /asset/version");
  EXPECT_EQ(faulty("/meshes/0/weights", {0, 1e30}), "test.glb: /meshes/0/weights/1");
  EXPECT_EQ(faulty("/nodes/0/weights", {-1e30}), "test.glb: /nodes/0/weights/0");
  EXPECT_EQ(faulty("/nodes/0/skin", 0), "test.glb: /nodes/0/skin");
  EXPECT_EQ(faulty("/meshes/0/primitives/0/targets", Json::array({{{"POSITION", 9}}})),
            "test.glb: /meshes/0/primitives/0/targets/0/POSITION");
  EXPECT_EQ(faulty("/meshes/0/primitives/0/targets", Json::array({{{"POSITION", 1}}})),
            "test.glb: /meshes/0/primitives/0/targets/0/POSITION");  // as many as indices, not as vertices
}

TEST(Import, countsAreBounded) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  for (int i = 0; i < 4; ++i) builder.node({{"mesh", mesh}});
  ImportLimits triangles;
  triangles.max_triangles = 7;
  EXPECT_EQ(refusedAt(builder, triangles), "test.glb: /nodes/3");
  ImportLimits nodes;
  nodes.max_nodes = 3;
  EXPECT_EQ(refusedAt(builder, nodes), "test.glb: /nodes");
  ImportLimits vertices;
  vertices.max_vertices = 9;
  EXPECT_EQ(refusedAt(builder, vertices), "test.glb: /accessors/1/count");
}

TEST(Import, deepNodeChainsNeedNoStack) {
  GltfBuilder builder;
  const int depth = 100'000;
  for (int i = 0; i < depth; ++i) builder.gltf["nodes"].push_back({{"children", {i + 1}}});
  builder.node({{"mesh", builder.square()}});
  EXPECT_EQ(imported(builder).instances.size(), 1U);
}

}  // namespace
}  // namespace radiosity::scene
