#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <numeric>
#include <random>

#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

PatchScene build(const Scene& scene, std::uint64_t budget = 16'000, ChartOptions options = {}) {
  options.texel_budget = budget;
  auto patches = buildPatchScene(scene, options);
  if (!patches) ADD_FAILURE() << patches.error().text();
  return patches ? std::move(*patches) : PatchScene{};
}

/// Structural promises of patch_scene.h that hold for any scene.
void expectSound(const PatchScene& patches) {
  ASSERT_EQ(patches.triangles.size(), patches.triangle_surface.size());
  ASSERT_EQ(patches.triangles.size() * 3, patches.indices.size());
  for (const PatchVertex& vertex : patches.vertices) {
    const Surface& surface = patches.surfaces.at(vertex.surface);
    EXPECT_LE(std::max({std::abs(vertex.position.x), std::abs(vertex.position.y), std::abs(vertex.position.z)}), 0.5F);
    ASSERT_GE(vertex.texel.x, 0.0F);
    ASSERT_GE(vertex.texel.y, 0.0F);
    ASSERT_LE(vertex.texel.x, static_cast<float>(surface.width));
    ASSERT_LE(vertex.texel.y, static_cast<float>(surface.height));
  }
  for (std::size_t t = 0; t < patches.triangles.size(); ++t) {
    const TriangleFrame& frame = patches.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      const PatchVertex& vertex = patches.vertices[patches.indices[std::size_t{3} * t + k]];
      const glm::vec3 p = frame.origin + frame.du * vertex.texel.x + frame.dv * vertex.texel.y;
      ASSERT_LT(glm::distance(p, vertex.position), 3e-6F) << "triangle " << t;
      ASSERT_GT(glm::dot(frame.normal, vertex.normal), 0.999F);
    }
    const auto at = [&](std::size_t k) { return patches.vertices[patches.indices[std::size_t{3} * t + k]].position; };
    const glm::vec3 cross = glm::cross(at(1) - at(0), at(2) - at(0));
    if (glm::length(cross) > 1e-8F) {
      ASSERT_GT(glm::dot(cross, frame.normal), 0.0F);
    }
  }
  for (const Surface& surface : patches.surfaces) {
    ASSERT_EQ(surface.level_count, levelCount(surface.width, surface.height));
    for (const std::uint32_t first : surface.first_node) {
      if (first == kNone) continue;
      double leaves = 0.0;
      for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) leaves += patches.node_area[first + i];
      const LevelGrid top = levelGrid(surface.width, surface.height, surface.level_count - 1);
      ASSERT_EQ(top.width * top.height, 1U);
      EXPECT_NEAR(patches.node_area[first + top.offset], leaves, 1e-5 * leaves);
    }
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const LeafPoint& leaf = patches.leaves[surface.first_leaf + i];
      if (leaf.triangle == kNone) continue;
      ASSERT_GE(leaf.triangle, surface.first_triangle);
      ASSERT_LT(leaf.triangle, surface.first_triangle + surface.triangle_count);
      const glm::vec2 corner(static_cast<float>(i % surface.width), static_cast<float>(i / surface.width));
      ASSERT_GE(leaf.texel.x, corner.x);
      ASSERT_LE(leaf.texel.x, corner.x + 1.0F);
      ASSERT_GE(leaf.texel.y, corner.y);
      ASSERT_LE(leaf.texel.y, corner.y + 1.0F);
    }
  }
}

TEST(Charts, QuadIsOneRectangleOfWholeTexels) {
  const Scene scene = sceneOf(floorQuad(2.0));
  const PatchScene patches = build(scene, 100);
  expectSound(patches);
  ASSERT_EQ(patches.surfaces.size(), 1U);
  EXPECT_EQ(patches.surfaces[0].width, 10U);
  EXPECT_EQ(patches.surfaces[0].height, 10U);
  EXPECT_TRUE(patches.surfaces[0].planar);
  EXPECT_EQ(patches.polygons, 1U);
  for (const LeafPoint& leaf : patches.leaves) EXPECT_TRUE(leaf.full);
  for (std::uint32_t i = 0; i < 100; ++i) EXPECT_NEAR(patches.node_area[i], 0.01, 1e-8);
  EXPECT_NEAR(leafArea(patches), 4.0, 4e-6);
}

