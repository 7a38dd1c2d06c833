// Floors cut along walls: which regions there are, that no texel has light of two, and that nothing else is cut.
#include "server/scene/values/wall_cuts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <set>
#include <vector>

#include "server/scene/charts/charts.h"
#include "server/scene/charts/facet_cutter.h"
#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene {
namespace {

using test::addQuad;
using test::box;
using test::build;
using test::place;

// A square of 10 by 10.
const std::vector<FacetCutter::Triangle> kSquare{{glm::dvec2(0, 0), {10, 0}, {10, 10}},
                                                 {glm::dvec2(0, 0), {10, 10}, {0, 10}}};
constexpr CutScale kScale{0.2, 0.2, 1e-5};

WallSegment wall(glm::dvec2 from, glm::dvec2 to, glm::dvec2 front, double height = 3.0) {
  return {from, to, front, false, height};
}

/// Around a rectangle, with fronts within or without.
std::vector<WallSegment> around(glm::dvec2 low, glm::dvec2 high, bool inward, double height = 3.0) {
  const double s = inward ? 1.0 : -1.0;
  return {wall(low, {high.x, low.y}, {0, s}, height), wall({high.x, low.y}, high, {-s, 0}, height),
          wall(high, {low.x, high.y}, {0, -s}, height), wall({low.x, high.y}, low, {s, 0}, height)};
}

std::vector<WallSegment> joined(std::vector<WallSegment> a, const std::vector<WallSegment>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// By region, ascending.
std::vector<double> areasOf(const FacetCutter& cutter) {
  std::map<std::uint32_t, double> areas;
  for (const auto& piece : cutter.pieces()) {
    const auto at = [&](std::size_t k) { return cutter.points()[piece.corners[k % piece.corners.size()]]; };
    for (std::size_t k = 0; k < piece.corners.size(); ++k)
      areas[piece.region] += 0.5 * (at(k).x * at(k + 1).y - at(k + 1).x * at(k).y);
  }
  std::vector<double> sorted;
  for (const auto& [region, area] : areas) sorted.push_back(area);
  std::ranges::sort(sorted);
  return sorted;
}

std::size_t hiddenPiece(const FacetCutter& cutter) {
  return static_cast<std::size_t>(std::ranges::find(cutter.pieces(), true, &FacetCutter::Piece::hidden) -
                                  cutter.pieces().begin());
}

TEST(FacetCutter, aRoomOnAGroundIsARegion) {
  FacetCutter cutter(kSquare, joined(around({3, 3}, {7, 6}, true), around({2.9, 2.9}, {7.1, 6.1}, false)), kScale);
  ASSERT_TRUE(cutter.cut());
  // What lies under the walls, the room, and what is outside.
  const auto areas = areasOf(cutter);
  ASSERT_EQ(areas.size(), 3U) << testing::PrintToString(areas);
  EXPECT_NEAR(areas[0], 4.2 * 3.2 - 12.0, 1e-9);
  EXPECT_NEAR(areas[1], 12.0, 1e-9);
  EXPECT_NEAR(areas[2], 100.0 - 4.2 * 3.2, 1e-9);
  ASSERT_LT(hiddenPiece(cutter), cutter.pieces().size());
  const auto under = cutter.pieces()[hiddenPiece(cutter)].region;
  for (const auto& piece : cutter.pieces()) EXPECT_EQ(piece.hidden, piece.region == under);
}

TEST(FacetCutter, whatStandsOnAFloorAndHidesItLeavesItWhole) {
  EXPECT_FALSE(FacetCutter(kSquare, around({3, 3}, {7, 6}, false), kScale).cut());
  EXPECT_FALSE(FacetCutter(kSquare, around({3, 3}, {3.1, 3.1}, true), kScale).cut()) << "as small as a leg";
  EXPECT_FALSE(FacetCutter(kSquare, around({3, 3}, {7, 6}, true, 0.05), kScale).cut()) << "as low as a carpet";
  EXPECT_FALSE(FacetCutter(kSquare, {}, kScale).cut());
  EXPECT_FALSE(FacetCutter(kSquare, {wall({0, 0}, {10, 0}, {0, 1})}, kScale).cut()) << "at its border";
  EXPECT_FALSE(FacetCutter(kSquare, {wall({4, 4}, {4.5, 4}, {0, 1})}, kScale).cut()) << "short";
}

TEST(FacetCutter, aWallThatStandsFarIntoAFloorPartsIt) {
  FacetCutter cutter(kSquare, joined({wall({4, 0}, {4, 7}, {1, 0})}, {wall({4, 0}, {4, 7}, {-1, 0})}), kScale);
  ASSERT_TRUE(cutter.cut());
  EXPECT_EQ(areasOf(cutter).size(), 2U);
  for (const auto& piece : cutter.pieces()) {
    for (std::size_t k = 0; k < piece.corners.size(); ++k) {
      const auto a = piece.corners[k], b = piece.corners[(k + 1) % piece.corners.size()];
      const auto middle = 0.5 * (cutter.points()[a] + cutter.points()[b]);
      const bool under_wall =
          std::abs(cutter.points()[a].x - 4.0) < 1e-9 && std::abs(cutter.points()[b].x - 4.0) < 1e-9;
      EXPECT_EQ(cutter.isWalled(a, b), under_wall && middle.y < 7.0) << middle.x << ", " << middle.y;
    }
  }
}

TEST(FacetCutter, piecesShareWholeEdgesWithThoseAcross) {
  FacetCutter cutter(kSquare, around({3, 3}, {7, 6}, true), kScale);
  ASSERT_TRUE(cutter.cut());
  cutter.insert({{5, 0}, {10, 2.5}});
  std::multiset<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const auto& piece : cutter.pieces())
    for (std::size_t k = 0; k < piece.corners.size(); ++k)
      edges.insert({piece.corners[k], piece.corners[(k + 1) % piece.corners.size()]});
  double border = 0.0;
  bool inserted = false;
  for (const auto& [from, to] : edges) {
    EXPECT_EQ(edges.count({from, to}), 1U);
    if (!edges.contains({to, from})) border += glm::distance(cutter.points()[from], cutter.points()[to]);
    inserted = inserted || cutter.points()[from] == glm::dvec2(5, 0);
  }
  EXPECT_NEAR(border, 40.0, 1e-9);
  EXPECT_TRUE(inserted);
}

Material sheet() {
  Material material;
  material.double_sided = true;
  return material;
}

/// Walls and a roof: the ground is its floor.
Primitive house() {
  Primitive walls = box({-2, 0, -2}, {2, 3, 2});
  walls.indices.erase(walls.indices.begin(), walls.indices.begin() + 6);
  return walls;
}

glm::dmat4 turned(double angle) { return glm::rotate(glm::dmat4(1.0), angle, glm::dvec3(0, 1, 0)); }

/// Spots of the leaves of an instance's upward surfaces: by surface, on which sides of something they lie.
std::map<std::uint32_t, std::set<bool>> sidesOf(const PatchScene& patches, std::uint32_t instance,
                                                const std::function<double(const glm::dvec3&)>& side) {
  std::map<std::uint32_t, std::set<bool>> sides;
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    const Surface& surface = patches.surfaces[s];
    if (surface.instance != instance || patches.triangles[surface.first_triangle].normal.y < 0.9F) continue;
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& leaf = patches.leaves[surface.first_leaf + i];
      if (leaf.triangle == kNone) continue;
      const auto add = [&](const glm::vec2& texel, std::uint32_t triangle) {
        const auto& frame = patches.triangles[triangle];
        const glm::dvec3 at(frame.origin + texel.x * frame.du + texel.y * frame.dv);
        const double distance = side(at * patches.scale + patches.centre);
        EXPECT_GT(std::abs(distance), 1e-6) << "leaf " << i << " of surface " << s;
        sides[s].insert(distance > 0.0);
      };
      if (!leaf.hasSpots()) add(leaf.texel, leaf.triangle);
      for (std::uint32_t k = 0; leaf.hasSpots() && k < patches.spotCount(leaf); ++k) {
        const auto spot = patches.spot(leaf, k);
        add(spot.texel, spot.triangle);
      }
    }
  }
  return sides;
}

