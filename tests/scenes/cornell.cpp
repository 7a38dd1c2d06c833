// Source of the numbers: "Cornell Box Data", Cornell University Program of Computer Graphics (measured vertices in
// millimetres and spectra, published as facts). Colours are those spectra integrated against the CIE 1931 observer
// (fit of Wyman, Sloan and Shirley, JCGT 2013) under D65 and turned to linear sRGB; the light's spectrum likewise.
#include <cmath>
#include <utility>

#include "tests/scenes/scenes.h"

namespace radiosity::test_scenes {
namespace {

using Corners = std::vector<glm::dvec3>;

void append(Object& object, Corners millimetres, std::uint32_t material) {
  for (auto& corner : millimetres) corner *= 0.001;
  object.polygons.push_back({std::move(millimetres), material});
}

Object ceilingAroundLight(std::uint32_t white) {
  constexpr double kY = 548.8;
  const Corners outer{{556, kY, 0}, {556, kY, 559.2}, {0, kY, 559.2}, {0, kY, 0}};
  const Corners inner{{343, kY, 227}, {343, kY, 332}, {213, kY, 332}, {213, kY, 227}};
  Object ceiling{"ceiling", {}, {}};
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t next = (i + 1) % 4;
    append(ceiling, {outer[i], outer[next], inner[next], inner[i]}, white);
  }
  return ceiling;
}

void appendWalls(TestScene& scene, std::uint32_t white, std::uint32_t red, std::uint32_t green) {
  Object floor{"floor", {}, {}};
  append(floor, {{552.8, 0, 0}, {0, 0, 0}, {0, 0, 559.2}, {549.6, 0, 559.2}}, white);
  Object back{"back", {}, {}};
  append(back, {{549.6, 0, 559.2}, {0, 0, 559.2}, {0, 548.8, 559.2}, {556, 548.8, 559.2}}, white);
  Object right{"right", {}, {}};
  append(right, {{0, 0, 559.2}, {0, 0, 0}, {0, 548.8, 0}, {0, 548.8, 559.2}}, green);
  Object left{"left", {}, {}};  // as measured its four corners are not in one plane: two triangles
  append(left, {{552.8, 0, 0}, {549.6, 0, 559.2}, {556, 548.8, 559.2}}, red);
  append(left, {{552.8, 0, 0}, {556, 548.8, 559.2}, {556, 548.8, 0}}, red);
  for (auto* wall : {&floor, &back, &right, &left}) scene.objects.push_back(std::move(*wall));
  scene.objects.push_back(ceilingAroundLight(white));
}

Object block(std::string name, const Corners& top, std::uint32_t white) {
  Object block{std::move(name), {}, {}};
  append(block, top, white);
  for (std::size_t i = 0; i < top.size(); ++i) {
    const auto& a = top[i];
    const auto& b = top[(i + 1) % top.size()];
    append(block, {{a.x, 0, a.z}, {b.x, 0, b.z}, b, a}, white);
  }
  glm::dvec3 middle(0.0);
  for (const auto& corner : top) middle += corner / static_cast<double>(top.size()) * 0.001;
  block.origin = {middle.x, 0.0, middle.z};
  return block;
}

}  // namespace

TestScene cornell() {
  TestScene scene;
  scene.name = "cornell";
  const auto white = scene.add({"white", {0.7381, 0.7359, 0.7396}, glm::dvec3(0.0)});
  const auto red = scene.add({"red", {0.4866, 0.0504, 0.0510}, glm::dvec3(0.0)});
  const auto green = scene.add({"green", {0.0712, 0.3975, 0.0870}, glm::dvec3(0.0)});
  const auto light = scene.add({"light", glm::dvec3(0.78), {20.58, 11.06, 2.775}});
  appendWalls(scene, white, red, green);
  scene.objects.push_back(
      block("short_block", {{130, 165, 65}, {82, 165, 225}, {240, 165, 272}, {290, 165, 114}}, white));
  scene.objects.push_back(
      block("tall_block", {{423, 330, 247}, {265, 330, 296}, {314, 330, 456}, {472, 330, 406}}, white));
  Object lamp{"lamp", {0.278, 0.5488, 0.2795}, {}};
  append(lamp, {{343, 548.8, 227}, {343, 548.8, 332}, {213, 548.8, 332}, {213, 548.8, 227}}, light);
  scene.objects.push_back(std::move(lamp));
  // 35 mm focal length, 25 mm film
  scene.camera = {{0.278, 0.273, -0.8}, {0.278, 0.273, 0.0}, 2.0 * std::atan(12.5 / 35.0), 1.0};
  return scene;
}

}  // namespace radiosity::test_scenes
