// What is not drawn could not have been seen.
#include "server/gpu/triangle_culler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/gpu/closed_solids.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

constexpr auto kNone = scene::kNone;

TEST(ClosedSolids, AClosedBoxIsOneAndARoomOrALidlessBoxIsNot) {
  SceneBuilder builder;
  builder.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), 2, true);
  builder.addBox(glm::vec3(-0.1F), glm::vec3(0.1F), 2, false);
  builder.addBox(glm::vec3(0.2F), glm::vec3(0.3F), 2, false);
  auto scene = *builder.build();
  const auto solids = gpu::findClosedSolids(scene);
  ASSERT_EQ(solids.bounds.size(), 2U);
  EXPECT_EQ(solids.bounds[0].high, glm::vec3(0.1F));
  for (std::size_t i = 0; i < 36; ++i) {
    EXPECT_EQ(solids.solid_of[i], i < 12 ? kNone : static_cast<std::uint32_t>(i / 12 - 1));
  }
  scene.indices.resize(scene.indices.size() - 3);  // a hole in the last box
  EXPECT_EQ(gpu::findClosedSolids(scene).bounds.size(), 1U);
}

TEST(ClosedSolids, BoxesThatShareAnEdgeAreNotTakenApart) {
  SceneBuilder builder;
  builder.addBox(glm::vec3(0.0F), glm::vec3(0.25F), 1, false);
  builder.addBox(glm::vec3(0.25F, 0.25F, 0.0F), glm::vec3(0.5F, 0.5F, 0.25F), 1, false);
  EXPECT_TRUE(gpu::findClosedSolids(*builder.build()).bounds.empty());
}

/// Triangles a point sees through each face, brute force: some of many points of the triangle projects into the face.
bool mayBeSeen(const scene::PatchScene& scene, std::size_t triangle, const gpu::HemicubeAxes& axes, int face) {
  constexpr int kSteps = 24;
  const auto corner = [&](std::size_t c) { return scene.vertices[scene.indices[3 * triangle + c]].position; };
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const float u = static_cast<float>(i) / kSteps;
      const float v = static_cast<float>(j) / kSteps;
      const auto d = corner(0) + u * (corner(1) - corner(0)) + v * (corner(2) - corner(0)) - axes.origin;
      const float x = glm::dot(d, axes.tangent), y = glm::dot(d, axes.bitangent), z = glm::dot(d, axes.normal);
      if (z < 1e-4F) continue;
      const float along = face == 0 ? z : (face <= 2 ? x : y) * (face % 2 == 1 ? 1.0F : -1.0F);
      const float across = face == 0 ? std::max(std::abs(x), std::abs(y)) : std::abs(face <= 2 ? y : x);
      if (along > across + 1e-4F && (face == 0 || z < along)) return true;
    }
  }
  return false;
}

TEST(TriangleCuller, DrawsAllThatAFaceCanSee) {
  const auto scene = randomRoom(200, 200, 3);
  gpu::TriangleCuller culler(*scene);
  std::mt19937 random(3);
  std::size_t drawn = 0;
  for (int shot = 0; shot < 12; ++shot) {
    const auto frame = shotFrom(*scene, random() % 200, 0.4F, 0.3F, 64, random).frame;
    const auto axes = gpu::hemicubeAxes(frame);
    std::vector<std::uint32_t> indices;
    const auto counts = culler.cull(axes, indices);
    auto next = indices.begin();
    for (int face = 0; face < RAD_FACES; ++face) {
      const auto count =
          counts[static_cast<std::size_t>(face)].inside + counts[static_cast<std::size_t>(face)].crossing;
      const std::vector<std::uint32_t> seen(next, next + count);
      next += count;
      drawn += count / 3;
      for (std::size_t i = 0; i < scene->triangles.size(); ++i) {
        const auto& first = scene->vertices[scene->indices[3 * i]];
        const bool back = glm::dot(first.normal, axes.origin - first.position) < 0.0F;
        if (back && culler.backHidden(i)) continue;
        bool found = false;
        for (std::size_t k = 0; k < seen.size() && !found; k += 3) {
          found = std::equal(&seen[k], &seen[k] + 3, &scene->indices[3 * i]);
        }
        EXPECT_TRUE(found || !mayBeSeen(*scene, i, axes, face)) << "triangle " << i << " face " << face;
      }
    }
    EXPECT_EQ(next, indices.end());
  }
  EXPECT_LT(drawn, 12 * scene->triangles.size());  // and it does leave something out
}

}  // namespace
}  // namespace radiosity::test
