// Photometric files of all types and symmetries shine where their coordinates say: each is written from one smooth
// function of the direction, by the conventions as client/README.md has them, and read back through a turned node.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "server/scene/document/document.h"
#include "server/solver/lamps/lamp_of_light.h"
#include "server/solver/math/sampling.h"
#include "server/solver/transport/lamp_shape.h"

namespace radiosity::solver {
namespace {

using Json = nlohmann::json;
using Intensity = std::function<double(const glm::dvec3&)>;
using Direction = std::function<glm::dvec3(double, double)>;

constexpr double kDegree = std::numbers::pi / 180.0;
/// Between angles 5 degrees apart the functions below, of 150 cd and less, are off a straight line by less.
constexpr double kBetween = 0.5;

const glm::dvec3 kX(1, 0, 0), kY(0, 1, 0), kZ(0, 0, 1);

/// In the lamp's space, of which -Z is where both angles are 0; degrees.
glm::dvec3 ofTypeC(double horizontal, double vertical) {
  const double h = kDegree * horizontal, v = kDegree * vertical;
  return std::sin(v) * (std::cos(h) * kX + std::sin(h) * kY) - std::cos(v) * kZ;
}
/// The polar axis is horizontal: planes of one vertical angle turn about Y.
glm::dvec3 ofTypeB(double horizontal, double vertical) {
  const double h = kDegree * horizontal, v = kDegree * vertical;
  return std::cos(h) * (std::sin(v) * kX - std::cos(v) * kZ) - std::sin(h) * kY;
}
/// The polar axis is vertical: planes of one horizontal angle turn about X, which is up where -Z is horizontal.
glm::dvec3 ofTypeA(double horizontal, double vertical) {
  const double h = kDegree * horizontal, v = kDegree * vertical;
  return std::cos(v) * (-std::cos(h) * kZ - std::sin(h) * kY) + std::sin(v) * kX;
}

double lopsided(const glm::dvec3& d) { return 100.0 + 20.0 * d.x + 10.0 * d.y - 5.0 * d.z + 15.0 * d.x * d.y; }

std::vector<double> fromTo(double first, double last) {
  std::vector<double> angles;
  for (double angle = first; angle <= last; angle += 5.0) angles.push_back(angle);
  return angles;
}

struct Angles {
  std::vector<double> horizontal, vertical;
};

std::string iesFile(int type, const Angles& angles, const Direction& direction, const Intensity& intensity) {
  std::ostringstream out;
  out << "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 " << angles.vertical.size() << " " << angles.horizontal.size() << " "
      << type << " 2 0 0 0 1 1 10\n";
  for (const double v : angles.vertical) out << v << "\n";
  for (const double h : angles.horizontal) out << h << "\n";
  for (const double h : angles.horizontal)
    for (const double v : angles.vertical) out << intensity(direction(h, v)) << "\n";
  return out.str();
}

/// `planes`: those whose intensities are written; all 72 are listed.
std::string eulumdatFile(int symmetry, const std::vector<double>& planes, const Intensity& intensity) {
  std::ostringstream out;
  out << "maker\n1\n" << symmetry << "\n72\n5\n37\n5\n";
  for (int i = 0; i < 14; ++i) out << "0\n";
  out << "100\n0\n1\n0\n1\n1\nLED\n1000\n3000\n80\n10\n";
  for (int i = 0; i < 10; ++i) out << "0\n";
  for (const double plane : fromTo(0, 355)) out << plane << "\n";
  for (const double gamma : fromTo(0, 180)) out << gamma << "\n";
  for (const double plane : planes)
    for (const double gamma : fromTo(0, 180)) out << intensity(ofTypeC(plane, gamma)) << "\n";
  return out.str();
}

std::string dataUri(const std::string& text) {
  std::string uri = "data:application/x-ies-lm-63,";
  for (const char c : text) uri += c == '\n' ? "%0A" : c == ' ' ? "%20" : c == '=' ? "%3D" : std::string(1, c);
  return uri;
}

/// Largest difference from the function over directions, of those with d.z at most `most_z`.
double worst(const std::string& file, const Intensity& intensity, double most_z = 1.0) {
  const auto turn = glm::normalize(glm::dquat(0.5, 0.3, -0.4, 0.7));
  Json gltf{{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"extensionsUsed", {"EXT_lights_ies"}}};
  gltf["scenes"] = Json::array({{{"nodes", {0}}}});
  gltf["nodes"] = Json::array({{{"rotation", {turn.x, turn.y, turn.z, turn.w}}}});
  gltf["nodes"][0]["extensions"]["EXT_lights_ies"]["light"] = 0;
  gltf["extensions"]["EXT_lights_ies"]["lights"] = Json::array({{{"uri", dataUri(file)}}});
  const auto text = gltf.dump();
  const auto document =
      scene::parseDocument("lamp.gltf", {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  EXPECT_TRUE(document) << document.error().text();
  const auto scene = document ? scene::importScene(*document) : tl::unexpected<Error>(document.error());
  EXPECT_TRUE(scene) << scene.error().text();
  if (!scene || scene->lights.size() != 1) return 1e9;
  const auto& light = scene->lights[0];
  const Lamp lamp{lampShape({}, light, {}), light.web->table};
  double most = 0.0;
  for (std::uint32_t i = 0; i < 4096; ++i) {
    const auto at = sobol4(i, 7);
    const double z = 1.0 - 2.0 * at.x, r = std::sqrt(1.0 - z * z), angle = 360.0 * kDegree * at.y;
    const glm::dvec3 d(r * std::cos(angle), r * std::sin(angle), z);
    if (d.z > most_z) continue;
    most = std::max(most, std::abs(static_cast<double>(lamp.strength(glm::vec3(turn * d))) - intensity(d)));
  }
  return most;
}

TEST(WebAxes, TypeCTurnsFromXTowardsY) {
  EXPECT_LT(worst(iesFile(1, {fromTo(0, 360), fromTo(0, 180)}, ofTypeC, lopsided), lopsided), kBetween);
  EXPECT_GT(worst(iesFile(1, {fromTo(0, 360), fromTo(0, 180)}, ofTypeB, lopsided), lopsided), 10.0 * kBetween);
}

TEST(WebAxes, TypeBHasAHorizontalPolarAxisAndRunsClockwise) {
  EXPECT_LT(worst(iesFile(2, {fromTo(-90, 90), fromTo(-90, 90)}, ofTypeB, lopsided), lopsided, 0.0), kBetween);
}

TEST(WebAxes, TypeAHasAVerticalPolarAxisAndRunsClockwise) {
  EXPECT_LT(worst(iesFile(3, {fromTo(-90, 90), fromTo(-90, 90)}, ofTypeA, lopsided), lopsided, 0.0), kBetween);
}

TEST(WebAxes, TypesAAndBThatBeginAt0AreSymmetricAboutTheVerticalPlane) {
  const Intensity even = [](const glm::dvec3& d) { return 100.0 + 20.0 * d.x + 30.0 * d.y * d.y; };
  const Angles half{fromTo(0, 90), fromTo(-90, 90)};
  EXPECT_LT(worst(iesFile(2, half, ofTypeB, even), even, 0.0), kBetween);
  EXPECT_LT(worst(iesFile(3, half, ofTypeA, even), even, 0.0), kBetween);
}

TEST(WebAxes, EulumdatShinesAsItsSymmetrySays) {
  const Intensity round = [](const glm::dvec3& d) { return 100.0 + 30.0 * d.z; };
  const Intensity even_y = [](const glm::dvec3& d) { return 100.0 + 20.0 * d.x + 30.0 * d.y * d.y; };
  const Intensity even_x = [](const glm::dvec3& d) { return 100.0 + 20.0 * d.y + 30.0 * d.x * d.x; };
  const Intensity both = [](const glm::dvec3& d) { return 100.0 + 20.0 * d.z + 30.0 * d.x * d.x; };
  auto from_270 = fromTo(270, 355);
  for (const double plane : fromTo(0, 90)) from_270.push_back(plane);
  EXPECT_LT(worst(eulumdatFile(0, fromTo(0, 355), lopsided), lopsided), kBetween);
  EXPECT_LT(worst(eulumdatFile(1, {0.0}, round), round), kBetween);
  EXPECT_LT(worst(eulumdatFile(2, fromTo(0, 180), even_y), even_y), kBetween);
  EXPECT_LT(worst(eulumdatFile(3, from_270, even_x), even_x), kBetween);
  EXPECT_LT(worst(eulumdatFile(4, fromTo(0, 90), both), both), kBetween);
}

}  // namespace
}  // namespace radiosity::solver