TEST(Charts, RotatedRectangleStillHasOnlyFullTexels) {
  Scene scene;
  Primitive p;
  addQuad(p, {0, 0, 0}, {0, 0, 1}, {3, 0, 1}, {3, 0, 0});
  glm::dmat4 world = glm::rotate(glm::dmat4(1.0), 0.7, glm::normalize(glm::dvec3(1, 2, 3)));
  place(scene, p, world);
  const PatchScene patches = build(scene, 300);
  expectSound(patches);
  ASSERT_EQ(patches.surfaces.size(), 1U);
  EXPECT_EQ(patches.surfaces[0].width * patches.surfaces[0].height, 300U);
  for (const LeafPoint& leaf : patches.leaves) EXPECT_TRUE(leaf.full);
}

TEST(Charts, LShapeCoversThreeQuartersOfItsRectangle) {
  Primitive p;
  p.positions = {{0, 0, 0}, {2, 0, 0}, {2, 0, 1}, {1, 0, 1}, {1, 0, 2}, {0, 0, 2}};
  p.indices = {0, 2, 1, 0, 3, 2, 0, 4, 3, 0, 5, 4};
  const Scene scene = sceneOf(p);
  const PatchScene patches = build(scene, 700);
  expectSound(patches);
  ASSERT_EQ(patches.surfaces.size(), 1U);
  EXPECT_NEAR(leafArea(patches), 3.0, 3e-6);
  EXPECT_NEAR(static_cast<double>(coveredLeaves(patches)), 700.0, 70.0);
}

TEST(Charts, TriangleAreasAreExact) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 20; ++i) {
    Primitive p;
    for (int k = 0; k < 3; ++k) p.positions.emplace_back(uniform(random), uniform(random), uniform(random));
    p.indices = {0, 1, 2};
    const Scene scene = sceneOf(p);
    const PatchScene patches = build(scene, 500);
    expectSound(patches);
    EXPECT_NEAR(leafArea(patches) / triangleArea(scene), 1.0, 1e-6);
    EXPECT_NEAR(static_cast<double>(coveredLeaves(patches)), 500.0, 50.0);
  }
}

TEST(Charts, SphereKeepsItsAreaInFewCharts) {
  for (const Primitive& p : {uvSphere(1.0, 64, 32), icoSphere(1.0, 5)}) {
    const Scene scene = sceneOf(p);
    const PatchScene patches = build(scene, 4000);
    expectSound(patches);
    EXPECT_NEAR(leafArea(patches) / triangleArea(scene), 1.0, 1e-6);
    EXPECT_LT(patches.surfaces.size(), 200U);
    EXPECT_NEAR(static_cast<double>(coveredLeaves(patches)), 4000.0, 800.0);
  }
}

