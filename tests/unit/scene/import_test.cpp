// What each glTF feature becomes, on files small enough to read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <numbers>

#include "server/scene/lightmap.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using Json = nlohmann::json;

Scene imported(const GltfBuilder& builder) {
  auto scene = builder.scene();
  EXPECT_TRUE(scene) << scene.error().text();
  return scene ? std::move(*scene) : Scene{};
}

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

TEST(Import, materialsCarryWhatLightNeeds) {
  GltfBuilder builder;
  builder.gltf["materials"] =
      Json::array({{{"name", "lamp"},
                    {"emissiveFactor", {1, 0.5, 2}},
                    {"doubleSided", true},
                    {"alphaMode", "BLEND"},
                    {"pbrMetallicRoughness", {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0.25}}},
                    {"extensions",
                     {{"KHR_materials_emissive_strength", {{"emissiveStrength", 10}}},
                      {"KHR_materials_transmission", {{"transmissionFactor", 0.75}}}}}}});
  const auto material = imported(builder).materials.at(0);
  EXPECT_EQ(material.emission, glm::vec3(10, 5, 20));
  EXPECT_EQ(material.base_color, glm::vec3(0.1F, 0.2F, 0.3F));
  EXPECT_EQ(material.alpha, 0.4F);
  EXPECT_EQ(material.metallic, 0.25F);
  EXPECT_EQ(material.transmission, 0.75F);
  EXPECT_TRUE(material.double_sided);
  EXPECT_EQ(material.alpha_mode, AlphaMode::kBlend);
  EXPECT_THAT(builder.scene()->warnings, Contains(HasSubstr("/materials/0/emissiveFactor")));
}

TEST(Import, metalIsGltfsDefaultAndIsNamed) {
  GltfBuilder builder;
  builder.gltf["materials"] = Json::array({{{"name", "foil"}}});
  const auto scene = imported(builder);
  EXPECT_EQ(scene.materials.at(0).metallic, 1.0F);
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("'foil'")));
}

TEST(Import, aMeshWithoutMaterialIsWhiteAndVisible) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.materials.size(), 1U);
  EXPECT_EQ(scene.primitives.at(0).material, 0U);
  EXPECT_EQ(scene.materials[0].metallic, 0.0F);
}

// 2 x 1 pixels: red, then blue.
constexpr const char* kPng =
    "data:image/"
    "png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAAD0lEQVR4nGP4z8DAwPAfAAcAAf9Ss3OLAAAAAElFTkSuQmCC";

TEST(Import, texturesAreDecodedWithTheirTransformAndWrap) {
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kPng}}});
  builder.gltf["samplers"] = Json::array({{{"wrapS", 33071}, {"wrapT", 33648}}});
  builder.gltf["textures"] = Json::array({{{"source", 0}, {"sampler", 0}}});
  const Json transform = {{"offset", {0.5, 0}}, {"rotation", 1.5}, {"scale", {2, 3}}, {"texCoord", 1}};
  const Json info = {{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}};
  builder.gltf["materials"] = Json::array(
      {{{"pbrMetallicRoughness", {{"baseColorTexture", info}, {"metallicRoughnessTexture", {{"index", 0}}}}}}});
  const auto scene = imported(builder);
  const auto& use = scene.materials.at(0).base_color_texture;
  ASSERT_EQ(use.texture, 0U);
  EXPECT_EQ(use.texcoord, 1);
  EXPECT_EQ(use.offset, glm::vec2(0.5F, 0.0F));
  EXPECT_EQ(use.scale, glm::vec2(2.0F, 3.0F));
  EXPECT_EQ(use.rotation, 1.5F);
  EXPECT_FALSE(use.repeat_u);
  EXPECT_TRUE(use.mirror_v);
  EXPECT_FALSE(use.nearest);
  EXPECT_TRUE(scene.materials[0].metallic_texture.nearest) << "no filter is named: texels of metal keep apart";
  ASSERT_EQ(scene.textures.size(), 2U);
  EXPECT_THAT(scene.textures[0].rgba, ElementsAre(255, 0, 0, 255, 0, 0, 255, 255));
  EXPECT_TRUE(scene.textures[0].srgb);
  EXPECT_EQ(scene.materials[0].metallic, 1.0F);
  ASSERT_EQ(scene.materials[0].metallic_texture.texture, 1U);  // the same picture, read as plain numbers
  EXPECT_FALSE(scene.textures[1].srgb);
  builder.gltf["samplers"][0]["magFilter"] = 9728;
  EXPECT_TRUE(imported(builder).materials[0].base_color_texture.nearest);
  builder.gltf["samplers"][0]["magFilter"] = 9729;
  EXPECT_FALSE(imported(builder).materials[0].metallic_texture.nearest);
}

// 1 pixel, whose blue is 51 of 255.
constexpr const char* kBlue51 =
    "data:image/"
    "png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNg+G8MAAI1ATPVlABuAAAAAElFTkSuQmCC";

TEST(Import, aMetallicTextureThatIsTheSameAllOverIsPartOfTheFactor) {
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kBlue51}}});
  builder.gltf["textures"] = Json::array({{{"source", 0}}});
  builder.gltf["materials"] = Json::array(
      {{{"pbrMetallicRoughness", {{"metallicFactor", 0.5}, {"metallicRoughnessTexture", {{"index", 0}}}}}}});
  const auto scene = imported(builder);
  EXPECT_FLOAT_EQ(scene.materials[0].metallic, 0.1F);
  EXPECT_EQ(scene.materials[0].metallic_texture.texture, kNone);
  EXPECT_TRUE(scene.textures.empty());
}

