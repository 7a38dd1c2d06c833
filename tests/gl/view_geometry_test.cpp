// In which order a picture draws faces that lie on each other. No graphics context is needed.
#include "server/gpu/picture/view_geometry.h"

#include <gtest/gtest.h>

namespace radiosity::gpu {
namespace {

/// Triangles of an instance each in one place: a floor, and two posters of a material that emits, of which the surface
/// of the first is dark.
struct Stack {
  scene::Scene scene;
  scene::PatchScene patches;

  Stack() {
    scene.materials.resize(2);
    scene.materials[1].emission = glm::vec3(1.0F);
    for (std::uint32_t i = 0; i < 3; ++i) {
      scene::Primitive primitive;
      primitive.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
      primitive.indices = {0, 1, 2};
      primitive.material = i > 0 ? 1 : 0;
      scene.primitives.push_back(primitive);
      scene::Instance instance;
      instance.primitive = i;
      scene.instances.push_back(instance);
      scene::PatchScene::SideUv uvs;
      uvs.corners.resize(1);
      uvs.page = {0};
      patches.instance_uvs.push_back({{uvs, {}}});
      scene::Surface surface;
      surface.instance = surface.first_triangle = i;
      surface.triangle_count = 1;
      surface.material = primitive.material;
      surface.emits = i == 2;
      patches.surfaces.push_back(surface);
      patches.triangle_source.push_back(0);
    }
    patches.pages = {{4, 4}};
  }
};

TEST(ViewGeometry, OfFacesThatLieOnEachOtherThoseComeFirstWhoseTextureShines) {
  Stack stack;
  stack.patches.covered.emplace_back();
  const auto draws = makeViewGeometry(stack.scene, stack.patches, glm::dvec3(0.0)).draws;
  ASSERT_EQ(draws.size(), 3U);
  EXPECT_EQ(draws[0].first, 6U) << "the poster that emits";
  EXPECT_EQ(draws[1].first, 0U);
  EXPECT_EQ(draws[2].first, 3U) << "its material emits, but it is dark";
}

TEST(ViewGeometry, WhereNoneDoAllAreDrawnAsInTheFile) {
  const Stack stack;
  const auto draws = makeViewGeometry(stack.scene, stack.patches, glm::dvec3(0.0)).draws;
  ASSERT_EQ(draws.size(), 2U) << "both posters are drawn at once";
  EXPECT_EQ(draws[0].first, 0U);
  EXPECT_EQ(draws[1].first, 3U);
}

}  // namespace
}  // namespace radiosity::gpu
