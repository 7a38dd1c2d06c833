// What the path tracer's glass lets through, by channel and by place, against closed forms.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/exponential.hpp>
#include <initializer_list>
#include <numbers>
#include <string>

#include "tests/oracle/path_tracer.h"
#include "tests/scenes/scenes.h"

namespace radiosity::oracle {
namespace {

using std::numbers::pi;

Triangle glassOf(const glm::dvec3& colour) {
  Triangle glass;
  glass.double_sided = true;
  glass.transmission = 1.0;
  glass.reflectance = glass.mirror.colour = colour;
  glass.mirror.interface = interfaceOf(1.5);
  glass.mirror.roughness = 0.0;
  return glass;
}

/// A square about the axis at a height, facing up; texture coordinates from (0, 0) to (1, 1) along x and z.
void addSheet(TriangleScene& scene, double half, double y, const Triangle& like) {
  const glm::dvec3 a(-half, y, -half), b(-half, y, half), c(half, y, half), d(half, y, -half);
  for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}}) {
    Triangle triangle = like;
    triangle.corners = corners;
    triangle.normal = {0.0, 1.0, 0.0};
    for (auto* use : {&triangle.passing, &triangle.metal}) {
      for (std::size_t k = 0; k < 3; ++k)
        use->uv[k] = {0.5 + 0.5 * corners[k].x / half, 0.5 + 0.5 * corners[k].z / half};
    }
    scene.triangles.push_back(triangle);
  }
}

Triangle black() {
  Triangle floor;
  floor.reflectance = glm::dvec3(0.0);
  return floor;
}

constexpr double kWide = 2000.0;  ///< half a side of sheets that hide the sky, all but a millionth of it
const glm::dvec3 kSky(3.0, 2.0, 1.0);

/// A black floor under sheets of glass as wide as the sky, a metre above and each a metre above the last.
TriangleScene floorUnder(std::initializer_list<Triangle> sheets) {
  TriangleScene scene;
  addSheet(scene, 1.0, 0.0, black());
  double y = 0.0;
  for (const auto& sheet : sheets) addSheet(scene, kWide, y += 1.0, sheet);
  scene.sky_upper = kSky;
  return scene;
}

Irradiance luxAt(const TriangleScene& scene, const glm::dvec3& point, std::uint32_t samples = 1 << 14) {
  const std::vector points{Footprint::at(point, {0.0, 1.0, 0.0})};
  return PathTracer(scene).irradiance(points, {.samples = samples, .leave_out_buried = false})[0];
}

void expectLux(const Irradiance& found, const glm::dvec3& exact) {
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(found.mean_lux[c], exact[c], 4.0 * found.standard_error[c] + 2e-5 * exact[c]) << "channel " << c;
}

/// Of light from all around: the mean of a function of the cosine, weighted by the cosine.
template <typename OfCosine>
double meanOverSky(const OfCosine& of) {
  constexpr int kSteps = 100000;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) sum += of(std::sqrt((i + 0.5) / kSteps));
  return sum / kSteps;
}

double schlick(double cosine) { return 0.04 + 0.96 * std::pow(1.0 - cosine, 5.0); }

/// A picture with one row: left and right half, as stored.
Texture halves(std::uint8_t left, std::uint8_t right) {
  Texture texture{std::make_shared<const Image>(Image{2, 1, {left, left, left, 255, right, right, right, 255}})};
  texture.nearest = true;
  return texture;
}

const glm::dvec3 kAmber(0.9, 0.4, 0.05);
const glm::dvec3 kMiddle(0.0);

TEST(TintedGlass, OverAFloorColoursTheSkyByChannel) {
  const double enters = meanOverSky([](double cosine) { return 1.0 - schlick(cosine); });
  EXPECT_NEAR(enters, 0.96 * 20.0 / 21.0, 1e-5);  // the mean of (1 - cos)^5 is 1/21
  const auto lux = luxAt(floorUnder({glassOf(kAmber)}), kMiddle);
  expectLux(lux, pi * enters * kSky * kAmber);
  EXPECT_LT(lux.standard_error.x, 0.01 * lux.mean_lux.x);
}

TEST(TintedGlass, ColoursWhatPassesAndNotWhatItReflects) {
  TriangleScene scene;
  auto floor = black();
  floor.emission_lux = kSky;
  addSheet(scene, kWide, 0.0, floor);
  addSheet(scene, kWide, 1.0, glassOf(glm::dvec3(0.0)));
  expectLux(luxAt(scene, kMiddle), kSky * meanOverSky(schlick));
}

TEST(TintedGlass, OfTwoFacesTintsTwiceAndReflectsBetweenThem) {
  const glm::dvec3 attenuation(0.5, 1.0, 0.25);
  auto face = glassOf(kAmber);
  face.mirror.attenuation = glm::sqrt(attenuation);
  const double passes = meanOverSky([](double cosine) {
    const double reflected = schlick(cosine), through = 1.0 - reflected;
    return through * through / (1.0 - reflected * reflected);
  });
  expectLux(luxAt(floorUnder({face, face}), kMiddle), pi * kSky * passes * kAmber * kAmber * attenuation);
}

