// Faces that lie on each other: the earlier is seen, the later gets no light there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/ext/matrix_transform.hpp>

#include "server/scene/patch_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

PatchScene build(const Scene& scene, std::uint64_t budget = 16'000) {
  ChartOptions options;
  options.texel_budget = budget;
  auto patches = buildPatchScene(scene, options);
  if (!patches) ADD_FAILURE() << patches.error().text();
  return patches ? std::move(*patches) : PatchScene{};
}

/// Of the leaves of all surfaces' fronts (0) or backs (1), m^2.
double areaOf(const PatchScene& patches, std::size_t side) {
  double sum = 0.0;
  for (const Surface& surface : patches.surfaces) {
    const auto first = surface.first_node[side];
    for (std::uint32_t i = 0; first != kNone && i < surface.width * surface.height; ++i)
      sum += static_cast<double>(patches.node_area[first + i]);
  }
  return sum * patches.scale * patches.scale;
}

TEST(Coincidence, FacesOnEachOtherAreReported) {
  Scene scene;
  place(scene, floorQuad(1.0));
  place(scene, floorQuad(1.0));
  const PatchScene patches = build(scene, 100);
  EXPECT_THAT(patches.warnings, testing::Contains(testing::HasSubstr("exactly on an earlier one")));
  EXPECT_THAT(build(sceneOf(box({0, 0, 0}, {1, 1, 1}))).warnings, testing::IsEmpty());
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
    EXPECT_THAT(patches.warnings, testing::Contains(testing::HasSubstr("exactly on an earlier one")));
    const double boxes = box_elsewhere ? 6.0 : 0.0;
    EXPECT_NEAR(areaOf(patches, 0), 16.0 + boxes, 0.05) << "1 + 16 - 1";
    EXPECT_NEAR(areaOf(patches, 1), 17.0, 1e-4) << "nothing covers their backs";
  }
}

}  // namespace
}  // namespace radiosity::scene::test
