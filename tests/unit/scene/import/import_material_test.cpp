// What glTF's materials and textures become, on files small enough to read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/scene/document/png.h"
#include "server/scene/lightmap/lightmap.h"
#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/imported.h"

namespace radiosity::scene {
namespace {

using test::dataUri;
using test::GltfBuilder;
using test::imported;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using Json = nlohmann::json;

TEST(ImportMaterial, materialsCarryWhatLightNeeds) {
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

TEST(ImportMaterial, whatTransmitsDiffuselyHasTwoSides) {
  GltfBuilder builder;
  const Json leaf{{"diffuseTransmissionFactor", 0.25}, {"diffuseTransmissionColorFactor", {1.0, 0.5, 0.25}}};
  builder.gltf["extensionsRequired"] = builder.gltf["extensionsUsed"] = {"KHR_materials_diffuse_transmission"};
  builder.gltf["materials"] = Json::array(
      {{{"emissiveFactor", {1, 1, 1}},
        {"extensions",
         {{"KHR_materials_diffuse_transmission", leaf}, {"KHR_materials_volume", {{"thicknessFactor", 0.1}}}}}},
       {{"extensions", {{"KHR_materials_diffuse_transmission", Json::object()}}}}});
  const auto materials = imported(builder).materials;
  EXPECT_EQ(materials.at(0).diffuse_transmission, 0.25F);
  EXPECT_EQ(materials.at(0).diffuse_transmission_color, glm::vec3(1.0F, 0.5F, 0.25F));
  EXPECT_TRUE(materials.at(0).double_sided);
  EXPECT_FALSE(materials.at(1).isTranslucent());
  EXPECT_FALSE(materials.at(1).double_sided);
  const auto warnings = builder.scene()->warnings;
  EXPECT_THAT(warnings, Contains(HasSubstr("emits from both")));
  EXPECT_THAT(warnings, Contains(HasSubstr("thin sheets")));
}

TEST(ImportMaterial, transmissionHasItsTextureOrWhatThatIsAllOver) {
  for (const bool varies : {false, true}) {
    const std::vector<std::uint8_t> pixels{51, 255, 255, std::uint8_t(varies ? 153 : 51), 0, 0};
    const auto png = encodePng(2, 1, 3, pixels);
    GltfBuilder builder;
    builder.gltf["images"] = Json::array({{{"uri", dataUri({png.begin(), png.end()})}}});
    builder.gltf["textures"] = Json::array({{{"source", 0}}});
    const Json glass{{"transmissionFactor", 0.5}, {"transmissionTexture", {{"index", 0}}}};
    builder.gltf["materials"] = Json::array({{{"extensions", {{"KHR_materials_transmission", glass}}}}});
    const auto scene = imported(builder);
    const auto& material = scene.materials.at(0);
    EXPECT_NEAR(material.transmission, varies ? 0.5F : 0.1F, 1e-6F);
    ASSERT_EQ(material.transmission_texture.texture, varies ? 0U : kNone);
    if (!varies) continue;
    const auto& texture = scene.textures[material.transmission_texture.texture];
    EXPECT_FALSE(texture.srgb);
    EXPECT_EQ(texture.rgba[0], 51);
    EXPECT_EQ(texture.rgba[4], 153);
  }
}

TEST(ImportMaterial, ktx2IsRefusedWhereLightNeedsIt) {
  GltfBuilder builder;
  builder.gltf["extensionsRequired"] = builder.gltf["extensionsUsed"] = {"KHR_texture_basisu"};
  builder.gltf["images"] = Json::array({{{"uri", "data:image/ktx2;base64,q0tUWCAyMLsNChoK"}, {"name", "bumps"}}});
  builder.gltf["textures"] = Json::array({{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}});
  builder.gltf["materials"] = Json::array({{{"normalTexture", {{"index", 0}}}}});
  EXPECT_EQ(imported(builder).materials.size(), 1U);
  builder.gltf["materials"] = Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}});
  const auto scene = builder.scene();
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().message, HasSubstr("image 0 ('bumps') is KTX2"));
  EXPECT_THAT(scene.error().where, HasSubstr("/textures/0/extensions/KHR_texture_basisu"));
}

