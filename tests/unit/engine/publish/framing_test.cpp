// Which view is chosen for a scene without cameras, and how bright a picture is shown.
#include "server/engine/publish/framing.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <glm/gtc/matrix_inverse.hpp>

#include "server/engine/publish/exports.h"
#include "server/scene/charts/build.h"

namespace radiosity::engine {
namespace {

/// A box of quads; `inward`: a room, seen from inside only.
scene::Scene boxScene(const glm::dvec3& low, const glm::dvec3& high, bool inward, unsigned faces = 6) {
  scene::Scene scene;
  scene.materials.resize(1);
  scene::Primitive primitive;
  for (unsigned corner = 0; corner < 8; ++corner) {
    primitive.positions.emplace_back((corner & 1U) != 0U ? high.x : low.x, (corner & 2U) != 0U ? high.y : low.y,
                                     (corner & 4U) != 0U ? high.z : low.z);
  }
  // counter-clockwise from outside: -x, +x, -y, +y, -z, +z
  constexpr std::array<std::array<std::uint32_t, 4>, 6> kFaces = {
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  for (unsigned f = 0; f < faces; ++f) {
    const auto& q = kFaces[f];
    const std::array<std::uint32_t, 4> c = inward ? std::array<std::uint32_t, 4>{q[3], q[2], q[1], q[0]} : q;
    for (const auto i : {c[0], c[1], c[2], c[0], c[2], c[3]}) primitive.indices.push_back(i);
  }
  scene.primitives = {primitive};
  scene.instances.resize(1);
  scene.instances[0].primitive = 0;
  return scene;
}

struct Framed {
  scene::PatchScene patches;
  scene::Camera camera;
  glm::dvec3 eye{0.0};
};

/// Irradiance of a point on the side that faces along `normal`, both in the scene's space.
using LightAt = std::function<float(const glm::dvec3& position, const glm::dvec3& normal)>;

void light(const scene::PatchScene& patches, const LightAt& light_at, std::vector<Image>& pages) {
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& leaf = patches.leaves[surface.first_leaf + i];
      if (leaf.triangle == scene::kNone) continue;
      const auto& frame = patches.triangles[leaf.triangle];
      const glm::dvec3 at(frame.origin + leaf.texel.x * frame.du + leaf.texel.y * frame.dv);
      for (std::size_t side = 0; side < 2; ++side) {
        if (surface.first_node[side] == scene::kNone) continue;
        const auto& place = surface.place[side];
        const float value =
            light_at(at * patches.scale + patches.centre, glm::dvec3(side == 0 ? frame.normal : -frame.normal));
        pages[place.page].at(static_cast<int>(place.x + i % surface.width),
                             static_cast<int>(place.y + i / surface.width)) = glm::vec3(value);
      }
    }
  }
}

Framed frame(const scene::Scene& scene, double aspect = 4.0 / 3.0, const LightAt& light_at = {}) {
  Framed framed;
  scene::ChartOptions options;
  options.texel_budget = 600;
  auto patches = scene::buildPatchScene(scene, options);
  EXPECT_TRUE(patches.has_value());
  framed.patches = std::move(*patches);
  std::vector<Image> pages;
  for (const auto& page : framed.patches.pages) {
    pages.emplace_back(static_cast<int>(page.width), static_cast<int>(page.height), glm::vec3(light_at ? 0.0F : 1.0F));
  }
  if (light_at) light(framed.patches, light_at, pages);
  framed.camera = frameScene(scene, framed.patches, pages, aspect);
  framed.eye = glm::dvec3(framed.camera.world[3]);
  return framed;
}

bool within(const glm::dvec3& p, const glm::dvec3& low, const glm::dvec3& high) {
  return p.x > low.x && p.y > low.y && p.z > low.z && p.x < high.x && p.y < high.y && p.z < high.z;
}

/// Largest |x| or |y| of the box's corners in the picture, whose border is 1; infinite for a corner behind the eye.
double reach(const scene::Camera& camera, const glm::dvec3& low, const glm::dvec3& high, double aspect) {
  const auto to_camera = glm::inverse(camera.world);
  const double half = std::tan(0.5 * camera.yfov_rad);
  double largest = 0.0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const auto p = to_camera * glm::dvec4((corner & 1U) != 0U ? high.x : low.x, (corner & 2U) != 0U ? high.y : low.y,
                                          (corner & 4U) != 0U ? high.z : low.z, 1.0);
    if (p.z >= 0.0) return INFINITY;
    largest = std::max({largest, std::abs(p.x / (-p.z * half * aspect)), std::abs(p.y / (-p.z * half))});
  }
  return largest;
}

