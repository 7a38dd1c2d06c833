// Two furnished rooms with the polygon counts of the scenes in Lum, Ma and Max 2002 (figures 1 and 2); the originals
// were never published, so the layout is ours.
#include <array>
#include <numbers>
#include <string>
#include <utility>

#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::test_scenes {
namespace {

constexpr double kHalfTurn = std::numbers::pi;
constexpr double kQuarterTurn = std::numbers::pi / 2;

/// Chairs never stand quite straight. A fixed pattern of angles within 0.1 rad of straight.
double disorder(int index) { return 0.02 * ((index * 7) % 11 - 5); }

void place(TestScene& scene, Object object, double x, double z, double angle_rad) {
  turn(object, angle_rad);
  move(object, {x, 0.0, z});
  scene.objects.push_back(std::move(object));
}

struct Palette {
  std::uint32_t white, floor, wood, metal, left, right, chair_a, chair_b, light;
};

void appendRoom(TestScene& scene, glm::dvec3 half, double height, const Palette& palette) {
  // BoxFace order: left, right, floor, ceiling, back, front
  Object room{"room", {}, {}};
  const BoxMaterials materials{palette.left, palette.right, palette.floor, palette.white, palette.white, palette.white};
  appendBox(room, {-half.x, 0.0, -half.z}, {half.x, height, half.z}, materials, kNoFace, true);
  scene.objects.push_back(std::move(room));
}

}  // namespace

TestScene smallRoom() {
  TestScene scene;
  scene.name = "room_small";
  const Palette p{scene.add({"white", glm::dvec3(0.75), glm::dvec3(0.0)}),
                  scene.add({"floor", {0.45, 0.42, 0.38}, glm::dvec3(0.0)}),
                  scene.add({"wood", {0.55, 0.38, 0.22}, glm::dvec3(0.0)}),
                  scene.add({"metal", glm::dvec3(0.30), glm::dvec3(0.0)}),
                  scene.add({"red_wall", {0.65, 0.20, 0.15}, glm::dvec3(0.0)}),
                  scene.add({"green_wall", {0.18, 0.55, 0.20}, glm::dvec3(0.0)}),
                  scene.add({"red_seat", {0.60, 0.08, 0.06}, glm::dvec3(0.0)}),
                  scene.add({"green_seat", {0.08, 0.50, 0.12}, glm::dvec3(0.0)}),
                  scene.add({"lamp_light", glm::dvec3(0.50), {60.0, 57.0, 50.0}})};
  constexpr double kHeight = 2.7;
  appendRoom(scene, {3.2, 0.0, 2.3}, kHeight, p);
  scene.objects.push_back(makeCeilingLamp("lamp", {0.0, kHeight - 0.15, 0.0}, 1.2, 0.6, p.white, p.light));
  int chair = 0;
  for (int t = 0; t < 3; ++t) {
    const double x = 2.0 * (t - 1);
    place(scene, makeTable("table" + std::to_string(t + 1), 0.8, 1.6, p.metal, p.wood), x, 0.0, 0.0);
    for (const double side : {-1.0, 1.0}) {
      for (const double z : {-0.4, 0.4}) {
        const auto seat = side < 0.0 ? p.chair_a : p.chair_b;
        auto object = makeChair("chair" + std::to_string(chair + 1), p.metal, seat);
        // the sitter looks along +Z: turn towards the table
        place(scene, std::move(object), x + 0.62 * side, z, -side * kQuarterTurn + disorder(chair));
        ++chair;
      }
    }
  }
  scene.camera = {{2.4, 1.7, 2.1}, {-0.4, 0.6, -0.5}, 1.0, 0.0};
  return scene;
}

