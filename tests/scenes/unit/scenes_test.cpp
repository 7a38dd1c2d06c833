#include "tests/scenes/scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::test_scenes {
namespace {

double signedVolume(const std::vector<Polygon>& polygons) {
  double volume = 0.0;
  for (const auto& polygon : polygons) {
    for (std::size_t i = 1; i + 1 < polygon.corners.size(); ++i) {
      volume += glm::dot(polygon.corners[0], glm::cross(polygon.corners[i], polygon.corners[i + 1])) / 6.0;
    }
  }
  return volume;
}

const Object& objectNamed(const TestScene& scene, const std::string& name) {
  const auto found = std::find_if(scene.objects.begin(), scene.objects.end(),
                                  [&](const Object& object) { return object.name == name; });
  EXPECT_NE(found, scene.objects.end()) << name;
  return *found;
}

TEST(Scenes, PaperRoomsHaveThePapersPolygonCounts) {
  EXPECT_EQ(smallRoom().polygonCount(), 402U);
  EXPECT_EQ(seminarRoom().polygonCount(), 3138U);
}

TEST(Scenes, RoomsStayInsideTheirWalls) {
  for (const auto& scene : {smallRoom(), seminarRoom()}) {
    glm::dvec3 low(INFINITY);
    glm::dvec3 high(-INFINITY);
    for (const auto& polygon : objectNamed(scene, "room").polygons) {
      for (const auto& corner : polygon.corners) {
        low = glm::min(low, corner);
        high = glm::max(high, corner);
      }
    }
    for (const auto& object : scene.objects) {
      for (const auto& polygon : object.polygons) {
        for (const auto& corner : polygon.corners) {
          EXPECT_TRUE(glm::all(glm::greaterThanEqual(corner, low)) && glm::all(glm::lessThanEqual(corner, high)))
              << scene.name << ": " << object.name;
        }
      }
    }
  }
}

TEST(Scenes, NamesAreUnique) {
  for (const auto& [name, make] : allScenes()) {
    std::map<std::string, int> seen;
    for (const auto& object : make().objects) EXPECT_EQ(++seen[object.name], 1) << name << ": " << object.name;
  }
}

TEST(Scenes, ReflectancesAreBelowOne) {
  for (const auto& [name, make] : allScenes()) {
    for (const auto& material : make().materials) {
      EXPECT_TRUE(glm::all(glm::lessThan(material.reflectance, glm::dvec3(1.0)))) << name << ": " << material.name;
    }
  }
}

TEST(Scenes, ADoubleSidedTwinDiffersInTheSidesOfWhatDoesNotShineAlone) {
  const auto single = cornell(), twin = doubleSidedTwin(single);
  EXPECT_EQ(twin.name, "cornell_double");
  EXPECT_EQ(twin.polygonCount(), single.polygonCount());
  ASSERT_EQ(twin.materials.size(), single.materials.size());
  for (std::size_t i = 0; i < twin.materials.size(); ++i) {
    EXPECT_FALSE(single.materials[i].double_sided);
    EXPECT_EQ(twin.materials[i].double_sided, single.materials[i].name != "light");
    EXPECT_EQ(twin.materials[i].reflectance, single.materials[i].reflectance);
  }
}

TEST(Scenes, BoxFacesOutwardsAndEnclosesItsVolume) {
  Object box;
  appendBox(box, {1, 2, 3}, {2, 4, 6}, allFaces(0));
  EXPECT_NEAR(signedVolume(box.polygons), 6.0, 1e-12);
}

TEST(Scenes, FurnaceFacesInwards) {
  EXPECT_NEAR(signedVolume(furnace(glm::dvec3(0.5), glm::dvec3(1.0), 2.0).objects[0].polygons), -8.0, 1e-12);
}

TEST(Scenes, SphereHasTheAreaOfTheSphere) {
  Object sphere;
  appendSphere(sphere, {1, 2, 3}, 0.7, 2, 0, false);
  double area = 0.0;
  for (const auto& polygon : sphere.polygons) area += polygonArea(polygon);
  EXPECT_NEAR(area, 4.0 * M_PI * 0.49, 1e-12);
  EXPECT_GT(signedVolume(sphere.polygons), 0.0);
}

TEST(Cornell, EverySurfaceFacesTheInside) {
  const auto scene = cornell();
  const glm::dvec3 middle(0.278, 0.274, 0.28);
  for (const auto& name : {"floor", "back", "left", "right", "ceiling", "lamp"}) {
    for (const auto& polygon : objectNamed(scene, name).polygons) {
      EXPECT_GT(glm::dot(polygonNormal(polygon), middle - polygon.corners[0]), 0.0) << name;
    }
  }
}

TEST(Cornell, BlocksFaceOutwards) {
  const auto scene = cornell();
  for (const auto& name : {"short_block", "tall_block"}) {
    const auto& object = objectNamed(scene, name);
    ASSERT_EQ(object.polygons.size(), 5U);
    for (const auto& polygon : object.polygons) {
      EXPECT_GT(glm::dot(polygonNormal(polygon), polygon.corners[0] - (object.origin + glm::dvec3(0, 0.05, 0))), 0.0);
    }
  }
}

TEST(Cornell, RedIsLeftAndGreenIsRightInThePicture) {
  const auto scene = cornell();
  const auto forward = glm::normalize(scene.camera.target - scene.camera.position);
  const auto right = glm::cross(forward, glm::dvec3(0, 1, 0));
  const auto side = [&](const char* name) {
    const auto& polygon = objectNamed(scene, name).polygons[0];
    return glm::dot(polygon.corners[0] - scene.camera.position, right);
  };
  EXPECT_LT(side("left"), 0.0);
  EXPECT_GT(side("right"), 0.0);
  const auto& red = scene.materials[objectNamed(scene, "left").polygons[0].material].reflectance;
  EXPECT_GT(red.x, 4.0 * red.y);
}

TEST(Cornell, LightFillsTheHoleInTheCeilingExactly) {
  const auto scene = cornell();
  double area = polygonArea(objectNamed(scene, "lamp").polygons[0]);
  EXPECT_NEAR(area, 0.130 * 0.105, 1e-12);
  for (const auto& polygon : objectNamed(scene, "ceiling").polygons) area += polygonArea(polygon);
  EXPECT_NEAR(area, 0.556 * 0.5592, 1e-12);
}

TEST(GlbWriter, HeaderAndChunksDescribeTheFile) {
  const auto bytes = encodeGlb(cornell());
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  EXPECT_EQ(word(0), 0x46546C67U);
  EXPECT_EQ(word(8), bytes.size());
  const auto json_length = word(12);
  EXPECT_EQ(word(20 + json_length) + 28 + json_length, bytes.size());
  const auto gltf = nlohmann::json::parse(bytes.begin() + 20, bytes.begin() + 20 + json_length);
  EXPECT_EQ(gltf["buffers"][0]["byteLength"], word(20 + json_length));
  EXPECT_EQ(gltf["nodes"].back()["rotation"][1].get<double>(), 1.0);
}

}  // namespace
}  // namespace radiosity::test_scenes