TEST(Framing, AClosedRoomIsSeenFromInside) {
  const glm::dvec3 low(10, 0, -3), high(16, 2.6, 1);
  EXPECT_TRUE(within(frame(boxScene(low, high, true)).eye, low, high));
}

TEST(Framing, AnObjectSeenFromOutsideIsWhollyInThePicture) {
  const glm::dvec3 low(-1, 0, 5), high(3, 1, 6);
  for (const double aspect : {0.5, 4.0 / 3.0, 2.5}) {
    const auto framed = frame(boxScene(low, high, false), aspect);
    EXPECT_FALSE(within(framed.eye, low, high));
    const double border = reach(framed.camera, low, high, aspect);
    EXPECT_LE(border, 1.0) << aspect;
    EXPECT_GT(border, 0.8) << "lost in the picture at aspect " << aspect;
  }
}

TEST(Framing, AnEyeInsideASolidIsNotTaken) {
  auto scene = boxScene({0, 0, 0}, {6, 3, 6}, true);
  // A cupboard that fills half of the room: a third of the candidates stand in it.
  scene.primitives.push_back(boxScene({0.1, 0.1, 0.1}, {3, 2.9, 5.9}, false).primitives[0]);
  scene.instances.push_back(scene.instances[0]);
  scene.instances[1].primitive = 1;
  const auto framed = frame(scene);
  EXPECT_TRUE(within(framed.eye, {0, 0, 0}, {6, 3, 6}));
  EXPECT_FALSE(within(framed.eye, {0.1, 0.1, 0.1}, {3, 2.9, 5.9}));
}

/// A house, closed all around, on a lawn 60 m wide, with two rooms, of which the first has a table.
scene::Scene house() {
  auto scene = boxScene({0, 0.1, 0}, {3, 2.6, 4}, true);
  const auto add = [&](const glm::dvec3& low, const glm::dvec3& high, bool inward) {
    scene.primitives.push_back(boxScene(low, high, inward).primitives[0]);
    scene.instances.push_back(scene.instances[0]);
    scene.instances.back().primitive = static_cast<std::uint32_t>(scene.primitives.size() - 1);
  };
  add({3.2, 0.1, 0}, {8, 2.6, 4}, true);
  add({-0.3, 0, -0.3}, {8.3, 4, 4.3}, false);
  add({1, 0.8, 1.5}, {2, 0.9, 2.5}, false);
  add({-26, -0.1, -28}, {34, -0.02, 32}, false);
  return scene;
}

bool isOfFirstRoom(const glm::dvec3& p) { return within(p, {-0.1, 0, -0.1}, {3.1, 2.7, 4.1}); }

TEST(Framing, ALitRoomInAClosedHouseIsSeenFromInsideAtTheHeightOfEyes) {
  const auto framed = frame(house(), 4.0 / 3.0,
                            [](const glm::dvec3& p, const glm::dvec3&) { return isOfFirstRoom(p) ? 300.0F : 0.0F; });
  EXPECT_TRUE(within(framed.eye, {0, 0.1, 0}, {3, 2.6, 4}))
      << framed.eye.x << ' ' << framed.eye.y << ' ' << framed.eye.z;
  EXPECT_GT(framed.eye.y, 0.9);
  EXPECT_LT(framed.eye.y, 2.2);
}

TEST(Framing, LightThatFallsOutOfAWindowDoesNotDrawOneOutOfTheRoom) {
  const auto framed = frame(house(), 4.0 / 3.0, [](const glm::dvec3& p, const glm::dvec3&) {
    if (p.y < 0.0 && glm::length(p - glm::dvec3(-3, 0, 2)) < 3.0) return 20.0F;
    return isOfFirstRoom(p) ? 300.0F : 0.0F;
  });
  EXPECT_TRUE(within(framed.eye, {0, 0.1, 0}, {3, 2.6, 4}));
}