TestScene lightsRoom() {
  auto scene = smallRoom();
  scene.name = "room_lights";
  for (auto& material : scene.materials) material.emission_nits = glm::dvec3(0.0);
  Light bulb;
  bulb.position = {-1.6, 1.9, 0.9};
  bulb.intensity = {60.0, 50.0, 40.0};
  Light spot;
  spot.kind = Light::Kind::kSpot;
  spot.position = {1.2, 2.3, -0.6};
  spot.target = {0.4, 0.0, -1.2};
  spot.intensity = glm::dvec3(200.0);
  spot.inner_cone_rad = 0.3;
  spot.outer_cone_rad = 0.7;
  scene.lights = {bulb, spot};
  return scene;
}

TestScene areaRoom() {
  auto scene = smallRoom();
  scene.name = "room_area";
  for (auto& material : scene.materials) material.emission_nits = glm::dvec3(0.0);
  Light panel;
  panel.kind = Light::Kind::kRectangle;
  panel.position = {0.0, 2.3, -0.4};
  panel.target = {0.0, 0.0, -0.4};
  panel.intensity = {900.0, 850.0, 800.0};
  panel.width_m = 1.2;
  panel.height_m = 0.3;
  Light disc = panel;
  disc.kind = Light::Kind::kDisc;
  disc.position = {-1.7, 1.4, 1.2};
  disc.target = {0.0, 0.6, 0.0};
  disc.intensity = {600.0, 700.0, 900.0};
  disc.radius_m = 0.15;
  Light globe;
  globe.position = {1.3, 1.6, 0.8};
  globe.intensity = {30.0, 25.0, 20.0};
  globe.radius_m = 0.1;
  scene.lights = {panel, disc, globe};
  return scene;
}

TestScene seminarRoom() {
  TestScene scene;
  scene.name = "room_seminar";
  const Palette p{scene.add({"white", glm::dvec3(0.75), glm::dvec3(0.0)}),
                  scene.add({"floor", {0.35, 0.33, 0.32}, glm::dvec3(0.0)}),
                  scene.add({"wood", {0.55, 0.42, 0.28}, glm::dvec3(0.0)}),
                  scene.add({"metal", glm::dvec3(0.35), glm::dvec3(0.0)}),
                  scene.add({"blue_wall", {0.20, 0.30, 0.65}, glm::dvec3(0.0)}),
                  scene.add({"yellow_wall", {0.70, 0.60, 0.30}, glm::dvec3(0.0)}),
                  scene.add({"grey_seat", glm::dvec3(0.45), glm::dvec3(0.0)}),
                  scene.add({"red_seat", {0.50, 0.15, 0.12}, glm::dvec3(0.0)}),
                  scene.add({"lamp_light", glm::dvec3(0.50), {60.0, 57.0, 50.0}})};
  constexpr double kHeight = 3.0;
  appendRoom(scene, {5.2, 0.0, 6.2}, kHeight, p);
  for (int i = 0; i < 8; ++i) {
    const glm::dvec3 origin((i % 2) * 5.0 - 2.5, kHeight - 0.15, (i / 2) * 3.0 - 4.5);
    scene.objects.push_back(makeCeilingLamp("lamp" + std::to_string(i + 1), origin, 1.2, 0.6, p.white, p.light));
  }
  int chair = 0;
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 5; ++column) {
      const double x = 1.9 * (column - 2);
      const double z = 1.15 * row - 2.6;
      const auto name = std::to_string(row * 5 + column + 1);
      place(scene, makeTable("table" + name, 1.4, 0.5, p.metal, p.wood), x, z, 0.0);
      for (const double dx : {-0.35, 0.35}) {
        auto object = makeChair("chair" + std::to_string(chair + 1), p.metal, chair % 7 == 3 ? p.chair_b : p.chair_a);
        place(scene, std::move(object), x + dx, z + 0.45, kHalfTurn + disorder(chair));
        ++chair;
      }
    }
  }
  place(scene, makeTable("desk1", 1.6, 0.7, p.metal, p.wood), -0.85, -4.6, 0.0);
  place(scene, makeTable("desk2", 1.6, 0.7, p.metal, p.wood), 0.85, -4.6, 0.0);
  scene.camera = {{4.4, 2.2, 5.9}, {-0.8, 0.7, -1.0}, 0.95, 0.0};
  return scene;
}

