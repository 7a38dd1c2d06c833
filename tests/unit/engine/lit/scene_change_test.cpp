#include "server/engine/lit/scene_change.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace radiosity::engine {
namespace {

using scene::Scene;
using testing::ElementsAre;

/// A triangle of a material with every texture that light asks for.
Scene textured() {
  Scene scene;
  scene::Primitive primitive;
  primitive.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  primitive.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  primitive.indices = {0, 1, 2};
  scene.primitives.push_back(primitive);
  scene.instances.push_back({0, 0});
  for (const std::uint8_t value : {10, 20}) {
    scene::Texture texture;
    texture.width = texture.height = 1;
    texture.rgba = {value, value, value, 255};
    scene.textures.push_back(texture);
  }
  scene::Material material;
  material.base_color_texture.texture = material.specular_texture.texture = 0;
  material.metallic_texture.texture = material.emissive_texture.texture = 1;
  scene.materials.push_back(material);
  return scene;
}

TEST(SceneChange, whatAMaterialReflectsChangesItsMaterialAlone) {
  const Scene before = textured();
  EXPECT_TRUE(changeBetween(before, textured()).nothing());
  const auto expectMaterial = [&](const auto& edit) {
    Scene after = textured();
    edit(after.materials[0]);
    const auto change = changeBetween(before, after);
    EXPECT_FALSE(change.geometry);
    EXPECT_THAT(change.materials, ElementsAre(0U));
    EXPECT_TRUE(onlyNodesMoved(before, after));
  };
  expectMaterial([](scene::Material& m) { m.metallic = 0.5F; });
  expectMaterial([](scene::Material& m) { m.specular = {0.5F, 0, 0}; });
  expectMaterial([](scene::Material& m) { m.metallic_texture.texture = 0; });
  expectMaterial([](scene::Material& m) { m.specular_texture.texture = 1; });
  expectMaterial([](scene::Material& m) { m.metallic_texture.nearest = true; });
  expectMaterial([](scene::Material& m) { m.base_color_texture.nearest = true; });
  expectMaterial([](scene::Material& m) { m.emissive_texture.nearest = true; });
}

TEST(SceneChange, howRoughAMaterialIsMattersWhereItReflectsAsAMirror) {
  for (const bool is_metal : {false, true}) {
    Scene before = textured();
    before.materials[0].metallic = is_metal ? 1.0F : 0.0F;
    Scene after = before;
    after.materials[0].roughness = 0.5F;
    const auto change = changeBetween(before, after);
    EXPECT_FALSE(change.geometry);
    EXPECT_EQ(change.nothing(), !is_metal);
  }
}

TEST(SceneChange, glassThatReflectsOtherwiseIsAnotherShapeThoughAsMuchPasses) {
  Scene before = textured();
  before.materials[0].transmission = 1.0F;
  before.materials[0].base_color = glm::vec3(0.0F);  // nothing passes
  Scene after = before;
  after.materials[0].ior = 2.5F;
  EXPECT_TRUE(changeBetween(before, after).geometry);
  before.materials[0].transmission = 0.0F;
  EXPECT_TRUE(changeBetween(before, after).geometry);
}

// A factor of metal is 1 where its texture says where metal is, so that factors alone would let nothing pass.
TEST(SceneChange, whateverDecidesWhatPassesIsShape) {
  Scene before = textured();
  auto& glass = before.materials[0];
  glass.transmission = 0.5F;
  glass.metallic = 1.0F;
  glass.transmission_texture.texture = 0;
  const auto expectShape = [&](const auto& edit) {
    Scene after = before;
    edit(after.materials[0]);
    EXPECT_TRUE(changeBetween(before, after).geometry);
  };
  expectShape([](scene::Material& m) { m.base_color.r = 0.5F; });
  expectShape([](scene::Material& m) { m.transmission = 0.6F; });
  expectShape([](scene::Material& m) { m.attenuation.g = 0.5F; });
  expectShape([](scene::Material& m) { m.metallic = 0.5F; });
  expectShape([](scene::Material& m) { m.transmission_texture.texture = 1; });
  expectShape([](scene::Material& m) { m.base_color_texture.texture = 1; });
  expectShape([](scene::Material& m) { m.metallic_texture.texture = 0; });
}

TEST(SceneChange, aFilterOfACutOutMovesItsEdgeAndSoChangesTheShape) {
  Scene before = textured();
  before.materials[0].alpha_mode = scene::AlphaMode::kMask;
  Scene after = before;
  after.materials[0].base_color_texture.nearest = true;
  EXPECT_TRUE(changeBetween(before, after).geometry);
}

TEST(SceneChange, aNodeOfSeveralInstancesDoesNotOnlyMove) {
  Scene before = textured();
  before.instances.push_back({1, 0});
  const auto movedBy = [&](std::initializer_list<std::size_t> instances) {
    Scene after = before;
    for (const auto i : instances) after.instances[i].world[3].x += 1.0;
    return onlyNodesMoved(before, after);
  };
  EXPECT_TRUE(movedBy({0})) << "each of these has a node of its own";
  EXPECT_TRUE(movedBy({0, 1}));
  before.instances[0].node = before.instances[1].node = 1;
  EXPECT_TRUE(movedBy({}));
  EXPECT_FALSE(movedBy({0})) << "it has a place of its own beside the node's";
  EXPECT_FALSE(movedBy({0, 1})) << "so have both";
}

TEST(SceneChange, posesAndNormalsAreGeometry) {
  const Scene before = textured();
  Scene after = textured();
  after.primitives.edit(0, [](scene::Primitive& p) { p.positions[2].z = 0.1; });
  EXPECT_TRUE(changeBetween(before, after).geometry);
  EXPECT_FALSE(onlyNodesMoved(before, after));
  after = textured();
  after.primitives.edit(0, [](scene::Primitive& p) { p.normals[2] = {0.6F, 0, 0.8F}; });
  EXPECT_TRUE(changeBetween(before, after).geometry);
}

}  // namespace
}  // namespace radiosity::engine
