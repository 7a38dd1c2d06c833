// Faces that lie on each other: the earlier is seen, the later gets no light there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/ext/matrix_transform.hpp>

#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

TEST(Coincidence, FacesOnEachOtherAreReported) {
  Scene scene;
  place(scene, floorQuad(1.0));
  place(scene, floorQuad(1.0));
  const PatchScene patches = build(scene, 100);
  EXPECT_THAT(patches.warnings, testing::Contains(testing::HasSubstr("exactly on another one")));
  EXPECT_THAT(build(sceneOf(box({0, 0, 0}, {1, 1, 1})), 16'000).warnings, testing::IsEmpty());
}

// Also where nothing bounds a solid, and where the leaf that is looked at first lies in the covered part.
TEST(Coincidence, OnlyWhatAnEarlierFaceCoversIsLeftOut) {
  Material both;
  both.double_sided = true;
  for (const bool box_elsewhere : {false, true}) {
    Scene scene;
    place(scene, floorQuad(1.0), glm::translate(glm::dmat4(1.0), glm::dvec3(0.01, 0, 0)), both);
    place(scene, floorQuad(4.0), glm::dmat4(1.0), both);
    if (box_elsewhere) place(scene, box({9, 0, 9}, {10, 1, 10}));
    const PatchScene patches = build(scene, 400);
    EXPECT_THAT(patches.warnings, testing::Contains(testing::HasSubstr("exactly on another one")));
    const double boxes = box_elsewhere ? 6.0 : 0.0;
    EXPECT_NEAR(areaOf(patches, 0), 16.0 + boxes, 0.05) << "1 + 16 - 1";
    EXPECT_NEAR(areaOf(patches, 1), 16.0, 0.05) << "of two that lie on each other one is seen from behind, too";
  }
}

// Whichever way the second is turned: one is seen from above, and one from below.
TEST(Coincidence, OfSheetsThatFaceEachOthersBacksEachSideIsSeenOnce) {
  Material both;
  both.double_sided = true;
  for (const double turned : {0.0, 1.0}) {
    Scene scene;
    place(scene, floorQuad(2.0), glm::dmat4(1.0), both);
    place(scene, floorQuad(2.0),
          glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 2.0 * turned)) *
              glm::rotate(glm::dmat4(1.0), turned * M_PI, glm::dvec3(1, 0, 0)),
          both);
    const PatchScene patches = build(scene, 400);
    EXPECT_NEAR(areaOf(patches, 0) + areaOf(patches, 1), 8.0, 0.01) << turned;
    // Of what is covered it is known by which side.
    ASSERT_FALSE(patches.covered.empty());
    for (const auto& covered : patches.covered) {
      EXPECT_EQ(covered.surface, 0U);
      EXPECT_EQ(covered.surface_side, turned > 0.0 ? 1 - covered.side : covered.side);
    }
  }
}

TEST(Coincidence, WhatOneCanSeeThroughCoversNothingOpaque) {
  for (const AlphaMode mode : {AlphaMode::kBlend, AlphaMode::kMask}) {
    for (const bool decal_first : {false, true}) {
      Material decal;
      decal.alpha_mode = mode;
      decal.alpha = 0.4F;
      Scene scene;
      if (decal_first) place(scene, floorQuad(2.0), glm::dmat4(1.0), decal);
      const auto floor = place(scene, floorQuad(2.0));
      if (!decal_first) place(scene, floorQuad(2.0), glm::dmat4(1.0), decal);
      const PatchScene patches = build(scene, 400);
      EXPECT_NEAR(areaOf(patches, 0, floor), 4.0, 1e-3) << decal_first;
      EXPECT_NEAR(areaOf(patches, 0, 1 - floor), 0.0, 1e-3) << decal_first;
    }
  }
}

// A band around a column. Its leaves lie in the planes of many triangles.
TEST(Coincidence, OfBentFacesIsKnownWhereLightmapsShowTheEarlier) {
  Scene scene;
  place(scene, tube(0.5, 4.0, 48));
  place(scene, tube(0.5, 0.5, 48), glm::translate(glm::dmat4(1.0), glm::dvec3(0, 2, 0)));
  const PatchScene patches = build(scene, 1'000);
  EXPECT_THAT(patches.warnings, testing::Contains(testing::HasSubstr("exactly on another one")));
  std::size_t band = 0, bent = 0;
  for (const Surface& surface : patches.surfaces) {
    if (surface.instance == 1) band += std::size_t{surface.width} * surface.height;
    if (surface.instance == 1 && !surface.planar) bent += std::size_t{surface.width} * surface.height;
  }
  EXPECT_GT(bent, band / 2);
  EXPECT_GT(patches.covered.size(), band * 3 / 4) << "of " << band << " leaves, some of them empty";
  std::uint32_t before = 0;
  for (const auto& covered : patches.covered) {
    EXPECT_GE(covered.leaf, before);
    before = covered.leaf + 1;
    const Surface& column = patches.surfaces[covered.surface];
    EXPECT_EQ(column.instance, 0U);
    const auto at = covered.texel / glm::vec2(column.width, column.height);
    EXPECT_TRUE(std::min(at.x, at.y) >= 0.0F && std::max(at.x, at.y) <= 1.0F);
  }
}

}  // namespace
}  // namespace radiosity::scene::test
