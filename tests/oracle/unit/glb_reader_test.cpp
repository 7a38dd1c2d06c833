// Materials by place, as a file states them: pictures are PPMs in the file itself.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/oracle/shading.h"
#include "tests/oracle/triangle_scene.h"
#include "tests/unit/client/temporary_folder.h"

namespace radiosity::oracle {
namespace {

using nlohmann::json;

/// A triangle (0,0) (1,0) (0,1) with its own coordinates as texture coordinates, under `material`, whose texture 0 has
/// a left pixel of `left` and a right one of `right`, nearest. As .gltf with all of its data in URIs beside it.
TriangleScene readTriangle(const json& material, const std::string& left, const std::string& right,
                           const json& more_attributes = json::object(), const json& more_of_mesh = json::object()) {
  const TemporaryFolder folder;
  const std::vector<float> numbers{0,
                                   0,
                                   0,
                                   1,
                                   0,
                                   0,
                                   0,
                                   1,
                                   0,
                                   /* uv */ 0,
                                   0,
                                   1,
                                   0,
                                   0,
                                   1,
                                   /* normals */ 0,
                                   0,
                                   1,
                                   0,
                                   0,
                                   0,
                                   0,
                                   0,
                                   2,
                                   /* colours */ 1,
                                   1,
                                   1,
                                   0,
                                   0,
                                   0,
                                   1,
                                   1,
                                   1,
                                   /* one colour */ 0.5,
                                   0.25,
                                   1,
                                   0.5,
                                   0.25,
                                   1,
                                   0.5,
                                   0.25,
                                   1};
  folder.write("data.bin", std::string(reinterpret_cast<const char*>(numbers.data()), 4 * numbers.size()));
  folder.write("a b.ppm", "P6\n2 1\n255\n" + left + right);
  json attributes{{"POSITION", 0}, {"TEXCOORD_0", 1}};
  attributes.update(more_attributes);
  json mesh{{"primitives", {{{"attributes", attributes}, {"material", 0}}}}};
  mesh.merge_patch(more_of_mesh);
  if (mesh.contains("targets")) mesh["primitives"][0]["targets"] = mesh["targets"];
  json gltf{{"asset", {{"version", "2.0"}}},
            {"scenes", {{{"nodes", {0}}}}},
            {"nodes", {{{"mesh", 0}}}},
            {"images", {{{"uri", "a%20b.ppm"}}}},
            {"samplers", {{{"magFilter", 9728}}}},
            {"textures", {{{"source", 0}, {"sampler", 0}}}},
            {"materials", {material}},
            {"meshes", json::array({mesh})},
            {"buffers", {{{"byteLength", 168}, {"uri", "data.bin"}}}},
            {"bufferViews", {{{"buffer", 0}, {"byteLength", 168}}}}};
  for (const auto& [offset, type] : {std::pair{0, "VEC3"}, {36, "VEC2"}, {60, "VEC3"}, {96, "VEC3"}, {132, "VEC3"}})
    gltf["accessors"].push_back(
        {{"bufferView", 0}, {"byteOffset", offset}, {"componentType", 5126}, {"count", 3}, {"type", type}});
  folder.write("a.gltf", gltf.dump());
  return readGlb(folder.file("a.gltf"));
}

const json kTexture{{"index", 0}};

TEST(GlbReader, MetalIsReadWhereTheTexturesUvsAre) {
  const auto scene = readTriangle(
      {{"pbrMetallicRoughness", {{"baseColorFactor", {0.8, 0.4, 0.2, 1}}, {"metallicRoughnessTexture", kTexture}}}},
      std::string("\0\0\0", 3), "\xFF\xFF\xFF");
  const Shading shading(scene);
  const auto& triangle = shading.triangles().at(0);
  EXPECT_NEAR(shading.reflectance(triangle, 0.25, 0.1).x, 0.8, 1e-9);  // u = 0.25: no metal
  EXPECT_EQ(shading.reflectance(triangle, 0.75, 0.1).x, 0.0);
}

TEST(GlbReader, SpecularGlossinessLeavesWhatTheLargestSpecularChannelDoesNotTake) {
  const json gloss{{"diffuseFactor", {0.8, 0.4, 0.2, 1}}, {"specularFactor", {0.25, 0.5, 0.1}}};
  const auto plain = readTriangle({{"extensions", {{"KHR_materials_pbrSpecularGlossiness", gloss}}}}, "abc", "abc");
  EXPECT_NEAR(plain.triangles.at(0).reflectance.x, 0.4, 1e-9);
  auto textured = gloss;
  textured["specularGlossinessTexture"] = kTexture;
  const auto scene = readTriangle({{"extensions", {{"KHR_materials_pbrSpecularGlossiness", textured}}}},
                                  std::string("\xFF\0\0", 3), std::string("\0\0\0", 3));
  const Shading shading(scene);
  EXPECT_NEAR(shading.reflectance(shading.triangles()[0], 0.25, 0.1).y, 0.4 * 0.75, 1e-9);
  EXPECT_NEAR(shading.reflectance(shading.triangles()[0], 0.75, 0.1).y, 0.4, 1e-9);
}

TEST(GlbReader, EmissionIsThePictureTimesFactorAndStrength) {
  const auto scene = readTriangle({{"emissiveFactor", {1, 0.5, 0}},
                                   {"emissiveTexture", kTexture},
                                   {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4.0}}}}}},
                                  std::string("\0\0\0", 3), std::string("\x80\xFF\xFF", 3));
  const Shading shading(scene);
  EXPECT_EQ(shading.emission(shading.triangles()[0], 0.25, 0.1), glm::dvec3(0.0));
  const auto bright = shading.emission(shading.triangles()[0], 0.75, 0.1);
  EXPECT_NEAR(bright.x, std::numbers::pi * 4.0 * 0.21586, 1e-3);
  EXPECT_NEAR(bright.y, std::numbers::pi * 2.0, 1e-9);
  EXPECT_TRUE(scene.warnings.empty());
}

