// What an image in parallel projection leaves out could not have been seen.
#include "server/gpu/cull/parallel_culler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>

#include "server/scene/burial/solid_finder.h"
#include "server/scene/values/closed_solids.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

/// Whether the middle of some pixel lies inside a triangle, in double.
bool showsASample(const std::array<glm::dvec2, 3>& c) {
  const auto [low_x, high_x] = std::minmax({c[0].x, c[1].x, c[2].x});
  const auto [low_y, high_y] = std::minmax({c[0].y, c[1].y, c[2].y});
  const auto side = [](const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p) {
    return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
  };
  for (double y = std::ceil(low_y - 0.5) + 0.5; y <= high_y; ++y) {
    for (double x = std::ceil(low_x - 0.5) + 0.5; x <= high_x; ++x) {
      const glm::dvec2 p(x, y);
      const double s0 = side(c[0], c[1], p), s1 = side(c[1], c[2], p), s2 = side(c[2], c[0], p);
      if ((s0 >= 0 && s1 >= 0 && s2 >= 0) || (s0 <= 0 && s1 <= 0 && s2 <= 0)) return true;
    }
  }
  return false;
}

TEST(ParallelCuller, LeavesOutOnlyBacksOfSolidsAndWhatShowsNoSample) {
  const auto scene = randomRoom(1206, 1206, 4);
  gpu::ParallelCuller culler(*scene);
  ASSERT_EQ(culler.triangleCount(), scene->triangles.size());
  const auto solids = scene::findClosedSolids(*scene);
  std::size_t left_out = 0, between = 0;
  for (int view = 0; view < 6; ++view) {
    const auto angle = static_cast<float>(view);
    const auto direction = glm::normalize(glm::vec3(std::cos(angle), 0.4F, std::sin(angle)));
    const auto right = glm::normalize(glm::cross(direction, glm::vec3(0.2F, 1.0F, 0.3F)));
    constexpr float kPixels = 36.0F;  // for each unit: small boxes are a few pixels wide
    const gpu::ParallelAxes axes{glm::vec3(0.0F), kPixels * right, kPixels * glm::cross(direction, right),
                                 glm::vec2(32.3F, 32.8F), 0.0};
    std::vector<std::uint32_t> indices;
    culler.select(axes, direction, indices);
    std::set<std::array<std::uint32_t, 3>> drawn;
    for (std::size_t k = 0; k < indices.size(); k += 3) drawn.insert({indices[k], indices[k + 1], indices[k + 2]});
    for (std::size_t i = 0; i < scene->triangles.size(); ++i) {
      const auto* corners = &scene->indices[3 * i];
      if (drawn.count({corners[0], corners[1], corners[2]}) > 0) continue;
      ++left_out;
      if (solids.solid_of[i] != scene::kNone && glm::dot(scene->triangles[i].normal, direction) < 0.0F) continue;
      ++between;
      std::array<glm::dvec2, 3> image;
      for (std::size_t k = 0; k < 3; ++k) {
        const glm::dvec3 at(scene->vertices[corners[k]].position);
        image[k] = {glm::dot(at, glm::dvec3(axes.right)) + static_cast<double>(axes.shift.x),
                    glm::dot(at, glm::dvec3(axes.up)) + static_cast<double>(axes.shift.y)};
      }
      EXPECT_FALSE(showsASample(image)) << "triangle " << i << " in view " << view;
    }
  }
  EXPECT_GT(between, 50U);
  EXPECT_GT(left_out, 6 * scene->triangles.size() / 3);
}

}  // namespace
}  // namespace radiosity::test