TEST(Charts, NoTexelIsCoveredTwiceInsideAChart) {
  const Scene scene = sceneOf(icoSphere(1.0, 4));
  const PatchScene patches = build(scene, 20'000);
  for (const Surface& surface : patches.surfaces) {
    double texels = 0.0;
    for (std::uint32_t t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
      const auto at = [&](std::size_t k) {
        return glm::dvec2(patches.vertices[patches.indices[std::size_t{3} * t + k]].texel);
      };
      const glm::dvec2 a = at(1) - at(0), b = at(2) - at(0);
      texels += 0.5 * (a.x * b.y - a.y * b.x);
    }
    EXPECT_LE(texels, surface.width * surface.height + 1e-3);
    EXPECT_GT(texels, 0.0);
  }
}

TEST(Charts, FineTubeIsGroupedAndCoarseTubeIsPlanar) {
  const PatchScene fine = build(sceneOf(tube(0.5, 2.0, 128)), 2000);
  expectSound(fine);
  EXPECT_LE(fine.surfaces.size(), 16U);
  EXPECT_NEAR(leafArea(fine) / triangleArea(sceneOf(tube(0.5, 2.0, 128))), 1.0, 1e-6);
  const PatchScene coarse = build(sceneOf(tube(0.5, 2.0, 6)), 2000);
  EXPECT_EQ(coarse.surfaces.size(), 6U);
  for (const Surface& surface : coarse.surfaces) EXPECT_TRUE(surface.planar);
}

TEST(Charts, TwoMaterialsInOnePlaneAreTwoCharts) {
  Scene scene;
  place(scene, floorQuad(1.0));
  place(scene, floorQuad(1.0, 1.0));
  const PatchScene patches = build(scene, 200);
  EXPECT_EQ(patches.surfaces.size(), 2U);
  EXPECT_EQ(patches.seams.size(), 1U);
}

TEST(Charts, MirroredInstanceKeepsItsFrontOutside) {
  Scene scene;
  place(scene, box({-1, -1, -1}, {1, 1, 1}), glm::scale(glm::dmat4(1.0), glm::dvec3(-1, 1, 1)));
  // A mirroring node turns the winding of the file round and with it the front: outward stays outward.
  const PatchScene patches = build(scene, 600);
  expectSound(patches);
  for (const PatchVertex& vertex : patches.vertices) EXPECT_GT(glm::dot(vertex.position, vertex.normal), 0.0F);
}

TEST(Charts, FloorUnderABlockIsBuried) {
  Scene scene;
  place(scene, floorQuad(10.0, -5.0, -5.0));
  place(scene, box({-1.3, 0.0, -0.7}, {1.1, 2.0, 1.6}));
  ChartOptions options;
  options.texel_size_m = 0.25;
  const PatchScene patches = build(scene, 0, options);
  expectSound(patches);
  const double footprint = 2.4 * 2.3;
  const Surface& floor = patches.surfaces[0];
  EXPECT_EQ(floor.width, 40U);
  EXPECT_NEAR(leafArea(patches, floor), 100.0 - footprint, 0.03);
  std::size_t empty = 0;
  for (std::uint32_t i = 0; i < 1600; ++i) {
    const LeafPoint& leaf = patches.leaves[floor.first_leaf + i];
    const float area = patches.node_area[floor.first_node[0] + i];
    if (area == 0.0F) {
      EXPECT_EQ(leaf.triangle, kNone);
      ++empty;
      continue;
    }
    const glm::vec3 p = patches.triangles[leaf.triangle].origin + patches.triangles[leaf.triangle].du * leaf.texel.x +
                        patches.triangles[leaf.triangle].dv * leaf.texel.y;
    const glm::dvec3 world = glm::dvec3(p) * patches.scale + patches.centre;
    EXPECT_FALSE(world.x > -1.29 && world.x < 1.09 && world.z > -0.69 && world.z < 1.59) << world.x << " " << world.z;
  }
  EXPECT_GE(empty, 8U * 8U);
}

TEST(Charts, RoomKeepsAllOfItsWallsAndLosesOnlyTheFootprint) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  place(scene, box({1, 0, 1}, {2, 1, 2.5}));
  const PatchScene patches = build(scene, 6000);
  const double room = 2.0 * (4 * 3 + 3 * 5 + 4 * 5), block = 2.0 * (1 * 1 + 1 * 1.5 + 1 * 1.5);
  EXPECT_NEAR(leafArea(patches), room + block - 1.5, 0.02);
}

TEST(Charts, InterpenetratingBlocksHideEachOthersInside) {
  Scene scene;
  place(scene, box({0, 0, 0}, {2, 2, 2}));
  place(scene, box({1, 0.5, 0.5}, {3, 1.5, 1.5}));
  const PatchScene patches = build(scene, 4000);
  // The first loses a 1 x 1 opening; the second its left face and half of its four sides.
  EXPECT_NEAR(leafArea(patches), (24.0 - 1.0) + (10.0 - 1.0 - 4.0), 0.05);
}

