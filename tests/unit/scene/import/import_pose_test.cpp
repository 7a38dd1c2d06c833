// Morph targets and skins as a file states them, with animations unplayed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <limits>

#include "server/scene/lightmap/lightmap.h"
#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/imported.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using test::imported;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using Json = nlohmann::json;

std::string refusedAt(const GltfBuilder& builder) {
  const auto scene = builder.scene();
  return scene ? "" : scene.error().where;
}

/// Where an instance has corner `vertex` of its mesh.
glm::dvec3 placed(const Scene& scene, std::size_t instance, std::size_t vertex) {
  const auto& at = scene.instances.at(instance);
  return glm::dvec3(at.world * glm::dvec4(scene.primitives[at.primitive].positions.at(vertex), 1.0));
}

/// A square with one target that lifts it by 2 in Z, and tilts its normals.
GltfBuilder morphing() {
  GltfBuilder builder;
  const auto mesh = builder.square();
  auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
  primitive["targets"] = Json::array({{{"POSITION", builder.vec3({0, 0, 2, 0, 0, 2, 0, 0, 2, 0, 0, 2})}}});
  return builder;
}

TEST(ImportPose, weightsOfTheNodeComeBeforeThoseOfTheMesh) {
  auto builder = morphing();
  builder.gltf["meshes"][0]["weights"] = {1};
  builder.node({{"mesh", 0}});
  builder.node({{"mesh", 0}, {"weights", {0.5}}});
  builder.node({{"mesh", 0}, {"weights", {0}}});
  builder.node({{"mesh", 0}, {"weights", {1}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.instances.size(), 4U);
  EXPECT_EQ(placed(scene, 0, 2), glm::dvec3(1, 1, 2));
  EXPECT_EQ(placed(scene, 1, 2), glm::dvec3(1, 1, 1));
  EXPECT_EQ(placed(scene, 2, 2), glm::dvec3(1, 1, 0));
  EXPECT_EQ(scene.primitives.size(), 3U) << "nodes that pose it alike share it";
  EXPECT_EQ(scene.instances[3].primitive, scene.instances[0].primitive);
  for (const auto& primitive : scene.primitives) {
    EXPECT_EQ(primitive.mesh, 0U);
    EXPECT_EQ(primitive.primitive, 0U);
  }
  EXPECT_THAT(scene.warnings, IsEmpty());
}

TEST(ImportPose, withoutWeightsTargetsDoNothing) {
  auto builder = morphing();
  builder.node({{"mesh", 0}});
  EXPECT_EQ(placed(imported(builder), 0, 0), glm::dvec3(0));
}

TEST(ImportPose, sparseTargetsMoveTheirVerticesAndNormals) {
  auto builder = morphing();
  auto& primitive = builder.gltf["meshes"][0]["primitives"][0];
  const auto which = builder.indices({2});
  const auto delta = builder.vec3({0, 0, 4});
  auto& accessor = builder.gltf["accessors"][primitive["targets"][0]["POSITION"].get<std::size_t>()];
  accessor.erase("bufferView");
  accessor["sparse"] = {
      {"count", 1}, {"indices", {{"bufferView", which}, {"componentType", 5123}}}, {"values", {{"bufferView", delta}}}};
  primitive["attributes"]["NORMAL"] = builder.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitive["targets"][0]["NORMAL"] = builder.vec3({0, 0, 0, 0, 0, 0, -1, -1, 0, 0, 0, 0});
  builder.node({{"mesh", 0}, {"weights", {0.25}}});
  const auto scene = imported(builder);
  EXPECT_EQ(placed(scene, 0, 1), glm::dvec3(1, 0, 0));
  EXPECT_EQ(placed(scene, 0, 2), glm::dvec3(1, 1, 1));
  ASSERT_EQ(scene.primitives[0].normals.size(), 4U);
  EXPECT_LT(glm::distance(scene.primitives[0].normals[2], glm::normalize(glm::vec3(-0.25F, -0.25F, 1))), 1e-6F);
}

TEST(ImportPose, targetsThatReachTooFarAreRefused) {
  auto builder = morphing();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  builder.gltf["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] =
      builder.vec3({0, 0, 2, 0, nan, 2, 0, 0, 2, 0, 0, 2});
  builder.node({{"mesh", 0}, {"weights", {1}}});
  EXPECT_EQ(refusedAt(builder), "test.glb: /meshes/0/primitives/0/targets/0");
  builder.gltf["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] =
      builder.vec3({0, 0, 2, 0, 0, 3e38F, 0, 0, 2, 0, 0, 2});
  builder.gltf["nodes"][0]["weights"] = {100};
  EXPECT_EQ(refusedAt(builder), "test.glb: /meshes/0/primitives/0/targets/0");
}

/// The square on two joints: its left corners follow one, which moves nothing, its right corners the other, which lifts
/// them by 3 in Z. Nodes 0 and 1 are joints, 2 is the mesh.
struct Skinned {
  GltfBuilder builder;
  Json joint;  ///< node 1

  explicit Skinned(const std::vector<std::uint8_t>& joints = {0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0},
                   const std::vector<float>& weights = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}) {
    builder.square();
    auto& attributes = builder.gltf["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = builder.accessor(joints, 5121, "VEC4", 4);
    attributes["WEIGHTS_0"] = builder.accessor(weights, 5126, "VEC4", 4);
    builder.node({{"children", {1}}});
    builder.node({{"translation", {0, 0, 3}}});
    builder.node({{"mesh", 0}, {"skin", 0}, {"translation", {50, 0, 0}}});
    builder.gltf["skins"] = Json::array({{{"joints", {0, 1}}}});
  }
};

TEST(ImportPose, jointsPlaceTheVerticesAndTheMeshsOwnNodeDoesNot) {
  Skinned skinned;
  const auto scene = imported(skinned.builder);
  ASSERT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(placed(scene, 0, 0), glm::dvec3(0, 0, 0));
  EXPECT_EQ(placed(scene, 0, 1), glm::dvec3(1, 0, 3));
  EXPECT_EQ(placed(scene, 0, 2), glm::dvec3(1, 1, 3));
  EXPECT_EQ(scene.instances[0].node, 2U);
  EXPECT_THAT(scene.warnings, IsEmpty());
}

TEST(ImportPose, inverseBindMatricesComeBeforeTheJoint) {
  Skinned skinned;
  auto& builder = skinned.builder;
  std::vector<float> matrices(32, 0.0F);
  for (std::size_t m = 0; m < 2; ++m) {
    for (std::size_t k = 0; k < 4; ++k) matrices[16 * m + 5 * k] = 1.0F;
  }
  matrices[16 + 12] = -1.0F;  // the second joint was bound at (1, 0, 0)
  builder.gltf["skins"][0]["inverseBindMatrices"] = builder.accessor(matrices, 5126, "MAT4", 16);
  const double half = std::sqrt(0.5);
  builder.gltf["nodes"][1] = {{"translation", {1, 0, 0}}, {"rotation", {0, half, 0, half}}};  // a quarter turn about Y
  builder.gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"] =
      builder.vec3({0, 0, 0, 2, 0, 0, 2, 1, 0, 0, 1, 0});
  const auto scene = imported(builder);
  EXPECT_LT(glm::distance(placed(scene, 0, 1), glm::dvec3(1, 0, -1)), 1e-7);
}

TEST(ImportPose, weightsOfAllSetsAreScaledToOne) {
  Skinned skinned({0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, {2, 0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  auto& builder = skinned.builder;
  auto& attributes = builder.gltf["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_1"] =
      builder.accessor<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 5121, "VEC4", 4);
  attributes["WEIGHTS_1"] = builder.accessor<float>({0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 5126, "VEC4", 4);
  const auto scene = imported(builder);
  EXPECT_EQ(placed(scene, 0, 0), glm::dvec3(0));
  EXPECT_LT(glm::distance(placed(scene, 0, 1), glm::dvec3(1, 0, 0.75)), 1e-12);  // 3 : 1
}

TEST(ImportPose, verticesWithoutWeightFollowTheirFirstJoint) {
  Skinned skinned({0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, std::vector<float>(16, 0.0F));
  const auto scene = imported(skinned.builder);
  EXPECT_EQ(placed(scene, 0, 1), glm::dvec3(1, 0, 3));
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("4 vertices have no weight")));
}

/// Targets move a mesh before its joints do.
TEST(ImportPose, morphsComeBeforeSkins) {
  Skinned skinned;
  auto& builder = skinned.builder;
  builder.gltf["meshes"][0]["primitives"][0]["targets"] =
      Json::array({{{"POSITION", builder.vec3({0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0})}}});
  builder.gltf["nodes"][2]["weights"] = {1};
  builder.gltf["nodes"][1]["scale"] = {2, 2, 2};
  EXPECT_EQ(placed(imported(builder), 0, 1), glm::dvec3(4, 0, 3));
}

/// Which side is the front is a matter of the mesh's own node, in every viewer.
TEST(ImportPose, aMirroredNodeTurnsTheFrontOfItsSkinnedMesh) {
  Skinned skinned;
  auto& builder = skinned.builder;
  builder.gltf["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.vec3({0.6F, 0, 0.8F, 0.6F, 0, 0.8F, 0.6F, 0, 0.8F, 0.6F, 0, 0.8F});
  builder.gltf["skins"][0]["joints"] = {0, 0};
  auto scene = imported(builder);
  EXPECT_GT(glm::determinant(scene.instances[0].world), 0.0);
  EXPECT_LT(glm::distance(scene.primitives[0].normals.at(0), glm::vec3(0.6F, 0, 0.8F)), 1e-6F);
  builder.gltf["nodes"][2]["scale"] = {-1, 1, 1};
  builder.gltf["nodes"][0]["scale"] = {-1, 1, 1};
  scene = imported(builder);
  EXPECT_LT(glm::determinant(scene.instances[0].world), 0.0);
  EXPECT_EQ(placed(scene, 0, 1), glm::dvec3(-1, 0, 0));
  const auto normal = glm::dvec3(scene.primitives[0].normals.at(0)) * glm::dvec3(scene.instances[0].world[0][0], 1, 1);
  EXPECT_LT(glm::distance(normal, glm::dvec3(-0.6, 0, 0.8)), 1e-6);
}

TEST(ImportPose, skinsThatPointOutOfRangeAreRefused) {
  const std::string attributes = "test.glb: /meshes/0/primitives/0/attributes/";
  EXPECT_EQ(refusedAt(Skinned({0, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}).builder), attributes + "JOINTS_0");
  const std::vector<std::uint8_t> joints(16, 0);
  std::vector<float> weights(16, 1.0F);
  weights[5] = 1e30F;
  EXPECT_EQ(refusedAt(Skinned(joints, weights).builder), attributes + "WEIGHTS_0");
  weights[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(refusedAt(Skinned(joints, weights).builder), attributes + "WEIGHTS_0");
  Skinned skinned;
  skinned.builder.gltf["skins"][0]["joints"] = {0, 7};
  EXPECT_EQ(refusedAt(skinned.builder), "test.glb: /skins/0/joints/1");
  skinned.builder.gltf["skins"][0]["joints"] = {0, 1};
  skinned.builder.gltf["skins"][0]["inverseBindMatrices"] =
      skinned.builder.accessor(std::vector<float>(16, 0.0F), 5126, "MAT4", 16);
  EXPECT_EQ(refusedAt(skinned.builder), "test.glb: /skins/0/inverseBindMatrices") << "one for two joints";
  skinned.builder.gltf["skins"][0]["inverseBindMatrices"] = 0;
  EXPECT_EQ(refusedAt(skinned.builder), "test.glb: /skins/0/inverseBindMatrices") << "positions are no matrices";
}

TEST(ImportPose, aSkinThatReachesTooFarIsRefused) {
  Skinned skinned;
  skinned.builder.gltf["nodes"][1]["translation"] = {0, 0, 3e38};
  skinned.builder.gltf["nodes"][0]["scale"] = {9, 9, 9};
  EXPECT_EQ(refusedAt(skinned.builder), "test.glb: /skins/0");
}

TEST(ImportPose, aSkinWithoutJointsInTheMeshLeavesItToItsNode) {
  Skinned skinned;
  skinned.builder.gltf["meshes"][0]["primitives"][0]["attributes"].erase("JOINTS_0");
  const auto scene = imported(skinned.builder);
  EXPECT_EQ(placed(scene, 0, 0), glm::dvec3(50, 0, 0));
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("has a skin, but no JOINTS_0")));
}

/// Each corner a UV of its own.
PatchScene patchesOf(const Scene& scene) {
  PatchScene patches;
  patches.pages.resize(1, {2, 2});
  for (const auto& instance : scene.instances) {
    PatchScene::SideUv uv;
    uv.page.assign(scene.primitives[instance.primitive].indices.size() / 3, 0);
    uv.corners.assign(uv.page.size(), {glm::vec2(0), glm::vec2(1, 0), glm::vec2(0, 1)});
    patches.instance_uvs.push_back({{std::move(uv), {}}});
  }
  return patches;
}

TEST(ImportPose, theLitSceneKeepsSkinsTargetsAndWeights) {
  auto morphs = morphing();
  morphs.gltf["meshes"][0]["weights"] = {1};
  morphs.node({{"mesh", 0}});
  morphs.node({{"mesh", 0}, {"weights", {0.5}}});
  const auto scales = morphs.vec3({1, 1, 1, 2, 2, 2});
  morphs.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  morphs.node({{"mesh", 0},
               {"weights", {0.25}},
               {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"SCALE", scales}}}}}}}});
  for (const auto& builder : {morphs, Skinned().builder}) {
    const auto document = builder.document();
    ASSERT_TRUE(document);
    const auto scene = importScene(*document);
    ASSERT_TRUE(scene);
    const auto lit = withLightmapUvs(*document, *scene, patchesOf(*scene));
    ASSERT_TRUE(lit) << lit.error().text();
    const auto again = importScene(*lit);
    ASSERT_TRUE(again) << again.error().text();
    ASSERT_EQ(again->instances.size(), scene->instances.size());
    for (std::size_t i = 0; i < scene->instances.size(); ++i) {
      const auto &before = scene->primitives[scene->instances[i].primitive],
                 &after = again->primitives[again->instances[i].primitive];
      ASSERT_EQ(before.indices.size(), after.indices.size());
      EXPECT_FALSE(after.texcoord1.empty());
      for (std::size_t c = 0; c < before.indices.size(); ++c)
        EXPECT_EQ(placed(*scene, i, before.indices[c]), placed(*again, i, after.indices[c])) << i << " " << c;
    }
  }
}