TEST(Import, specularGlossinessComesBeforeMetallicRoughness) {
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kPng}}});
  builder.gltf["textures"] = Json::array({{{"source", 0}}});
  builder.gltf["extensionsRequired"] = builder.gltf["extensionsUsed"] = {"KHR_materials_pbrSpecularGlossiness"};
  Json extension = {{"diffuseFactor", {0.1, 0.2, 0.3, 0.4}},
                    {"diffuseTexture", {{"index", 0}}},
                    {"specularFactor", {0.5, 0.25, 0}},
                    {"specularGlossinessTexture", {{"index", 0}}}};
  builder.gltf["materials"] = Json::array({{{"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 1}}}},
                                            {"extensions", {{"KHR_materials_pbrSpecularGlossiness", extension}}}}});
  const auto scene = imported(builder);
  const auto& material = scene.materials.at(0);
  EXPECT_EQ(material.base_color, glm::vec3(0.1F, 0.2F, 0.3F));
  EXPECT_EQ(material.alpha, 0.4F);
  EXPECT_EQ(material.metallic, 0.0F);
  EXPECT_EQ(material.specular, glm::vec3(0.5F, 0.25F, 0.0F));
  EXPECT_EQ(material.base_color_texture.texture, 0U);
  EXPECT_EQ(material.specular_texture.texture, 0U);  // both are sRGB
  EXPECT_THAT(scene.warnings, testing::IsEmpty());
  builder.gltf["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"] = Json::object();
  EXPECT_EQ(imported(builder).materials[0].specular, glm::vec3(1.0F)) << "the extension's own default";
  EXPECT_THAT(imported(builder).warnings, Contains(HasSubstr("wholly specular")));
}

TEST(Import, danglingTextureReferencesCostTheTextureAndNotTheScene) {
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kPng}}});
  builder.gltf["textures"] =
      Json::array({{{"source", 7}}, {{"source", 0}, {"sampler", 3}}, {{"source", 0}, {"sampler", -1}}});
  builder.gltf["materials"] =
      Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 9}}}, {"metallicFactor", 0}}},
                    {"normalTexture", {{"index", 4294967296}}}},
                   {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}}},
                   {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 1}}}, {"metallicFactor", 0}}}},
                   {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 2}}}, {"metallicFactor", 0}}}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.materials.size(), 4U);
  EXPECT_EQ(scene.materials[0].base_color_texture.texture, kNone);
  EXPECT_EQ(scene.materials[1].base_color_texture.texture, kNone);
  EXPECT_EQ(scene.materials[2].base_color_texture.texture, 0U);
  EXPECT_TRUE(scene.materials[2].base_color_texture.repeat_u);
  EXPECT_THAT(
      scene.warnings,
      ElementsAre(HasSubstr("/materials/0/normalTexture/index: is 4294967296, but /textures has 3 entries"),
                  HasSubstr("/materials/0/pbrMetallicRoughness/baseColorTexture/index: is 9, but /textures has 3"),
                  HasSubstr("/textures/0/source: is 7, but /images has 1 entries; the texture is left out"),
                  HasSubstr("/textures/1/sampler: is 3, but /samplers has 0 entries"),
                  HasSubstr("/textures/2/sampler: is -1, but /samplers has 0 entries")));
}

TEST(Import, theLitSceneHasNoDanglingTextureReferences) {
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kPng}}});
  builder.gltf["textures"] = Json::array({{{"source", 7}}, {{"source", 0}, {"sampler", 3}}});
  const Json sheen = {{"sheenColorTexture", {{"index", 2}}}, {"sheenRoughnessFactor", 0.5}};
  builder.gltf["materials"] = Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}},
                                            {"emissiveTexture", {{"index", 1}}},
                                            {"normalTexture", {{"index", 9}}},
                                            {"extensions", {{"KHR_materials_sheen", sheen}}}}});
  const auto document = builder.document();
  ASSERT_TRUE(document);
  const auto lit = withLightmapUvs(*document, Scene{}, PatchScene{});
  ASSERT_TRUE(lit) << lit.error().text();
  const auto& material = lit->gltf["materials"][0];
  EXPECT_FALSE(material["pbrMetallicRoughness"].contains("baseColorTexture"));
  EXPECT_FALSE(material.contains("normalTexture"));
  EXPECT_EQ(material["emissiveTexture"]["index"], 1);
  EXPECT_FALSE(material["extensions"]["KHR_materials_sheen"].contains("sheenColorTexture"));
  EXPECT_EQ(material["extensions"]["KHR_materials_sheen"]["sheenRoughnessFactor"], 0.5);
  EXPECT_FALSE(lit->gltf["textures"][0].contains("source"));
  EXPECT_FALSE(lit->gltf["textures"][1].contains("sampler"));
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

TEST(Import, imagesOverThePixelBudgetAreRefusedBeforeDecoding) {
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kPng}}});
  builder.gltf["textures"] = Json::array({{{"source", 0}}});
  builder.gltf["materials"] = Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}});
  ImportLimits limits;
  limits.max_image_pixels = 1;
  const auto scene = builder.scene(limits);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(scene.error().where, "test.glb: /images/0");
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
