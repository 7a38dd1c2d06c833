#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/accuracy/compare.h"
#include "tests/accuracy/lit_scene.h"
#include "tests/accuracy/unit/glb_file.h"
#include "tests/scenes/scenes.h"

namespace radiosity::accuracy {
namespace {

std::filesystem::path scratch(const std::string& name) {
  const auto folder = std::filesystem::temp_directory_path() /
                      (std::string("radiosity_") + testing::UnitTest::GetInstance()->current_test_info()->name());
  std::filesystem::create_directories(folder);
  return folder / name;
}

/// The furnace cube with each face on its own 8 x 8 texels of a 32 x 16 page, of a constant irradiance.
LitScene litFurnace(double rho, float value) {
  LitScene lit{oracle::triangulate(test_scenes::furnace(glm::dvec3(rho), glm::dvec3(1.0))), {}};
  lit.pages.push_back({32, 16, std::vector<glm::vec3>(std::size_t{32} * 16, glm::vec3(value))});
  for (std::size_t t = 0; t < lit.scene.triangles.size(); ++t) {
    auto& triangle = lit.scene.triangles[t];
    const auto face = t / 2;
    const glm::dvec2 corner(static_cast<double>(face % 3) * 10 + 1, static_cast<double>(face / 3) * 8);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& p = triangle.corners[k];
      const glm::dvec2 local = std::abs(triangle.normal.x) > 0.5   ? glm::dvec2(p.y, p.z)
                               : std::abs(triangle.normal.y) > 0.5 ? glm::dvec2(p.x, p.z)
                                                                   : glm::dvec2(p.x, p.y);
      triangle.lightmap_uv[k] = (corner + 8.0 * local) / glm::dvec2(32, 16);
    }
    triangle.lightmap_page = 0;
  }
  return lit;
}

TEST(LitScene, ExrSurvivesTheRoundTripWithRowZeroFirst) {
  Page page{3, 2, {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {1e6F, 0, 1e-6F}, {0, 0, 0}, {-1, 0.5F, 2}}};
  const auto file = scratch("page.exr");
  writeExr(page, file);
  const auto read = readExr(file);
  ASSERT_EQ(read.width, 3);
  ASSERT_EQ(read.height, 2);
  EXPECT_EQ(read.pixels, page.pixels);
}

TEST(LitScene, GlbAndPagesAreReadAsWritten) {
  // one right triangle, its node moved and turned upside down by a mirror
  const std::vector<float> numbers{0, 0, 0, 1, 0, 0, 0, 1, 0, /* uv */ 0, 0, 1, 0, 0, 1};
  nlohmann::json gltf{
      {"asset", {{"version", "2.0"}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}, {"name", "thing"}, {"translation", {0, 0, 5}}, {"scale", {1, 1, -1}}}}},
      {"materials",
       {{{"pbrMetallicRoughness", {{"baseColorFactor", {0.2, 0.4, 0.6, 1}}, {"metallicFactor", 0.5}}},
         {"emissiveFactor", {1, 0, 0}},
         {"doubleSided", true},
         {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 3.0}}}}}}}},
      {"meshes",
       {{{"primitives",
          {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_1", 1}, {"COLOR_0", 3}}},
            {"indices", 2},
            {"material", 0},
            {"extras", {{"lightmap", 0}}}}}}}}},
      {"buffers", {{{"byteLength", 76}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 36}},
        {{"buffer", 0}, {"byteOffset", 36}, {"byteLength", 24}},
        {{"buffer", 0}, {"byteOffset", 60}, {"byteLength", 3}},
        {{"buffer", 0}, {"byteOffset", 64}, {"byteLength", 12}}}},
      {"accessors",
       {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}},
        {{"bufferView", 1}, {"componentType", 5126}, {"count", 3}, {"type", "VEC2"}},
        {{"bufferView", 2}, {"componentType", 5121}, {"count", 3}, {"type", "SCALAR"}},
        {{"bufferView", 3}, {"componentType", 5121}, {"normalized", true}, {"count", 3}, {"type", "VEC4"}}}}};
  std::string bin(reinterpret_cast<const char*>(numbers.data()), 60);
  bin.append("\0\1\2\0", 4);
  for (int corner = 0; corner < 3; ++corner) bin.append("\xFF\x33\0\xFF", 4);  // red 1, green 0.2, blue 0
  const auto glb = scratch("lit.glb");
  writeGlb(gltf, bin, glb);
  writeExr({1, 1, {{7, 8, 9}}}, scratch("lit.lightmap.0.exr"));

  const auto lit = readLitScene(glb);
  ASSERT_EQ(lit.scene.triangles.size(), 1U);
  const auto& triangle = lit.scene.triangles[0];
  EXPECT_NEAR(triangle.normal.z, -1.0, 1e-12);
  EXPECT_EQ(triangle.corners[0].z, 5.0);
  EXPECT_NEAR(triangle.reflectance.x, 0.1, 1e-12);
  EXPECT_NEAR(triangle.reflectance.y, 0.2 * 0.2, 1e-12);
  EXPECT_EQ(triangle.reflectance.z, 0.0);
  EXPECT_NEAR(triangle.emission_lux.x, 3.0 * std::numbers::pi, 1e-12);
  EXPECT_TRUE(triangle.double_sided);
  EXPECT_EQ(lit.scene.node_names[triangle.node], "thing");
  EXPECT_EQ(lit.pages.at(0).at(0, 0), glm::dvec3(7, 8, 9));
}