class Partition : public testing::TestWithParam<double> {};

/// A wall of no thickness, anywhere across a room: each of its floors has spots on one side alone, and well off it.
TEST_P(Partition, noLeafHasPlacesOnBothSides) {
  const double angle = GetParam();
  Scene scene;
  place(scene, box({-2, 0, -2}, {2, 3, 2}, true));
  Primitive wall;
  const double reach = 2.0 * std::tan(angle), x = 0.137;
  addQuad(wall, {x + reach, 0, -2}, {x - reach, 0, 2}, {x - reach, 3, 2}, {x + reach, 3, -2});
  place(scene, std::move(wall), glm::dmat4(1.0), sheet());
  const PatchScene patches = build(scene, 6000);
  ASSERT_NE(patches.cuts.find(0), nullptr);
  const glm::dvec2 normal(std::cos(angle), std::sin(angle));
  const auto sides = sidesOf(patches, 0, [&](const glm::dvec3& p) { return normal.x * (p.x - x) + normal.y * p.z; });
  EXPECT_EQ(sides.size(), 2U);
  for (const auto& [surface, of] : sides) EXPECT_EQ(of.size(), 1U) << "surface " << surface;
  EXPECT_NEAR(test::areaOf(patches, 0, 0), 80.0, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Angles, Partition, testing::Values(0.0, 0.01, 0.2, 0.3, 0.7));

TEST(WallCuts, whatIsCutStaysClosed) {
  Scene scene;
  place(scene, box({-10, -1, -10}, {10, 0, 10}));
  place(scene, house(), turned(0.4), sheet());
  const PatchScene patches = build(scene, 6000);
  ASSERT_NE(patches.cuts.find(0), nullptr);
  ASSERT_FALSE(patches.solids.bounds.empty());
  for (std::uint32_t t = 0; t < patches.triangles.size(); ++t) {
    if (patches.surfaces[patches.triangle_surface[t]].instance != 0) continue;
    EXPECT_NE(patches.solids.solid_of[t], kNone);
  }
}

TEST(WallCuts, aCutPrimitiveCoversTheFilesTriangles) {
  Scene scene;
  Primitive ground = test::floorQuad(20, -10, -10);
  for (const auto& p : ground.positions) {
    ground.texcoord0.emplace_back(p.x, p.z);
    ground.normals.emplace_back(0.0F, 1.0F, 0.0F);
  }
  place(scene, std::move(ground), glm::scale(glm::dmat4(1.0), glm::dvec3(-1, 1, 1)));  // mirrored
  scene.materials[0].double_sided = true;
  place(scene, house(), turned(0.4), sheet());
  const PatchScene patches = build(scene, 6000);
  const auto* cut = patches.cuts.find(0);
  ASSERT_NE(cut, nullptr);
  const auto& p = cut->primitive;
  ASSERT_EQ(cut->source.size(), p.indices.size() / 3);
  std::array<double, 2> area{};
  for (std::size_t t = 0; t < cut->source.size(); ++t) {
    const auto &a = p.positions[p.indices[3 * t]], &b = p.positions[p.indices[3 * t + 1]],
               &c = p.positions[p.indices[3 * t + 2]];
    const auto cross = glm::cross(b - a, c - a);
    EXPECT_GT(cross.y, 0.0) << "triangle " << t << " faces as the file's";
    area.at(cut->source[t]) += 0.5 * cross.y;
  }
  EXPECT_NEAR(area[0], 200.0, 1e-6);
  EXPECT_NEAR(area[1], 200.0, 1e-6);
  for (std::size_t v = 0; v < p.positions.size(); ++v) {
    EXPECT_NEAR(p.texcoord0[v].x, p.positions[v].x, 1e-5);
    EXPECT_NEAR(p.texcoord0[v].y, p.positions[v].z, 1e-5);
    EXPECT_EQ(p.normals[v], glm::vec3(0, 1, 0));
  }
  EXPECT_EQ(cut->fileVertices(), 4U);
}

TEST(WallCuts, furnitureAndLampsLeaveARoomWhole) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  place(scene, box({1, 0, 1}, {2, 0.8, 2.5}));                                            // a block
  for (const double x : {3.0, 3.5}) place(scene, box({x, 0, 1}, {x + 0.05, 0.7, 1.05}));  // legs
  place(scene, box({1, 2.9, 2}, {2, 3, 3}));                                              // a lamp's housing
  EXPECT_TRUE(build(scene, 6000).cuts.empty());
  for (auto& material : scene.materials) material.double_sided = true;
  EXPECT_TRUE(build(scene, 6000).cuts.empty()) << "nobody sees the backs of what is closed";
}