// Which becomes a node for each element: one without a mesh has no weights.
TEST(ImportPose, theLitSceneAnimatesTheWeightsOfEachElement) {
  auto builder = morphing();
  const auto places = builder.vec3({0, 0, 0, 0, 5, 0});
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing", "KHR_animation_pointer"};
  builder.node({{"mesh", 0}});
  builder.node({{"mesh", 0},
                {"weights", {0.5}},
                {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}}});
  const auto channel = [](std::size_t node, const char* path) {
    return Json{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}};
  };
  const auto pointing = [](const char* pointer) {
    return Json{{"sampler", 0},
                {"target", {{"path", "pointer"}, {"extensions", {{"KHR_animation_pointer", {{"pointer", pointer}}}}}}}};
  };
  const auto time = builder.accessor(std::vector<float>{0, 1}, 5126, "SCALAR", 1);
  const auto weight = builder.accessor(std::vector<float>{0, 1}, 5126, "SCALAR", 1);
  builder.gltf["animations"] = {{{"samplers", {{{"input", time}, {"output", weight}}}},
                                 {"channels",
                                  {channel(0, "weights"), channel(1, "weights"), channel(1, "translation"),
                                   pointing("/nodes/1/weights/0"), pointing("/nodes/1/weightsome"), 7}}}};
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto scene = importScene(*document);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(placed(*scene, 2, 2), glm::dvec3(1, 6, 1));
  const auto lit = withLightmapUvs(*document, *scene, patchesOf(*scene));
  ASSERT_TRUE(lit) << lit.error().text();
  const auto channels = lit->gltf["animations"][0]["channels"];
  const auto expected =
      Json::array({channel(0, "weights"), channel(2, "weights"), channel(3, "weights"), channel(1, "translation"),
                   pointing("/nodes/2/weights/0"), pointing("/nodes/3/weights/0"), pointing("/nodes/1/weightsome"), 7});
  EXPECT_EQ(channels, expected) << channels.dump(1);
  EXPECT_EQ(lit->gltf["nodes"][2]["weights"], Json::array({0.5}));
}

}  // namespace
}  // namespace radiosity::scene