TestScene smoothRoom() {
  TestScene scene;
  scene.name = "room_smooth";
  const auto white = scene.add({"white", glm::dvec3(0.75), glm::dvec3(0.0)});
  const auto red = scene.add({"red_wall", {0.65, 0.20, 0.15}, glm::dvec3(0.0)});
  const auto floor = scene.add({"floor", {0.45, 0.42, 0.38}, glm::dvec3(0.0)});
  const auto ball = scene.add({"ball", glm::dvec3(0.6), glm::dvec3(0.0)});
  const auto barrel = scene.add({"barrel", {0.5, 0.35, 0.2}, glm::dvec3(0.0)});
  const auto light = scene.add({"lamp_light", glm::dvec3(0.5), {60.0, 57.0, 50.0}});
  constexpr double kHeight = 2.4;
  Object room{"room", {}, {}};
  appendBox(room, {-1.5, 0.0, -1.5}, {1.5, kHeight, 1.5}, {red, white, floor, white, white, white}, kNoFace, true);
  scene.objects.push_back(std::move(room));
  scene.objects.push_back(makeCeilingLamp("lamp", {0.3, kHeight - 0.15, 0.0}, 0.8, 0.5, white, light));
  Object sphere{"ball", {-0.6, 1.0, 0.2}, {}};
  appendSphere(sphere, sphere.origin, 0.4, 1, ball, false, true);
  scene.objects.push_back(std::move(sphere));
  Object cylinder{"barrel", {0.6, 0.1, -0.4}, {}};
  appendCylinder(cylinder, cylinder.origin, 0.35, 0.9, 12, barrel);
  scene.objects.push_back(std::move(cylinder));
  scene.camera = {{1.2, 1.5, 1.4}, {-0.2, 0.8, -0.2}, 1.0, 0.0};
  return scene;
}

/// The small room with a mirror for one wall, and legs of chairs and tables of metal.
TestScene mirrorRoom() {
  auto scene = smallRoom();
  scene.name = "room_small_mirror";
  for (auto& material : scene.materials) {
    const bool is_wall = material.name == "red_wall";
    if (!is_wall && material.name != "metal") continue;
    material.metallic = 1.0;
    material.reflectance = glm::dvec3(is_wall ? 0.9 : 0.6);
    material.roughness = is_wall ? 0.0 : 0.3;
  }
  return scene;
}

/// The small room with tops of tables, and seats, of clear glass.
TestScene glassRoom() {
  auto scene = smallRoom();
  scene.name = "room_small_glass";
  for (auto& material : scene.materials) {
    if (material.name != "wood" && material.name != "red_seat") continue;
    material.transmission = 1.0;
    material.reflectance = glm::dvec3(0.98);
    material.roughness = 0.0;
  }
  return scene;
}

/// The small room with tops of tables, and seats, of coloured glass, and a pane of it under one half of the lamp: all
/// of the light that comes through it is coloured, and beside it none is.
TestScene tintedRoom() {
  auto scene = smallRoom();
  scene.name = "room_small_tinted";
  const auto makeGlass = [](Material& material, const glm::dvec3& tint) {
    material.transmission = 1.0;
    material.reflectance = tint;
    material.roughness = 0.0;
  };
  for (auto& material : scene.materials) {
    if (material.name == "wood") makeGlass(material, {0.3, 0.6, 0.95});
    if (material.name == "red_seat") makeGlass(material, {0.9, 0.15, 0.1});
    if (material.name == "green_seat") makeGlass(material, {0.15, 0.85, 0.3});
  }
  Material amber{"amber", {}, {}};
  makeGlass(amber, {0.95, 0.5, 0.1});
  Object pane{"pane", {0.0, 2.1, 0.0}, {}};
  appendBox(pane, {-1.6, 2.1, -0.9}, {0.0, 2.12, 0.9}, allFaces(scene.add(amber)));
  scene.objects.push_back(std::move(pane));
  return scene;
}