TEST(Charts, NothingIsBuriedInWhatOneCanSeeInto) {
  Scene scene;
  place(scene, floorQuad(10.0, -5.0, -5.0));
  Material material;
  material.alpha_mode = AlphaMode::kMask;
  place(scene, box({-1, 0, -1}, {1, 2, 1}), glm::dmat4(1.0), material);
  EXPECT_NEAR(leafArea(build(scene, 2000)), 100.0 + 24.0, 1e-3);
  scene.materials[1].alpha_mode = AlphaMode::kOpaque;
  EXPECT_NEAR(leafArea(build(scene, 2000)), 100.0 + 24.0 - 4.0, 0.03);
}

// Some rays get out through the slit. As many as that do not make the floor inside a part of what is outside.
TEST(Charts, ABlockWithASlitBuriesTheFloorUnderIt) {
  Scene scene;
  place(scene, floorQuad(10.0, -5.0, -5.0));
  Primitive block = box({-1, 0, -1}, {1, 2, 1});
  block.indices.resize(block.indices.size() - 6);  // its right side, but for a slit all along
  addQuad(block, {1, 0, -1}, {1, 0.8, -1}, {1, 0.8, 1}, {1, 0, 1});
  addQuad(block, {1, 1.2, -1}, {1, 2, -1}, {1, 2, 1}, {1, 1.2, 1});
  place(scene, block);
  EXPECT_NEAR(leafArea(build(scene, 2000)), 100.0 + 24.0 - 0.4 * 2.0 - 4.0, 0.03);
}

TEST(Charts, AFloorUnderARoofSeenFromOutsideOnlyStaysVisible) {
  Scene scene;
  place(scene, floorQuad(4.0));
  Primitive roof;
  addQuad(roof, {0, 2, 0}, {0, 2, 4}, {4, 2, 4}, {4, 2, 0});  // faces up: its back is over the floor
  place(scene, roof);
  EXPECT_NEAR(leafArea(build(scene, 2000)), 32.0, 1e-3);
}

// As light fittings are modelled: half a millimetre below the ceiling, nothing but the side that shines. In that gap it
// is dark, but a panel is no solid; with sides up to the ceiling it is one.
TEST(Charts, APanelBeforeACeilingBuriesNothing) {
  const double room = 2.0 * (4 * 3 + 3 * 5 + 4 * 5), panel = 3.0 * 2.0;
  Primitive light;
  addQuad(light, {0.1, 2.9995, 0.1}, {3.1, 2.9995, 0.1}, {3.1, 2.9995, 2.1}, {0.1, 2.9995, 2.1});
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  place(scene, light);
  EXPECT_NEAR(leafArea(build(scene, 6000)), room + panel, 0.01);
  Scene fitting;
  place(fitting, box({0, 0, 0}, {4, 3, 5}, true));
  place(fitting, box({0.1, 2.9, 0.1}, {3.1, 3.0, 2.1}));
  const double sides = 2.0 * 0.1 * (3.0 + 2.0);
  EXPECT_NEAR(leafArea(build(fitting, 6000)), room - panel + 2.0 * panel + sides,
              0.02);  // its lid faces out of the room
}

TEST(Charts, DoubleSidedSurfacesHaveTwoSides) {
  Scene scene;
  Material material;
  material.double_sided = true;
  place(scene, floorQuad(1.0), glm::dmat4(1.0), material);
  const PatchScene patches = build(scene, 64);
  ASSERT_EQ(patches.surfaces.size(), 1U);
  EXPECT_NE(patches.surfaces[0].first_node[1], kNone);
  EXPECT_NEAR(leafArea(patches, 0), 1.0, 1e-6);
  EXPECT_NEAR(leafArea(patches, 1), 1.0, 1e-6);
}