TEST(ImportMaterial, metalIsGltfsDefault) {
  GltfBuilder builder;
  builder.gltf["materials"] = Json::array({{{"name", "foil"}}});
  const auto scene = imported(builder);
  EXPECT_EQ(scene.materials.at(0).metallic, 1.0F);
  EXPECT_EQ(scene.materials.at(0).roughness, 1.0F);
}

TEST(ImportMaterial, aMeshWithoutMaterialIsWhiteAndVisible) {
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

TEST(ImportMaterial, texturesAreDecodedWithTheirTransformAndWrap) {
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

TEST(ImportMaterial, theTransformOfEveryTextureThatIsReadCounts) {
  const auto info = [](double offset) {
    return Json{{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"offset", {offset, 0}}, {"texCoord", 1}}}}}};
  };
  GltfBuilder builder;
  builder.gltf["images"] = Json::array({{{"uri", kPng}}});
  builder.gltf["textures"] = Json::array({{{"source", 0}}});
  builder.gltf["extensionsRequired"] = {"KHR_texture_transform"};
  builder.gltf["materials"] =
      Json::array({{{"emissiveFactor", {1, 1, 1}},
                    {"emissiveTexture", info(1)},
                    {"pbrMetallicRoughness", {{"baseColorTexture", info(2)}, {"metallicRoughnessTexture", info(3)}}}},
                   {{"extensions",
                     {{"KHR_materials_pbrSpecularGlossiness",
                       {{"diffuseTexture", info(4)}, {"specularGlossinessTexture", info(5)}}}}}}});
  const auto materials = imported(builder).materials;
  const auto& specular = materials.at(1);
  int expected = 1;
  for (const auto* use : {&materials[0].emissive_texture, &materials[0].base_color_texture,
                          &materials[0].metallic_texture, &specular.base_color_texture, &specular.specular_texture}) {
    EXPECT_EQ(use->offset, glm::vec2(static_cast<float>(expected++), 0.0F));
    EXPECT_EQ(use->texcoord, 1);
  }
}

// 1 pixel, whose blue is 51 of 255.
constexpr const char* kBlue51 =
    "data:image/"
    "png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNg+G8MAAI1ATPVlABuAAAAAElFTkSuQmCC";

TEST(ImportMaterial, aMetallicTextureThatIsTheSameAllOverIsPartOfTheFactor) {
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

TEST(ImportMaterial, whatIsOutOfRangeIsClampedAndItsPlaceNamed) {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"KHR_materials_ior"};
  builder.gltf["materials"] = Json::array({{{"pbrMetallicRoughness", {{"roughnessFactor", 1.5}, {"metallicFactor", 0}}},
                                            {"extensions", {{"KHR_materials_ior", {{"ior", 0}}}}}},
                                           {{"pbrMetallicRoughness", {{"roughnessFactor", -3}}},
                                            {"extensions", {{"KHR_materials_ior", {{"ior", 1.33}}}}}}});
  const auto scene = imported(builder);
  EXPECT_EQ(scene.materials.at(0).roughness, 1.0F);
  EXPECT_EQ(scene.materials[0].ior, 1.0F);
  EXPECT_EQ(scene.materials.at(1).roughness, 0.0F);
  EXPECT_EQ(scene.materials[1].ior, 1.33F);
  EXPECT_THAT(scene.warnings, testing::UnorderedElementsAre(
                                  HasSubstr("/materials/0/pbrMetallicRoughness/roughnessFactor: is not between"),
                                  HasSubstr("/materials/0/extensions/KHR_materials_ior/ior: is not between"),
                                  HasSubstr("/materials/1/pbrMetallicRoughness/roughnessFactor: is not between")));
}

TEST(ImportMaterial, specularGlossinessComesBeforeMetallicRoughness) {
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
  EXPECT_THAT(imported(builder).warnings, testing::IsEmpty());
}

TEST(ImportMaterial, danglingTextureReferencesCostTheTextureAndNotTheScene) {
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

TEST(ImportMaterial, theLitSceneHasNoDanglingTextureReferences) {
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

TEST(ImportMaterial, imagesOverThePixelBudgetAreRefusedBeforeDecoding) {
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

}  // namespace
}  // namespace radiosity::scene