/// The small room with walls of brushed metal.
TestScene brushedRoom() {
  auto scene = smallRoom();
  scene.name = "room_small_brushed";
  for (auto& material : scene.materials) {
    if (material.name != "red_wall" && material.name != "green_wall") continue;
    material.metallic = 1.0;
    material.roughness = 0.4;
  }
  return scene;
}

/// The small room, lit by a lamp in a shade of paper that stands on a table.
TestScene shadeRoom() {
  auto scene = smallRoom();
  scene.name = "room_small_shade";
  for (auto& material : scene.materials) material.emission_nits = glm::dvec3(0.0);
  Material paper{"paper", glm::dvec3(0.85), {}};
  paper.diffuse_transmission = 0.5;
  paper.double_sided = true;
  const auto shade = scene.add(paper), bulb = scene.add({"bulb", glm::dvec3(0.5), {3000.0, 2800.0, 2400.0}});
  constexpr double kTop = 0.74, kHalf = 0.15;  // of the table; of the shade
  Object lamp{"table_lamp", {0.0, kTop, 0.0}, {}};
  appendBox(lamp, {-0.04, kTop + 0.2, -0.04}, {0.04, kTop + 0.28, 0.04}, allFaces(bulb));
  const glm::dvec3 low(-kHalf, kTop + 0.08, -kHalf), high(kHalf, kTop + 0.4, kHalf);
  appendBox(lamp, low, high, allFaces(shade), kYMin | kYMax);
  scene.objects.push_back(std::move(lamp));
  return scene;
}

/// The small room without one of its walls, under an even sky.
TestScene openRoom() {
  auto scene = smallRoom();
  scene.name = "room_small_open";
  for (auto& material : scene.materials) material.emission_nits = glm::dvec3(0.0);
  auto& walls = scene.objects.front().polygons;
  std::erase_if(walls, [&](const Polygon& wall) { return scene.materials[wall.material].name == "green_wall"; });
  scene.sky_upper_nits = {900.0, 950.0, 1000.0};
  scene.sky_lower_nits = glm::dvec3(300.0);
  return scene;
}

TestScene doubleSidedTwin(TestScene scene) {
  scene.name += "_double";
  for (auto& material : scene.materials) material.double_sided = material.emission_nits == glm::dvec3(0.0);
  return scene;
}

std::vector<std::pair<std::string, std::function<TestScene()>>> allScenes() {
  const auto grey = [](double rho) { return [rho] { return furnace(glm::dvec3(rho), glm::dvec3(1.0)); }; };
  return {{"cornell", cornell},
          {"furnace", grey(0.5)},
          {"furnace_90", grey(0.9)},
          {"lumped_cube", [] { return lumpedCube(0.5); }},
          {"plates_parallel", [] { return parallelPlates(1.0, 1.0, 1.0, 1.0, 0.5); }},
          {"plates_perpendicular", [] { return perpendicularPlates(1.0, 1.0, 1.0, 1.0, 0.5); }},
          {"sphere_in_sphere",
           [] {
             return concentricSpheres({0.5, 0.5, 1.0}, {1.0, 0.6, 0.0});
           }},
          {"room_small", smallRoom},
          {"room_small_mirror", mirrorRoom},
          {"room_small_glass", glassRoom},
          {"room_small_tinted", tintedRoom},
          {"room_small_brushed", brushedRoom},
          {"room_small_shade", shadeRoom},
          {"room_small_open", openRoom},
          {"room_seminar", seminarRoom},
          {"room_lights", lightsRoom},
          {"room_area", areaRoom},
          {"room_smooth", smoothRoom},
          {"cornell_double", [] { return doubleSidedTwin(cornell()); }},
          {"room_small_double", [] { return doubleSidedTwin(smallRoom()); }},
          {"room_seminar_double", [] { return doubleSidedTwin(seminarRoom()); }}};
}

}  // namespace radiosity::test_scenes