TEST(Charts, DegenerateTrianglesAreDroppedAndCounted) {
  Primitive p = floorQuad(1.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  p.positions.push_back({nan, 0, 0});
  p.positions.push_back({0.5, 0, 0.5});
  p.indices.insert(p.indices.end(), {0, 1, 4});  // not a number
  p.indices.insert(p.indices.end(), {0, 0, 1});  // zero area
  p.indices.insert(p.indices.end(), {0, 5, 2});  // on a line
  p.indices.insert(p.indices.end(), {1, 2, 0});  // duplicate of the first
  const PatchScene patches = build(sceneOf(p), 100);
  expectSound(patches);
  EXPECT_EQ(patches.triangles_dropped, 4U);
  EXPECT_NEAR(leafArea(patches), 1.0, 1e-6);
  EXPECT_EQ(patches.instance_uvs[0].side[0].page[2], kNone);
  EXPECT_EQ(patches.instance_uvs[0].side[0].page[0], 0U);
}

TEST(Charts, SliverOfAMillionToOneKeepsItsArea) {
  Primitive p;
  p.positions = {{0, 0, 0}, {1, 0, 0}, {0.5, 1e-6, 0}};
  p.indices = {0, 1, 2};
  const PatchScene patches = build(sceneOf(p), 50);
  EXPECT_NEAR(leafArea(patches) / 0.5e-6, 1.0, 1e-4);
  EXPECT_EQ(patches.surfaces[0].height, 1U);
}

TEST(Charts, EmptySceneIsEmpty) {
  const PatchScene patches = build(Scene{});
  EXPECT_EQ(patches.nodeCount(), 0U);
  EXPECT_TRUE(patches.surfaces.empty());
  Scene invisible = sceneOf(floorQuad(1.0));
  invisible.instances[0].visible = false;
  EXPECT_TRUE(build(invisible).surfaces.empty());
}

TEST(Charts, ScalingByAPowerOfTwoChangesNoBit) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  place(scene, icoSphere(0.7, 3), glm::translate(glm::dmat4(1.0), glm::dvec3(1.1, 1.3, 2.7)));
  const PatchScene one = build(scene, 3000);
  for (const int power : {-26, 26}) {
    Scene scaled = scene;
    const double factor = std::ldexp(1.0, power);
    for (Instance& instance : scaled.instances)
      instance.world = glm::scale(glm::dmat4(1.0), glm::dvec3(factor)) * instance.world;
    const PatchScene other = build(scaled, 3000);
    EXPECT_EQ(other.scale, one.scale * factor);
    ASSERT_EQ(other.vertices.size(), one.vertices.size());
    EXPECT_EQ(std::memcmp(other.vertices.data(), one.vertices.data(), one.vertices.size() * sizeof(PatchVertex)), 0);
    ASSERT_EQ(other.node_area, one.node_area);
  }
}

TEST(Charts, FarFromTheOriginGivesTheSameCharts) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  place(scene, box({1, 0, 1}, {2, 1, 2}));
  const PatchScene near = build(scene, 3000);
  for (Instance& instance : scene.instances)
    instance.world = glm::translate(glm::dmat4(1.0), glm::dvec3(5e6)) * instance.world;
  const PatchScene far = build(scene, 3000);
  ASSERT_EQ(far.node_area.size(), near.node_area.size());
  for (std::size_t i = 0; i < near.node_area.size(); ++i)
    EXPECT_NEAR(far.node_area[i], near.node_area[i], 1e-4 * near.node_area[i] + 1e-9);
  for (std::size_t i = 0; i < near.vertices.size(); ++i)
    EXPECT_LT(glm::distance(far.vertices[i].texel, near.vertices[i].texel), 1e-3F);
}

