// NORMAL: what of it is kept to shade with, and what is done about normals that no face can have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/imported.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using test::imported;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

const glm::vec3 kZero(0.0F);
const std::vector<float> kTilted = {-0.6F, 0, 0.8F, 0.6F, 0, 0.8F, 0.6F, 0, 0.8F, -0.6F, 0, 0.8F};

/// A square that faces +Z with these normals.
GltfBuilder squareWith(const std::vector<float>& normals) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["meshes"][mesh]["primitives"][0]["attributes"]["NORMAL"] = builder.vec3(normals);
  builder.node({{"mesh", mesh}});
  return builder;
}

TEST(ImportNormals, areGivenToUnitLength) {
  auto normals = kTilted;
  for (std::size_t i = 0; i < 3; ++i) normals[i] *= 5.0F;
  const auto scene = imported(squareWith(normals));
  ASSERT_EQ(scene.primitives.at(0).normals.size(), 4U);
  EXPECT_LT(glm::distance(scene.primitives.at(0).normals[0], glm::vec3(-0.6F, 0, 0.8F)), 1e-6F);
  EXPECT_LT(glm::distance(scene.primitives.at(0).normals[2], glm::vec3(0.6F, 0, 0.8F)), 1e-6F);
  EXPECT_THAT(scene.warnings, IsEmpty());
}

TEST(ImportNormals, ofBytesAreScaledLikeFloats) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  const auto normals =
      builder.accessor<std::int8_t>({-76, 0, 102, 0, 76, 0, 102, 0, 76, 0, 102, 0, -76, 0, 102, 0}, 5120, "VEC3", 4);
  builder.gltf["accessors"][normals]["normalized"] = true;
  builder.gltf["bufferViews"].back()["byteStride"] = 4;
  builder.gltf["meshes"][mesh]["primitives"][0]["attributes"]["NORMAL"] = normals;
  builder.node({{"mesh", mesh}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.primitives.at(0).normals.size(), 4U);
  EXPECT_LT(glm::distance(scene.primitives.at(0).normals[1], glm::vec3(0.6F, 0, 0.8F)), 0.01F);  // one step of a byte
}

TEST(ImportNormals, thatStandUprightOnEveryFaceAreLeftOutSinceTheySayFlat) {
  EXPECT_THAT(imported(squareWith({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1})).primitives.at(0).normals, IsEmpty());
  GltfBuilder without;
  without.node({{"mesh", without.square()}});
  EXPECT_THAT(imported(without).primitives.at(0).normals, IsEmpty());
}

TEST(ImportNormals, withoutLengthOrNumberOrOppositeToTheirFaceAreZeroAndCounted) {
  auto normals = kTilted;
  std::fill(normals.begin(), normals.begin() + 3, 0.0F);
  normals[3] = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 6; i < 9; ++i) normals[i] = -normals[i];
  const auto scene = imported(squareWith(normals));
  const auto& kept = scene.primitives.at(0).normals;
  ASSERT_EQ(kept.size(), 4U);
  EXPECT_EQ(kept[0], kZero);
  EXPECT_EQ(kept[1], kZero);
  EXPECT_EQ(kept[2], kZero);
  EXPECT_NE(kept[3], kZero);
  ASSERT_EQ(scene.warnings.size(), 1U);
  EXPECT_EQ(scene.warnings[0],
            "test.glb: /meshes/0/primitives/0/attributes/NORMAL: 3 of 4 normals are of no use (2 without length or not "
            "finite, 1 opposite to their faces); these corners are shaded flat");
}

TEST(ImportNormals, fewerThanVerticesServeAsFarAsTheyGo) {
  const auto builder = squareWith({kTilted.begin(), kTilted.begin() + 6});
  const auto scene = imported(builder);
  const auto& kept = scene.primitives.at(0).normals;
  ASSERT_EQ(kept.size(), 4U);
  EXPECT_NE(kept[1], kZero);
  EXPECT_EQ(kept[2], kZero);
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("2 of 4 normals are of no use (2 missing)")));
}

TEST(ImportNormals, ofAWholeMeshTurnedOverCountAndLeaveItFlat) {
  auto normals = kTilted;
  for (auto& x : normals) x = -x;
  const auto scene = imported(squareWith(normals));
  EXPECT_THAT(scene.primitives.at(0).normals, IsEmpty());
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("4 of 4 normals are of no use (4 opposite to their faces)")));
}

/// Leaves of trees: one set of vertices, two windings.
TEST(ImportNormals, sharedByAFrontAndItsBackServeNeither) {
  auto builder = squareWith(kTilted);
  builder.gltf["meshes"][0]["primitives"][0]["indices"] = builder.indices({0, 1, 2, 0, 2, 3, 2, 1, 0, 3, 2, 0});
  EXPECT_THAT(imported(builder).primitives.at(0).normals, IsEmpty());
}

/// A sliver faces wherever rounding turns it.
TEST(ImportNormals, areNotJudgedByASliverAmongLargeTriangles) {
  auto builder = squareWith(kTilted);
  auto& primitive = builder.gltf["meshes"][0]["primitives"][0];
  primitive["attributes"]["POSITION"] = builder.vec3({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5F, -1e-4F, 0});
  auto normals = kTilted;
  normals.insert(normals.end(), {0, 0, 1});
  primitive["attributes"]["NORMAL"] = builder.vec3(normals);
  primitive["indices"] = builder.indices({0, 1, 2, 0, 2, 3, 1, 0, 4, 0, 1, 4});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.primitives.at(0).normals.size(), 5U);
  EXPECT_NE(scene.primitives.at(0).normals[0], kZero);
  EXPECT_NE(scene.primitives.at(0).normals[1], kZero);
}

TEST(ImportNormals, ofTheWrongTypeAreRefused) {
  auto builder = squareWith(kTilted);
  builder.gltf["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = builder.vec2({0, 0, 0, 0, 0, 0, 0, 0});
  const auto scene = builder.scene();
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().where, "test.glb: /meshes/0/primitives/0/attributes/NORMAL");
}

}  // namespace
}  // namespace radiosity::scene