/// Of the light of an even sky, what comes through the half of a sheet a metre above that begins so far away.
double halfSky(double away) { return 0.5 * (1.0 - away / std::hypot(away, 1.0)); }

Triangle withoutInterface(const glm::dvec3& colour) {
  auto glass = glassOf(colour);
  glass.mirror.interface = 0.0;
  return glass;
}

TEST(TransmissionTexture, OfWhichHalfIsBlackLetsThroughTheOtherHalf) {
  auto glass = withoutInterface(kAmber);
  glass.reflectance = glm::dvec3(0.0);  // what does not pass is lost
  glass.passing.texture = 0;
  auto scene = floorUnder({glass});
  scene.textures.push_back(halves(0, 255));
  for (const double x : {0.0, 0.75, -0.75})
    expectLux(luxAt(scene, {x, 0.0, 0.1}, 1 << 16), pi * kSky * kAmber * halfSky(-x));
}

TEST(TransmissionTexture, IsLinearAndMultipliesTheFactor) {
  auto glass = withoutInterface(kAmber);
  glass.reflectance = glm::dvec3(0.0);
  glass.passing.texture = 0;
  glass.transmission = 0.5;
  auto scene = floorUnder({glass});
  scene.textures.push_back(halves(102, 204));  // 0.4 and 0.8
  expectLux(luxAt(scene, kMiddle, 1 << 16), pi * kSky * kAmber * (0.5 * 0.6));
}

TEST(TransmissionTexture, PassesNothingWhereThereIsMetal) {
  auto glass = withoutInterface(kAmber);
  glass.reflectance = glm::dvec3(0.0);
  glass.passing.texture = 0;
  glass.metal.texture = 1;
  glass.metallic = glass.mirror.metallic = 1.0;
  auto scene = floorUnder({glass});
  scene.textures = {halves(102, 204), halves(0, 255)};
  expectLux(luxAt(scene, {0.75, 0.0, 0.1}, 1 << 16), pi * kSky * kAmber * (0.4 * halfSky(0.75)));
}

Irradiance meanOver(const TriangleScene& scene, const std::string& name) {
  Footprint footprint;
  for (const auto& triangle : scene.triangles)
    if (scene.node_names[triangle.node] == name) footprint.pieces.push_back({triangle.corners, triangle.normal});
  return PathTracer(scene).irradiance(std::vector{footprint}, {.samples = 1 << 16})[0];
}

TEST(TintedGlass, BetweenPlatesWithoutEndSharesTheirLightByChannel) {
  const double rho = 0.7, reflected = 0.04 + 0.96 / 21.0;
  const glm::dvec3 shines = pi * kSky, passes = (1.0 - reflected) * kAmber;
  const auto scene = triangulate(test_scenes::tintedBox(rho, kSky, kAmber));
  // B' = rho (R B' + T B), B = E + rho (R B + T B')
  const double own = 1.0 - rho * reflected;
  const auto above = rho * passes / own;  // parts of the floor's
  const auto floor = shines / (own - rho * passes * above), ceiling = above * floor;
  expectLux(meanOver(scene, "floor"), reflected * floor + passes * ceiling);
  expectLux(meanOver(scene, "ceiling"), reflected * ceiling + passes * floor);
}

/// A white pane right above the floor of a room that shines everywhere with 1 nit.
TriangleScene furnaceWith(const Triangle& pane) {
  auto scene = triangulate(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0), 4.0));
  TriangleScene square;
  addSheet(square, 1.9, 0.0, pane);
  for (auto& triangle : square.triangles) {
    for (auto& corner : triangle.corners) corner += glm::dvec3(2.0, 0.3, 2.0);
    scene.triangles.push_back(triangle);
  }
  return scene;
}

// What passes, what is scattered, what metal and what the interface reflect: together they are all of the light.
TEST(TransmissionTexture, InAWhitePaneLeavesAFurnaceAsItIs) {
  auto pane = glassOf(glm::dvec3(1.0));
  pane.reflectance = glm::dvec3(0.999);  // as much as may be
  for (const double metallic : {0.0, 0.7}) {
    for (const double factor : {1.0, 0.6}) {
      pane.passing.texture = 0;
      pane.metal.texture = 1;
      pane.metallic = pane.mirror.metallic = metallic;
      pane.transmission = factor;
      auto scene = furnaceWith(pane);
      scene.textures = {halves(0, 200), halves(255, 50)};
      const auto lux = luxAt(scene, {2.0, 0.0, 2.0}, 1 << 17);
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(lux.mean_lux[c], 2.0 * pi, 4.0 * lux.standard_error[c] + 1e-3 * 2.0 * pi) << metallic << factor;
      EXPECT_LT(lux.standard_error.x, 0.005 * 2.0 * pi);
    }
  }
}

}  // namespace
}  // namespace radiosity::oracle