TEST(GlbReader, NormalsAreOfUnitLengthOrNone) {
  const auto scene = readTriangle(json::object(), "abc", "abc", {{"NORMAL", 2}});
  EXPECT_EQ(scene.triangles.at(0).shading[0], glm::dvec3(0, 0, 1));
  EXPECT_EQ(scene.triangles.at(0).shading[1], glm::dvec3(0.0));
  EXPECT_EQ(scene.triangles.at(0).shading[2], glm::dvec3(0, 0, 1));
}

TEST(GlbReader, ColoursOfVerticesVaryOverTheTriangle) {
  const auto scene = readTriangle({{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}, "abc", "abc", {{"COLOR_0", 3}});
  const Shading shading(scene);
  EXPECT_NEAR(shading.reflectance(shading.triangles().at(0), 0.5, 0.25).x, 0.5, 1e-9);
}

/// Of glass: factor, colours and extensions that its tint is made of.
json glass(const json& transmission) {
  return {{"pbrMetallicRoughness", {{"baseColorFactor", {0.8, 0.4, 0.5, 1}}, {"metallicFactor", 0}}},
          {"extensions",
           {{"KHR_materials_transmission", transmission},
            {"KHR_materials_volume",
             {{"attenuationColor", {0.25, 1, 0}}, {"attenuationDistance", 2}, {"thicknessFactor", 4}}}}}};
}

TEST(GlbReader, GlassPassesWhatTheRedOfItsTextureSays) {
  const auto scene = readTriangle(glass({{"transmissionFactor", 0.5}, {"transmissionTexture", kTexture}}),
                                  std::string("\x33\xFF\xFF", 3), std::string("\xCC\0\0", 3));
  const Shading shading(scene);
  const auto& triangle = shading.triangles().at(0);
  EXPECT_NEAR(shading.passing(triangle, 0.25, 0.1), 0.5 * 0.2, 1e-9);
  EXPECT_NEAR(shading.passing(triangle, 0.75, 0.1), 0.5 * 0.8, 1e-9);
  EXPECT_NEAR(shading.reflectance(triangle, 0.75, 0.1).x, 0.8 * 0.6, 1e-9);
  EXPECT_TRUE(scene.warnings.empty());
}

// Each of two faces has the root of what the whole thickness, twice the distance, leaves.
TEST(GlbReader, GlassIsTintedByFactorTimesColoursTimesHalfItsVolume) {
  const json clear{{"transmissionFactor", 1}};
  const auto uniform = readTriangle(glass(clear), "abc", "abc", {{"COLOR_0", 4}});
  const auto tint = Shading(uniform).tint(uniform.triangles.at(0), 0.5, 0.25);
  EXPECT_NEAR(tint.x, 0.8 * 0.5 * 0.25, 1e-9);
  EXPECT_NEAR(tint.y, 0.4 * 0.25, 1e-9);
  EXPECT_EQ(tint.z, 0.0);
  const auto varying = readTriangle(glass(clear), "abc", "abc", {{"COLOR_0", 3}});
  EXPECT_NEAR(Shading(varying).tint(varying.triangles.at(0), 0.5, 0.25).y, 0.4 * 0.5, 1e-9);
  auto textured = glass(clear);
  textured["pbrMetallicRoughness"]["baseColorTexture"] = kTexture;
  const auto by_place = readTriangle(textured, std::string("\0\0\0", 3), std::string("\xFF\x80\xFF", 3));
  EXPECT_EQ(Shading(by_place).tint(by_place.triangles.at(0), 0.25, 0.1), glm::dvec3(0.0));
  EXPECT_NEAR(Shading(by_place).tint(by_place.triangles.at(0), 0.75, 0.1).y, 0.4 * 0.21586, 1e-3);
}

// Two targets, each of which moves the corners by their own positions.
TEST(GlbReader, MorphTargetsAddTheirWeights) {
  const json two{{{"POSITION", 0}}, {{"POSITION", 0}}};
  const auto scene =
      readTriangle(json::object(), "abc", "abc", json::object(), {{"targets", two}, {"weights", {0.5, 0.25}}});
  EXPECT_EQ(scene.triangles.at(0).corners[1], glm::dvec3(1.75, 0, 0));
  EXPECT_EQ(scene.triangles.at(0).corners[2], glm::dvec3(0, 1.75, 0));
}

TEST(GlbReader, ATextureThatIsNotThereCostsTheTextureAndIsNamed) {
  const auto scene = readTriangle(
      {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"baseColorTexture", {{"index", 7}}}}}}, "abc", "abc");
  EXPECT_EQ(scene.triangles.at(0).base_colour.texture, -1);
  ASSERT_EQ(scene.warnings.size(), 1U);
  EXPECT_NE(scene.warnings[0].find("baseColorTexture"), std::string::npos);
}

}  // namespace
}  // namespace radiosity::oracle