TEST(Framing, AHouseLitFromOutsideIsSeenFromOutside) {
  const auto framed = frame(house(), 4.0 / 3.0, [](const glm::dvec3& p, const glm::dvec3& normal) {
    return within(p, {-0.2, 0.05, -0.2}, {8.2, 3.9, 4.2}) || normal.y < 0.0 ? 0.0F : 300.0F;
  });
  EXPECT_FALSE(within(framed.eye, {-0.3, -0.1, -0.3}, {8.3, 4, 4.3}));
}

TEST(Framing, AHouseInWhichNothingIsLitHasAFiniteCamera) {
  const auto framed = frame(house(), 4.0 / 3.0, [](const glm::dvec3&, const glm::dvec3&) { return 0.0F; });
  EXPECT_TRUE(std::isfinite(framed.eye.x) && std::isfinite(framed.eye.y) && std::isfinite(framed.eye.z));
}

TEST(Framing, TheSameSceneGivesTheSameCamera) {
  const auto scene = boxScene({0, 0, 0}, {4, 3, 5}, true);
  EXPECT_EQ(frame(scene).camera.world, frame(scene).camera.world);
}

TEST(Framing, AnEmptySceneHasAFiniteCamera) {
  const auto camera = frameScene(scene::Scene{}, scene::PatchScene{}, {}, 1.5);
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) EXPECT_TRUE(std::isfinite(camera.world[column][row]));
  }
}

TEST(AutoExposure, ADarkSurroundingDoesNotBleachTheLitPart) {
  Image picture(100, 100, glm::vec3(1e-3F));
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 100; ++x) picture.at(x, y) = glm::vec3(50.0F);
  }
  EXPECT_NEAR(autoExposure(picture) * 50.0F, 0.18F, 0.01F);
}

TEST(AutoExposure, ATinyBrightLampDoesNotDarkenTheRoom) {
  Image picture(100, 100, glm::vec3(2.0F));
  for (int x = 0; x < 50; ++x) picture.at(x, 0) = glm::vec3(2e4F);
  EXPECT_NEAR(autoExposure(picture) * 2.0F, 0.18F, 0.01F);
}

TEST(AutoExposure, ALampCloseByDoesNotDarkenTheRoom) {
  Image picture(100, 100, glm::vec3(0.8F));
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 100; ++x) picture.at(x, y) = glm::vec3(1440.0F);
  }
  EXPECT_NEAR(autoExposure(picture) * 0.8F, 0.18F, 0.01F);
}

TEST(AutoExposure, IsTheLogarithmicMeanWhereContrastIsModest) {
  Image picture(2, 1);
  picture.pixels = {glm::vec3(1.0F), glm::vec3(4.0F)};
  EXPECT_NEAR(autoExposure(picture), 0.09F, 1e-4F);
}

TEST(AutoExposure, ABlackPictureStaysAsItIs) {
  EXPECT_EQ(autoExposure(Image(4, 4)), 1.0F);
  EXPECT_FALSE(exposureOf(Image(4, 4)));
}

TEST(Dithered, LightBetweenTwoStepsIsThatInTheMeanAndOnAStepStaysThere) {
  constexpr float kStep = 1.0F / 255.0F;
  for (const float parts : {0.0F, 0.125F, 0.5F, 0.75F}) {  // of a step, above the hundredth
    const auto shown = dithered(Image(24, 16, glm::vec3((100.0F + parts) * kStep)));
    for (int y = 0; y < 16; y += 8) {
      for (int x = 0; x < 24; x += 8) {
        double sum = 0.0;
        for (int i = 0; i < 64; ++i) sum += std::round(255.0 * static_cast<double>(shown.at(x + i % 8, y + i / 8).g));
        EXPECT_NEAR(sum / 64.0, 100.0 + static_cast<double>(parts), 1.0 / 64.0) << "a pixel in 64 is the finest";
      }
    }
  }
}

TEST(Framing, AClosedRoomOfDoubleSidedWallsIsSeenFromInside) {
  const glm::dvec3 low(0, 0, 0), high(5, 2.6, 4);
  auto scene = boxScene(low, high, true);
  scene.materials[0].double_sided = true;
  const auto framed = frame(scene, 4.0 / 3.0, [&](const glm::dvec3& p, const glm::dvec3& normal) {
    return glm::dot(normal, 0.5 * (low + high) - p) > 0.0 ? 300.0F : 0.0F;
  });
  EXPECT_TRUE(within(framed.eye, low, high));
}

}  // namespace
}  // namespace radiosity::engine
