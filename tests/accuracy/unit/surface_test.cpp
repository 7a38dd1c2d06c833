// Lookups in lit files made by hand, whose truth is known: planes under a sky receive pi times its radiance.
#include "tests/accuracy/surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/accuracy/unit/glb_file.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"
#include "tests/unit/client/temporary_folder.h"

namespace radiosity::accuracy {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// The unit square of the floor, looking up, uv = (x, z) in a page of two texels; H = 1 on it and `below` under it.
LitScene floorUnderSky(float left, float right, double below = 0.0) {
  LitScene lit;
  lit.pages.push_back({2, 1, {glm::vec3(left), glm::vec3(right)}});
  const glm::dvec3 a(0, 0, 0), b(0, 0, 1), c(1, 0, 1), d(1, 0, 0);
  for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}}) {
    oracle::Triangle triangle;
    triangle.corners = corners;
    triangle.normal = {0, 1, 0};
    triangle.lightmap_page = 0;
    for (std::size_t k = 0; k < 3; ++k) triangle.lightmap_uv[k] = {corners[k].x, corners[k].z};
    lit.scene.triangles.push_back(triangle);
  }
  lit.scene.sky_upper = glm::dvec3(1.0 / std::numbers::pi);
  lit.scene.sky_lower = glm::dvec3(below / std::numbers::pi);
  return lit;
}

/// The flipped copy of each triangle, single-sided, its texture coordinates moved along.
void addFlippedCopies(LitScene& lit, double moved) {
  lit.unlit = lit.scene;
  for (auto& triangle : lit.unlit->triangles) triangle.double_sided = true;
  for (std::size_t t = 0; t < 2; ++t) {
    auto copy = lit.scene.triangles[t];
    std::swap(copy.corners[1], copy.corners[2]);
    std::swap(copy.lightmap_uv[1], copy.lightmap_uv[2]);
    for (auto& uv : copy.lightmap_uv) uv.x += moved;
    copy.normal = -copy.normal;
    lit.scene.triangles.push_back(copy);
  }
}

SurfaceError judge(const LitScene& lit, std::size_t count = 400) {
  return compareSurface(lit, makePoints(lit.traced(), count, 64, 1)).error;
}

TEST(Surface, AnExactLightmapHasNoErrorAndAScaledOneItsScale) {
  const auto exact = judge(floorUnderSky(1.0F, 1.0F));
  EXPECT_EQ(exact.compared, 400U);
  EXPECT_NEAR(exact.mean_ratio, 1.0, 1e-6);
  EXPECT_NEAR(exact.rms_with_noise, 0.0, 1e-6);
  const auto scaled = judge(floorUnderSky(0.5F, 0.5F));
  for (const double figure : {scaled.rms_with_noise, scaled.median, scaled.p95, scaled.p99, scaled.mean_ratio})
    EXPECT_NEAR(figure, 0.5, 1e-6);
}

// Half a texel at either end holds 0.5 or 1.5, between the centres it is a ramp: the square of the error is a quarter
// over half of the width, and a twelfth over the other half. 4,000 points know it to a hundredth.
TEST(Surface, ValuesAreLinearBetweenTexelsCentres) {
  const auto error = judge(floorUnderSky(0.5F, 1.5F), 4000);
  EXPECT_NEAR(error.rms_with_noise, std::sqrt(0.5 * 0.25 + 0.5 / 12.0), 0.01);
  EXPECT_NEAR(error.mean_ratio, 1.0, 0.02);
  EXPECT_NEAR(error.p95, 0.5, 1e-6);
}

// One double-sided primitive: an engine shows the front's light from below as well.
TEST(Surface, OneLightmapForBothSidesLeaksToTheDarkOne) {
  auto lit = floorUnderSky(1.0F, 1.0F);
  for (auto& triangle : lit.scene.triangles) triangle.double_sided = true;
  const auto error = judge(lit);
  EXPECT_EQ(error.points, 400U);
  EXPECT_EQ(error.compared, 200U);
  EXPECT_EQ(error.dark, 200U);
  EXPECT_EQ(error.leaks, 200U);
  EXPECT_EQ(error.open_leaks, 200U);
  EXPECT_NEAR(error.mean_ratio, 1.0, 1e-6);
}

TEST(Surface, AMeanOfTwoSidesIsHalfOfTheLight) {
  auto lit = floorUnderSky(0.5F, 0.5F);
  for (auto& triangle : lit.scene.triangles) triangle.double_sided = true;
  const auto error = judge(lit);
  EXPECT_NEAR(error.mean_ratio, 0.5, 1e-6);
  EXPECT_NEAR(error.median, 0.5, 1e-6);
  EXPECT_EQ(error.leaks, 200U);
}

// A front and a flipped copy with texels of its own, where the page is as bright as the other sky.
TEST(Surface, SidesApartAreEachLookedUpInTheirOwnTexels) {
  auto lit = floorUnderSky(1.0F, 3.0F, 3.0);
  for (auto& triangle : lit.scene.triangles) {
    for (auto& uv : triangle.lightmap_uv) uv.x *= 0.25;  // at and left of the first texel's centre
  }
  addFlippedCopies(lit, 0.75);
  const auto error = judge(lit);
  EXPECT_EQ(error.compared, 400U);
  EXPECT_NEAR(error.rms_with_noise, 0.0, 1e-6);
  EXPECT_NEAR(error.mean_ratio, 1.0, 1e-6);
  auto swapped = lit;
  std::swap(swapped.pages[0].pixels[0], swapped.pages[0].pixels[1]);
  EXPECT_GT(judge(swapped).median, 0.6);
}

