#include "client/engines/baked_materials.h"

#include <gtest/gtest.h>

#include "client/engines/gltf_json.h"

namespace radiosity::engines {
namespace {

/// A scene of one triangle, whose material it is, on page 0.
Json sceneWith(const char* material) {
  Json gltf = Json::parse(R"({"meshes": [{"primitives": [{"material": 0, "extras": {"lightmap": 0}}]}]})");
  gltf["materials"] = Json::array({Json::parse(material)});
  return gltf;
}

/// What becomes of a material that has a lightmap.
Json lit(const char* material) {
  Json gltf = sceneWith(material);
  splitMaterialsByPage(gltf, 1);
  keepDiffuseOnly(gltf);
  return gltf["materials"][0];
}

TEST(BakedMaterials, onTwoPagesBecomeTwo) {
  Json gltf = Json::parse(R"({"materials": [{"name": "wall"}], "meshes": [{"primitives": [
      {"material": 0, "extras": {"lightmap": 0}}, {"material": 0, "extras": {"lightmap": 1}},
      {"material": 0, "extras": {"lightmap": 1}}, {"material": 0}]}]})");
  splitMaterialsByPage(gltf, 2);
  EXPECT_EQ(gltf["materials"], Json::parse(R"([{"name": "wall", "extras": {"lightmap": 0}},
      {"name": "wall", "extras": {"lightmap": 1}}, {"name": "wall"}])"));
  const auto& primitives = gltf["meshes"][0]["primitives"];
  EXPECT_EQ(primitives[0]["material"], 0);
  EXPECT_EQ(primitives[1]["material"], 1);
  EXPECT_EQ(primitives[2]["material"], 1);
  EXPECT_EQ(primitives[3]["material"], 2);
}

TEST(BakedMaterials, aPrimitiveWithoutOneIsWhite) {
  Json gltf = Json::parse(R"({"meshes": [{"primitives": [{"extras": {"lightmap": 0}}, {}]}]})");
  splitMaterialsByPage(gltf, 1);
  ASSERT_EQ(gltf["materials"].size(), 1U);
  EXPECT_EQ(gltf["materials"][0]["extras"]["lightmap"], 0);
  EXPECT_FALSE(gltf["meshes"][0]["primitives"][1].contains("material"));
}

TEST(BakedMaterials, aLightmapThatTheUserNamedIsForgotten) {
  Json gltf = Json::parse(R"({"materials": [{"extras": {"lightmap": 0}}, {"extras": {"lightmap": "a.png", "mine": 1}}],
      "meshes": [{"primitives": [{"material": 0}, {"material": 1}]}]})");
  splitMaterialsByPage(gltf, 1);
  EXPECT_EQ(gltf["materials"], Json::parse(R"([{}, {"extras": {"mine": 1}}])"));
}

TEST(BakedMaterials, unlitOnesAreLitWhereTheyHaveALightmap) {
  Json gltf = sceneWith(R"({"extensions": {"KHR_materials_unlit": {}}})");
  gltf["materials"].push_back(Json::parse(R"({"extensions": {"KHR_materials_unlit": {}}})"));
  gltf["extensionsUsed"] = {"KHR_materials_unlit"};
  splitMaterialsByPage(gltf, 1);
  keepDiffuseOnly(gltf);
  trimExtensionLists(gltf);
  EXPECT_EQ(extension(gltf["materials"][0], "KHR_materials_unlit"), nullptr);
  EXPECT_NE(extension(gltf["materials"][1], "KHR_materials_unlit"), nullptr);
  EXPECT_EQ(gltf["extensionsUsed"], Json::array({"KHR_materials_unlit", "KHR_materials_specular"}));
  gltf["materials"].erase(1);
  trimExtensionLists(gltf);
  EXPECT_EQ(gltf["extensionsUsed"], Json::array({"KHR_materials_specular"}));
}

TEST(BakedMaterials, layersThatWereNotSolvedForGo) {
  const auto material = lit(R"({"occlusionTexture": {"index": 0}, "extensions": {"KHR_materials_clearcoat": {},
      "KHR_materials_sheen": {}, "KHR_materials_iridescence": {}, "KHR_materials_anisotropy": {},
      "KHR_materials_diffuse_transmission": {}, "KHR_materials_ior": {"ior": 1.4}}})");
  EXPECT_FALSE(material.contains("occlusionTexture"));
  EXPECT_EQ(material["extensions"],
            Json::parse(R"({"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_specular": {"specularFactor": 0.0}})"));
}

TEST(BakedMaterials, specularGlossinessBecomesBaseColour) {
  const auto colourOf = [](const char* gloss) {
    const auto text = std::string(R"({"extensions": {"KHR_materials_pbrSpecularGlossiness": )") + gloss + "}}";
    return lit(text.c_str())["pbrMetallicRoughness"]["baseColorFactor"];
  };
  EXPECT_EQ(colourOf(R"({"diffuseFactor": [0.5, 0.25, 1, 1], "specularFactor": [0.5, 0, 0]})"),
            Json::array({0.25, 0.125, 0.5, 1.0}));
  EXPECT_EQ(colourOf(R"({"diffuseFactor": [0.5, 0.25, 1, 1]})"), Json::array({0.0, 0.0, 0.0, 1.0}));
  // The factor is 1 then, and says nothing of what the texture mirrors.
  EXPECT_EQ(colourOf(R"({"diffuseFactor": [0.5, 0.25, 1, 1], "specularGlossinessTexture": {"index": 0}})"),
            Json::array({0.5, 0.25, 1.0, 1.0}));
}

TEST(BakedMaterials, withoutALightmapStayAsTheyAre) {
  const Json before = Json::parse(R"({"materials": [{"extensions": {"KHR_materials_pbrSpecularGlossiness": {}}}],
      "extensionsUsed": ["KHR_materials_pbrSpecularGlossiness", "KHR_mesh_quantization"]})");
  Json gltf = before;
  splitMaterialsByPage(gltf, 1);
  keepDiffuseOnly(gltf);
  trimExtensionLists(gltf);
  EXPECT_EQ(gltf, before);
}

}  // namespace
}  // namespace radiosity::engines
