// Cubes of skies as pictures: whatever their size, the light of each texel stays what it is.
#include "server/scene/import/cube_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace radiosity::scene {
namespace {

/// Black but for one texel, of 1e6 nits; each face reduced as it would be read.
CubeMap cubeWith(std::size_t edge, std::size_t face, std::size_t x, std::size_t y) {
  CubeMap cube;
  std::vector<glm::vec3> row(edge);
  for (std::size_t f = 0; f < 6; ++f) {
    CubeFaceMaker maker(edge);
    cube.size = maker.size();
    for (std::size_t line = 0; line < edge; ++line) {
      for (std::size_t i = 0; i < edge; ++i) row[i] = glm::vec3(f == face && line == y && i == x ? 1e6F : 0.0F);
      maker.addRow(row);
    }
    cube.faces[f] = maker.take();
  }
  return cube;
}

/// Solid angle of a rectangle on a plane at distance 1, from its corner's coordinates.
double solidAngle(double s, double t) { return std::atan2(s * t, std::sqrt(1.0 + s * s + t * t)); }

double solidAngleOf(std::size_t edge, std::size_t x, std::size_t y) {
  const auto at = [&](std::size_t i) { return 2.0 * static_cast<double>(i) / static_cast<double>(edge) - 1.0; };
  return solidAngle(at(x + 1), at(y + 1)) - solidAngle(at(x), at(y + 1)) - solidAngle(at(x + 1), at(y)) +
         solidAngle(at(x), at(y));
}

double lightOf(const SkyImage& image) {
  double sum = 0.0;
  for (std::size_t y = 0; y < image.height; ++y) {
    const auto edge = [&](std::size_t row) {
      return std::cos(std::numbers::pi * static_cast<double>(row) / static_cast<double>(image.height));
    };
    const double solid_angle = 2.0 * std::numbers::pi / static_cast<double>(image.width) * (edge(y) - edge(y + 1));
    for (std::size_t x = 0; x < image.width; ++x)
      sum += solid_angle * static_cast<double>(image.texels[y * image.width + x].x);
  }
  return sum;
}

TEST(CubeMap, KeepsTheLightOfOneTexelWhateverItsSize) {
  const glm::dquat turned = glm::normalize(glm::dquat(0.9, 0.1, 0.3, -0.2));
  for (const auto& [size, face, u, v] : {std::array{16.0, 1.0, 0.5, 0.5},
                                         {100.0, 0.0, 0.3, 0.6},
                                         {512.0, 2.0, 0.51, 0.49},
                                         {700.0, 3.0, 0.02, 0.99},
                                         {1024.0, 5.0, 0.7, 0.2},
                                         {2048.0, 4.0, 0.1, 0.45}}) {
    const auto edge = static_cast<std::size_t>(size), x = static_cast<std::size_t>(u * size),
               y = static_cast<std::size_t>(v * size);
    const auto image = imageOfCube(cubeWith(edge, static_cast<std::size_t>(face), x, y), turned);
    // 16 places a texel each way find an edge to a 32nd of it at worst.
    const double light = 1e6 * solidAngleOf(edge, x, y);
    EXPECT_NEAR(lightOf(image), light, 0.04 * light) << edge << ", face " << face;
  }
}

TEST(CubeMap, OfOneColourIsThatColour) {
  CubeMap cube;
  for (auto& face : cube.faces) {
    CubeFaceMaker maker(1000);
    const std::vector<glm::vec3> row(1000, glm::vec3(3.0F, 2.0F, 1.0F));
    for (int y = 0; y < 1000; ++y) maker.addRow(row);
    cube.size = maker.size();
    face = maker.take();
    ASSERT_EQ(face.size(), cube.size * cube.size);
  }
  for (const auto& texel : imageOfCube(cube, glm::dquat(1.0, 0.0, 0.0, 0.0)).texels) {
    EXPECT_NEAR(texel.x, 3.0F, 1e-5F);
    EXPECT_NEAR(texel.z, 1.0F, 1e-5F);
  }
}

}  // namespace
}  // namespace radiosity::scene