TEST(Surface, ASideWithoutTexelsIsCountedAndNotDrawnWithAnothers) {
  auto lit = floorUnderSky(1.0F, 1.0F, 0.5);
  addFlippedCopies(lit, 0.0);
  lit.scene.triangles.resize(2);
  const auto error = judge(lit);
  EXPECT_EQ(error.compared, 200U);
  EXPECT_EQ(error.missed, 200U);
  EXPECT_EQ(error.missed_lit, 200U);
  EXPECT_EQ(leftOutText(error), "without texels 50.0 %, of these lit in truth 50.0 %");
}

TEST(Surface, WhatIsNoNumberIsCounted) {
  const auto error = judge(floorUnderSky(kNan, 1.0F));
  EXPECT_GT(error.not_finite, 200U);  // everything left of the second texel's centre
  EXPECT_EQ(error.not_finite + error.compared, 400U);
  EXPECT_NEAR(error.mean_ratio, 1.0, 1e-6);
}

TEST(Surface, WhatAMaskCutsOutIsNotSeen) {
  auto lit = floorUnderSky(1.0F, 1.0F);
  auto& hole = lit.scene.triangles[1];
  hole.see_through = true;
  hole.alpha = 0.2;
  hole.cutoff = 0.5;
  const auto error = judge(lit);
  EXPECT_EQ(error.cut_out, 200U);
  EXPECT_EQ(error.compared, 200U);
}

// A fifth of a room's floor is under a block, which has no bottom: of 6 - 0.2 + 4 x 0.2 + 0.2 m2 and those 0.2.
TEST(Surface, WhatASolidHidesIsCountedAsBuried) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  test_scenes::Object box{"box", {}, {}};
  const double side = std::sqrt(0.2);
  test_scenes::appendBox(box, glm::dvec3(0.2, 0.0, 0.2), glm::dvec3(0.2 + side, side, 0.2 + side),
                         test_scenes::allFaces(0), test_scenes::kYMin);
  made.objects.push_back(box);
  LitScene lit{oracle::triangulate(made), {}};
  lit.pages.push_back({1, 1, {glm::vec3(2.0F * std::numbers::pi_v<float>)}});
  for (auto& triangle : lit.scene.triangles) triangle.lightmap_page = 0;
  const auto error = judge(lit, 2000);
  EXPECT_NEAR(error.share(error.buried), 0.2 / (6.0 + 5 * 0.2), 0.005);
  EXPECT_EQ(error.compared + error.buried, 2000U);
  EXPECT_NEAR(error.mean_ratio, 1.0, 0.005);
  EXPECT_EQ(leftOutText(error).rfind("buried in solids", 0), 0U) << leftOutText(error);
}

// The whole way: a GLB and an EXR on disk, the front and its copy in one primitive each.
TEST(Surface, AFileIsReadAsAnEngineReadsIt) {
  const TemporaryFolder folder;
  const std::vector<float> numbers{/* front */ 0,
                                   0,
                                   0,
                                   0,
                                   0,
                                   1,
                                   1,
                                   0,
                                   1,
                                   /* copy */ 0,
                                   0,
                                   0,
                                   1,
                                   0,
                                   1,
                                   0,
                                   0,
                                   1,
                                   /* uv of the front */ 0,
                                   0,
                                   0,
                                   0,
                                   0,
                                   0,
                                   /* of the copy */ 1,
                                   1,
                                   1,
                                   1,
                                   1,
                                   1};
  const auto primitive = [](int position, int uv) {
    return nlohmann::json{
        {"attributes", {{"POSITION", position}, {"TEXCOORD_1", uv}}}, {"material", 0}, {"extras", {{"lightmap", 0}}}};
  };
  nlohmann::json gltf{{"asset", {{"version", "2.0"}}},
                      {"extras", {{"radiositySky", {{"upper", {1, 1, 1}}, {"lower", {0.25, 0.25, 0.25}}}}}},
                      {"scenes", {{{"nodes", {0}}}}},
                      {"nodes", {{{"mesh", 0}}}},
                      {"materials", {{{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}}},
                      {"meshes", {{{"primitives", {primitive(0, 2), primitive(1, 3)}}}}},
                      {"buffers", {{{"byteLength", 120}}}},
                      {"bufferViews", {{{"buffer", 0}, {"byteLength", 120}}}}};
  for (const auto& [offset, type] : {std::pair{0, "VEC3"}, {36, "VEC3"}, {72, "VEC2"}, {96, "VEC2"}})
    gltf["accessors"].push_back(
        {{"bufferView", 0}, {"byteOffset", offset}, {"componentType", 5126}, {"count", 3}, {"type", type}});
  writeGlb(gltf, std::string(reinterpret_cast<const char*>(numbers.data()), 120), folder.file("lit.glb"));
  const auto bright = std::numbers::pi_v<float>;
  writeExr({1, 2, {glm::vec3(bright), glm::vec3(bright / 4)}}, folder.file("lit.lightmap.0.exr"));
  const auto lit = readLitScene(folder.file("lit.glb"));
  EXPECT_EQ(lit.scene.triangles.size(), 2U);
  EXPECT_EQ(lit.traced().triangles.size(), 1U);
  const auto error = judge(lit);
  EXPECT_EQ(error.compared, 400U);
  EXPECT_NEAR(error.rms_with_noise, 0.0, 1e-3);  // half floats
  EXPECT_NEAR(error.mean_ratio, 1.0, 1e-3);
}

}  // namespace
}  // namespace radiosity::accuracy