TEST(Charts, BudgetIsMetWithinTenPercentForARoom) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  for (int i = 0; i < 6; ++i) place(scene, box({0.3 + 0.6 * i, 0.5, 1}, {0.6 + 0.6 * i, 0.8, 1.4}));
  for (const std::uint64_t budget : {500U, 2000U, 16'000U, 200'000U}) {
    const PatchScene patches = build(scene, budget);
    EXPECT_NEAR(static_cast<double>(coveredLeaves(patches)) / static_cast<double>(budget), 1.0, 0.1) << budget;
  }
}

TEST(Charts, MoreChartsThanBudgetStillGiveEachALeaf) {
  Scene scene;
  for (int i = 0; i < 100; ++i) place(scene, floorQuad(1.0, 3.0 * i));
  const PatchScene patches = build(scene, 10);
  EXPECT_EQ(patches.surfaces.size(), 100U);
  EXPECT_EQ(coveredLeaves(patches), 100U);
}

TEST(Charts, ChartsOnAPageKeepTheirDistance) {
  Scene scene;
  place(scene, icoSphere(1.0, 4));
  place(scene, box({2, 0, 0}, {3, 1, 1}));
  for (const std::uint32_t gutter : {0U, 1U, 2U, 5U}) {
    ChartOptions options;
    options.gutter = gutter;
    options.max_page_size = 96;
    const PatchScene patches = build(scene, 10'000, options);
    EXPECT_GT(patches.pages.size(), 1U);
    for (const Page& page : patches.pages) {
      EXPECT_LE(page.width, 96U);
      EXPECT_EQ(page.width % 4, 0U);
      EXPECT_EQ(page.height % 4, 0U);
    }
    for (std::size_t a = 0; a < patches.surfaces.size(); ++a) {
      const Surface& s = patches.surfaces[a];
      EXPECT_LE(s.place[0].x + s.width, patches.pages[s.place[0].page].width);
      EXPECT_LE(s.place[0].y + s.height, patches.pages[s.place[0].page].height);
      for (std::size_t b = a + 1; b < patches.surfaces.size(); ++b) {
        const Surface& t = patches.surfaces[b];
        if (s.place[0].page != t.place[0].page) continue;
        const bool apart =
            s.place[0].x + s.width + gutter <= t.place[0].x || t.place[0].x + t.width + gutter <= s.place[0].x ||
            s.place[0].y + s.height + gutter <= t.place[0].y || t.place[0].y + t.height + gutter <= s.place[0].y;
        EXPECT_TRUE(apart) << a << " and " << b;
      }
    }
  }
}

TEST(Charts, WallWiderThanAPageGetsCoarserTexelsAndAWarning) {
  ChartOptions options;
  options.texel_size_m = 0.01;
  options.max_page_size = 64;
  const PatchScene patches = build(sceneOf(floorQuad(2.0)), 0, options);
  EXPECT_LE(patches.surfaces[0].width, 62U);
  EXPECT_THAT(patches.warnings, testing::Contains(testing::HasSubstr("wider than a page")));
}

TEST(Charts, AbsurdTexelSizeIsRefused) {
  Scene scene;
  for (int i = 0; i < 40; ++i) place(scene, floorQuad(1.0, 2.0 * i));
  ChartOptions options;
  options.texel_size_m = 1e-9;
  const auto patches = buildPatchScene(scene, options);
  ASSERT_FALSE(patches);
  EXPECT_EQ(patches.error().code, ErrorCode::kTooLarge);
}

Primitive quadWithLightmapUv(double u0, double u1) {
  Primitive p = floorQuad(1.0);
  p.texcoord1 = {{u0, 0.0}, {u0, 0.5}, {u1, 0.5}, {u1, 0.0}};
  return p;
}

TEST(Charts, ValidLightmapUvsAreUsedAsTheyAre) {
  Primitive p = quadWithLightmapUv(0.25, 0.75);
  const PatchScene patches = build(sceneOf(p), 400);
  expectSound(patches);
  EXPECT_TRUE(patches.warnings.empty());
  ASSERT_EQ(patches.surfaces.size(), 1U);
  EXPECT_TRUE(patches.surfaces[0].planar);
  EXPECT_NEAR(leafArea(patches), 1.0, 1e-6);
  EXPECT_NEAR(static_cast<double>(coveredLeaves(patches)), 400.0, 41.0);
  // Affine to the file's own: equal edges stay equal and aligned.
  const auto& uv = patches.instance_uvs[0].side[0].corners[0];
  EXPECT_FLOAT_EQ(uv[0].x, uv[1].x);
  EXPECT_FLOAT_EQ(uv[1].y, uv[2].y);
}

TEST(Charts, UnusableLightmapUvsAreReplacedWithAWarning) {
  Primitive outside = quadWithLightmapUv(0.5, 1.5);
  Primitive flat = quadWithLightmapUv(0.5, 0.5);
  Primitive nan = quadWithLightmapUv(0.0, 0.5);
  nan.texcoord1[2].x = std::numeric_limits<float>::quiet_NaN();
  Primitive overlapping = quadWithLightmapUv(0.0, 0.5);
  addQuad(overlapping, {2, 0, 0}, {2, 0, 1}, {3, 0, 1}, {3, 0, 0});
  for (int i = 0; i < 4; ++i) overlapping.texcoord1.push_back(overlapping.texcoord1[static_cast<std::size_t>(i)]);
  for (const Primitive& p : {outside, flat, nan, overlapping}) {
    const PatchScene patches = build(sceneOf(p), 400);
    expectSound(patches);
    ASSERT_EQ(patches.warnings.size(), 1U);
    EXPECT_THAT(patches.warnings[0], testing::HasSubstr("/nodes/0 (/meshes/0/primitives/0): TEXCOORD_1"));
    EXPECT_NEAR(leafArea(patches), triangleArea(sceneOf(p)), 1e-5);
  }
}

TEST(Charts, InstancesOfOneLightmappedMeshGetTheirOwnRegions) {
  Scene scene = sceneOf(quadWithLightmapUv(0.0, 0.5));
  scene.instances.push_back(scene.instances[0]);
  scene.instances[1].world = glm::translate(glm::dmat4(1.0), glm::dvec3(2, 0, 0));
  const PatchScene patches = build(scene, 400);
  ASSERT_EQ(patches.surfaces.size(), 2U);
  const Surface &a = patches.surfaces[0], &b = patches.surfaces[1];
  EXPECT_TRUE(a.place[0].x + a.width <= b.place[0].x || b.place[0].x + b.width <= a.place[0].x ||
              a.place[0].y + a.height <= b.place[0].y || b.place[0].y + b.height <= a.place[0].y);
}

TEST(Charts, ATexelScaleMakesOneInstanceFinerAndLeavesTheOthers) {
  Scene scene = sceneOf(quadWithLightmapUv(0.0, 0.5));
  scene.primitives.edit(0, [](Primitive& quad) { quad.texcoord1.clear(); });
  scene.instances.push_back(scene.instances[0]);
  scene.instances[1].world = glm::translate(glm::dmat4(1.0), glm::dvec3(2, 0, 0));
  for (const bool uvs : {false, true}) {
    if (uvs) scene.primitives.edit(0, [](Primitive& quad) { quad = quadWithLightmapUv(0.0, 0.5); });
    scene.instances[1].texel_scale = 1.0F;
    const PatchScene plain = build(scene, 400);
    scene.instances[1].texel_scale = 2.0F;
    const PatchScene patches = build(scene, 400);
    expectSound(patches);
    ASSERT_EQ(patches.surfaces.size(), 2U);
    EXPECT_EQ(patches.surfaces[0].width, plain.surfaces[0].width);
    EXPECT_EQ(patches.surfaces[0].height, plain.surfaces[0].height);
    EXPECT_NEAR(patches.surfaces[1].width, 2.0 * plain.surfaces[1].width, 1.0);
    EXPECT_NEAR(patches.surfaces[1].height, 2.0 * plain.surfaces[1].height, 1.0);
  }
}

}  // namespace
}  // namespace radiosity::scene::test