std::size_t surfacesOf(const PatchScene& patches, std::uint32_t instance) {
  return static_cast<std::size_t>(std::ranges::count(patches.surfaces, instance, &Surface::instance));
}

// Each house is a region, and what lies under each of its walls another: of more than a face may have it stays whole.
TEST(WallCuts, anyNumberOfHousesAndWallsIsDoneWith) {
  for (const int houses : {8, 40, 400}) {
    Scene scene;
    place(scene, test::floorQuad(10.0 * houses, 0.0, -5.0 * houses));
    for (int i = 0; i < houses; ++i) {
      const double x = 10.0 * i + 3.0;
      place(scene, box({x, 0, -2}, {x + 0.2, 3, 2}));
      place(scene, box({x + 4, 0, -2}, {x + 4.2, 3, 2}));
      place(scene, box({x + 0.2, 0, -2}, {x + 4, 3, -1.8}));
      place(scene, box({x + 0.2, 0, 1.8}, {x + 4, 3, 2}));
    }
    const PatchScene patches = build(scene, 6000);
    const auto regions = surfacesOf(patches, 0);
    if (houses < 100) {
      EXPECT_EQ(regions, 1U + 5U * static_cast<unsigned>(houses)) << "four walls each";
    } else {
      EXPECT_LE(regions, 256U + 1024U);
    }
  }
}

// Four shells whose fronts look inward, around a court that shows their backs all around, and lies open.
TEST(WallCuts, aCourtBetweenBacksIsNotHidden) {
  Scene scene;
  place(scene, test::floorQuad(40, -20, -20));
  const auto shell = [&](glm::dvec3 low, glm::dvec3 high) {
    Primitive room = box(low, high, true);
    room.indices.erase(room.indices.begin(), room.indices.begin() + 6);
    place(scene, std::move(room));
  };
  shell({-9, 0, -9}, {9, 3, -3});
  shell({-9, 0, 3}, {9, 3, 9});
  shell({-9, 0, -3}, {-3, 3, 3});
  shell({3, 0, -3}, {9, 3, 3});
  const PatchScene patches = build(scene, 6000);
  const auto* cut = patches.cuts.find(0);
  ASSERT_NE(cut, nullptr);
  EXPECT_EQ(std::ranges::count(cut->hidden, true), 0);
}

}  // namespace
}  // namespace radiosity::scene
