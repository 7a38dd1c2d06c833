#include "server/scene/shading/shading_normals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "server/scene/values/patch_scene.h"
#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

/// Normals of a ball about the origin of its mesh.
Primitive smoothBall(int levels) {
  auto ball = icoSphere(1.0, levels);
  for (const auto& p : ball.positions) ball.normals.emplace_back(glm::normalize(p));
  return ball;
}

struct Corner {
  std::uint32_t triangle;
  glm::vec2 texel;
  glm::dvec3 position, geometric;  ///< world
};
std::vector<Corner> corners(const PatchScene& patches) {
  std::vector<Corner> all;
  for (std::size_t i = 0; i < patches.indices.size(); ++i) {
    const auto& vertex = patches.vertices[patches.indices[i]];
    all.push_back({static_cast<std::uint32_t>(i / 3), vertex.texel,
                   patches.centre + patches.scale * glm::dvec3(vertex.position),
                   glm::dvec3(patches.triangles[i / 3].normal)});
  }
  return all;
}

TEST(ShadingNormals, AreThoseOfTheFileAtEveryCornerHoweverItIsPlaced) {
  const auto ball = smoothBall(1);
  glm::dmat4 mirrored(1.0), stretched(1.0);
  mirrored[0][0] = -1.0;
  stretched[1][1] = 2.5;
  for (const auto& world : {glm::dmat4(1.0), mirrored, glm::rotate(stretched, 0.7, glm::dvec3(1, 2, 3))}) {
    Scene scene;
    place(scene, ball, world);
    const auto patches = build(scene, 4000);
    const ShadingNormals normals(scene, patches);
    ASSERT_FALSE(normals.empty());
    const glm::dmat3 to_mesh = glm::inverse(glm::dmat3(world));
    for (const auto& corner : corners(patches)) {
      // The ball's normal there, as normals go through a map: by the transpose of its inverse.
      const auto exact = glm::normalize(glm::transpose(to_mesh) * (to_mesh * corner.position));
      EXPECT_TRUE(normals.has(corner.triangle));
      EXPECT_GT(glm::dot(normals.at(corner.triangle, corner.texel, corner.geometric), exact), 1.0 - 1e-6);
    }
  }
}

TEST(ShadingNormals, AreInterpolatedWithinATriangle) {
  Primitive floor = floorQuad(2.0, -1.0, -1.0);
  for (const auto& p : floor.positions) floor.normals.emplace_back(glm::normalize(glm::dvec3(0.4 * p.x, 1.0, 0.0)));
  const auto scene = sceneOf(floor);
  const auto patches = build(scene, 4000);
  const ShadingNormals normals(scene, patches);
  const auto all = corners(patches);
  for (const auto& weight : {glm::vec3(0.2F, 0.3F, 0.5F), glm::vec3(0.6F, 0.1F, 0.3F)}) {
    glm::vec2 texel(0.0F);
    glm::dvec3 at(0.0);
    for (std::size_t k = 0; k < 3; ++k) {
      texel += weight[static_cast<int>(k)] * all[k].texel;
      at += static_cast<double>(weight[static_cast<int>(k)]) * all[k].position;
    }
    // All corners have (0.4 x, 1, 0) times one over the same length.
    const auto normal = normals.at(0, texel, all[0].geometric);
    EXPECT_NEAR(normal.x / normal.y, 0.4 * at.x, 1e-4);
    EXPECT_NEAR(glm::length(normal), 1.0, 1e-12);
  }
}

TEST(ShadingNormals, OfFlatFacesAreNone) {
  Primitive room = box({0, 0, 0}, {1, 2, 3});
  EXPECT_TRUE(ShadingNormals(sceneOf(room), build(sceneOf(room), 4000)).empty()) << "no NORMAL";
  room.normals.resize(room.positions.size());
  for (std::size_t i = 0; i < room.indices.size(); i += 3) {
    const auto corner = [&](std::size_t k) { return room.positions[room.indices[i + k]]; };
    const auto normal = glm::normalize(glm::cross(corner(1) - corner(0), corner(2) - corner(0)));
    for (std::size_t k = 0; k < 3; ++k) room.normals[room.indices[i + k]] = glm::vec3(normal);
  }
  EXPECT_TRUE(ShadingNormals(sceneOf(room), build(sceneOf(room), 4000)).empty()) << "the faces' own";
  room.normals.assign(room.positions.size(), glm::vec3(0.0F));
  EXPECT_TRUE(ShadingNormals(sceneOf(room), build(sceneOf(room), 4000)).empty()) << "unusable";
}

TEST(ShadingNormals, ThatPointToTheBackCountAsFlat) {
  auto ball = smoothBall(1);
  for (auto& normal : ball.normals) normal = -normal;
  const auto scene = sceneOf(ball);
  const auto patches = build(scene, 4000);
  EXPECT_TRUE(ShadingNormals(scene, patches).empty());
}

TEST(ShadingNormals, ChartsOfASmoothBallAreStitchedHoweverSteepItsFacets) {
  const auto seamsOf = [](const Primitive& ball) { return build(sceneOf(ball), 4000).seams.size(); };
  EXPECT_EQ(seamsOf(icoSphere(1.0, 0)), 0U) << "42 degrees";
  EXPECT_EQ(seamsOf(smoothBall(0)), 30U);
}

TEST(ShadingNormals, WhereOneCornerPointsToTheBackTheOthersStillCount) {
  auto floor = floorQuad(2.0);
  floor.normals.assign(floor.positions.size(), glm::normalize(glm::vec3(0.3F, 1.0F, 0.0F)));
  floor.normals[0] = {0.0F, -1.0F, 0.0F};
  const auto scene = sceneOf(floor);
  const auto patches = build(scene, 4000);
  const ShadingNormals normals(scene, patches);
  ASSERT_FALSE(normals.empty());
  for (const auto& corner : corners(patches)) {
    const auto normal = normals.at(corner.triangle, corner.texel, corner.geometric);
    EXPECT_GT(glm::dot(normal, corner.geometric), 0.9) << "never to the back, nor torn";
  }
}

}  // namespace
}  // namespace radiosity::scene::test