// As on the board of the extension's sample: turned counter-clockwise, v being down, after it is scaled.
TEST(LitScene, TexturesAreMovedTurnedAndScaled) {
  const std::vector<float> numbers{0, 0, 0, 1, 0, 0, 0, 1, 0, /* uv */ 0, 0, 1, 0, 0, 1};
  const double turn = std::numbers::pi / 6.0;
  const nlohmann::json transform{{"offset", {0.25, 0.5}}, {"rotation", turn}, {"scale", {2.0, 4.0}}};
  const nlohmann::json gltf{
      {"asset", {{"version", "2.0"}}},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"images", {{{"uri", "elsewhere.png"}}}},
      {"textures", {{{"source", 0}}}},
      {"materials",
       {{{"pbrMetallicRoughness",
          {{"baseColorTexture", {{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}}}}}}}},
      {"meshes",
       {{{"primitives",
          {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}, {"TEXCOORD_1", 1}}},
            {"material", 0},
            {"extras", {{"lightmap", 0}}}}}}}}},
      {"buffers", {{{"byteLength", 60}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 36}},
        {{"buffer", 0}, {"byteOffset", 36}, {"byteLength", 24}}}},
      {"accessors",
       {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}},
        {{"bufferView", 1}, {"componentType", 5126}, {"count", 3}, {"type", "VEC2"}}}}};
  const auto glb = scratch("turned.glb");
  writeGlb(gltf, std::string(reinterpret_cast<const char*>(numbers.data()), 60), glb);
  const auto scene = oracle::readGlb(glb);
  ASSERT_EQ(scene.triangles.size(), 1U);
  const auto& uv = scene.triangles[0].base_colour.uv;
  const double c = std::cos(turn), s = std::sin(turn);
  const std::array<glm::dvec2, 3> expected{
      glm::dvec2(0.25, 0.5), {0.25 + 2 * c, 0.5 - 2 * s}, {0.25 + 4 * s, 0.5 + 4 * c}};
  for (std::size_t k = 0; k < 3; ++k) EXPECT_LT(glm::distance(uv[k], expected[k]), 1e-6) << k;
  EXPECT_EQ(scene.triangles[0].lightmap_uv[1], glm::dvec2(1.0, 0.0));
}

TEST(LitScene, BilinearLookupHasTexelCentresAtHalfIntegers) {
  const Page page{2, 1, {glm::vec3(1), glm::vec3(3)}};
  EXPECT_EQ(page.bilinear({0.25, 0.5}).x, 1.0);
  EXPECT_EQ(page.bilinear({0.75, 0.5}).x, 3.0);
  EXPECT_EQ(page.bilinear({0.5, 0.5}).x, 2.0);
  EXPECT_EQ(page.bilinear({0.0, 0.0}).x, 1.0);
}

TEST(FindTexels, EveryTexelOfAFaceIsWholeAndAreasAddUp) {
  const auto texels = findTexels(litFurnace(0.5, 1.0F));
  ASSERT_EQ(texels.size(), 6U * 64U);
  double area = 0.0;
  for (const auto& texel : texels) {
    EXPECT_NEAR(texel.coverage, 1.0, 1e-9);
    area += texel.footprint.area();
  }
  EXPECT_NEAR(area, 6.0, 1e-9);
}

// The page holds one value for both; each is held against the truth of its own side.
TEST(FindTexels, TheSidesOfADoubleSidedSurfaceAreTexelsOfTheirOwn) {
  auto lit = litFurnace(0.5, 1.0F);
  for (auto& triangle : lit.scene.triangles) triangle.double_sided = triangle.normal.x > 0.5;  // one wall
  const auto texels = findTexels(lit);
  ASSERT_EQ(texels.size(), 7U * 64U);
  std::size_t backs = 0;
  for (const auto& texel : texels) {
    for (const auto& piece : texel.footprint.pieces) {
      EXPECT_EQ(piece.normal, (texel.back ? -1.0 : 1.0) * lit.scene.triangles[piece.triangle].normal);
    }
    backs += texel.back ? 1 : 0;
  }
  EXPECT_EQ(backs, 64U);
}

TEST(Compare, ExactFurnaceHasNoErrorAndAScaledOneItsScale) {
  const double exact = 2.0 * std::numbers::pi;
  const auto lit = litFurnace(0.5, static_cast<float>(exact));
  const ReferenceOptions options{.texel_samples = 512, .point_samples = 512, .texels = 50, .points = 50};
  const auto reference = makeReference(lit, options);
  const auto good = measure(lit, reference);
  EXPECT_EQ(good.solver.count, 50U);
  EXPECT_LT(good.solver.relative_rms, 1.5 * good.solver.reference_noise + 1e-6);
  EXPECT_LT(std::abs(good.total.bias), 0.01);
  EXPECT_NEAR(good.surface.mean_ratio, 1.0, 0.01);
  EXPECT_EQ(good.surface.compared, 50U);
  const auto bad = measure(litFurnace(0.5, static_cast<float>(1.1 * exact)), reference);
  EXPECT_NEAR(bad.solver.solverRms(), 0.1, 0.01);
  EXPECT_NEAR(bad.total.bias, 0.1, 0.01);
  EXPECT_NEAR(bad.surface.mean_ratio, 1.1, 0.01);
  EXPECT_NEAR(bad.surface.rms(), 0.1, 0.01);
}

TEST(Compare, LayoutsAreTheSameOnlyWhenUvsAre) {
  const auto a = litFurnace(0.5, 1.0F);
  auto b = litFurnace(0.5, 2.0F);
  EXPECT_TRUE(sameLayout(a, b));
  b.scene.triangles[3].lightmap_uv[1].x += 1e-3;
  EXPECT_FALSE(sameLayout(a, b));
}

}  // namespace
}  // namespace radiosity::accuracy
