// Lights with a size or a web, as files have them: EXT_lights_area, EXT_lights_ies, extras.radiosityRadius.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/unit/scene/expect_refused.h"
#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/imported.h"

namespace radiosity::scene {
namespace {

using test::expectRefused;
using test::GltfBuilder;
using test::imported;
using testing::Contains;
using testing::HasSubstr;
using Json = nlohmann::json;

constexpr const char* kIes =
    "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 2 1 2 0 0 0 1 1 10\n0 45 90\n0 180\n100 80 0\n100 60 0\n";
constexpr const char* kIesData =
    "data:application/"
    "x-ies-lm-63,IESNA%3ALM-63-2002%0ATILT%3DNONE%0A1%20-1%201%203%202%201%202%200%200%200%201%201%2010"
    "%0A0%2045%2090%0A0%20180%0A100%2080%200%0A100%2060%200%0A";

GltfBuilder withArea(const Json& light, Json node = Json::object()) {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"EXT_lights_area"};
  builder.gltf["extensions"]["EXT_lights_area"]["lights"] = Json::array({light});
  node["extensions"]["EXT_lights_area"]["light"] = 0;
  builder.node(std::move(node));
  return builder;
}

GltfBuilder withIes(const Json& light, Json on_node = Json::object()) {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"EXT_lights_ies"};
  builder.gltf["extensions"]["EXT_lights_ies"]["lights"] = Json::array({light});
  on_node["light"] = 0;
  builder.node({{"translation", {1, 2, 3}}, {"extensions", {{"EXT_lights_ies", on_node}}}});
  return builder;
}

GltfBuilder withPoint(const Json& extras, const std::string& type = "point") {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"KHR_lights_punctual"};
  Json light{{"type", type}, {"extras", extras}};
  if (type == "spot") light["spot"] = Json::object();
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({light});
  builder.node({{"scale", {5, 5, 5}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return builder;
}

TEST(AreaLights, growWithTheLargestScaleOfTheirNodeAndShineAlongItsNegativeZ) {
  const Json light{
      {"type", "rect"}, {"size", 2}, {"rect", {{"aspect", 3}}}, {"intensity", 500}, {"color", {1, 0.5, 0}}};
  // A quarter turn about X: -Z becomes -Y.
  const double half = std::sqrt(0.5);
  const auto scene = imported(
      withArea(light, {{"scale", {0.25, -0.5, 0.1}}, {"rotation", {-half, 0, 0, half}}, {"translation", {1, 2, 3}}}));
  ASSERT_EQ(scene.lights.size(), 1U);
  const auto& lamp = scene.lights[0];
  EXPECT_EQ(lamp.kind, LightKind::kRectangle);
  EXPECT_NEAR(lamp.half.y, 0.5, 1e-12);  // 2 m x 0.5 / 2
  EXPECT_NEAR(lamp.half.x, 1.5, 1e-12);
  EXPECT_EQ(lamp.position, glm::dvec3(1, 2, 3));
  EXPECT_NEAR(glm::distance(lamp.direction, glm::dvec3(0, -1, 0)), 0.0, 1e-12);
  EXPECT_NEAR(std::abs(lamp.across.x), 1.0, 1e-12);
  EXPECT_EQ(lamp.intensity, glm::vec3(500, 250, 0));
}

TEST(AreaLights, haveTheDefaultsOfTheExtension) {
  const auto scene = imported(withArea({{"type", "disk"}}));
  ASSERT_EQ(scene.lights.size(), 1U);
  EXPECT_EQ(scene.lights[0].kind, LightKind::kDisc);
  EXPECT_EQ(scene.lights[0].half.x, 0.5) << "size is the diameter";
  EXPECT_EQ(scene.lights[0].intensity, glm::vec3(1000.0F));
  const auto document = withArea({{"type", "rect"}}).document();
  ASSERT_TRUE(document);
  const auto& light = document->gltf["extensions"]["EXT_lights_area"]["lights"][0];
  EXPECT_EQ(light["intensity"], 1000.0);
  EXPECT_EQ(light["size"], 1.0);
  EXPECT_EQ(light["rect"]["aspect"], 1.0);
}

TEST(AreaLights, thatAreWrongAreNamed) {
  const std::string lights = "/extensions/EXT_lights_area/lights/0";
  const auto refused = [](const Json& light, const std::string& where, const std::string& what) {
    expectRefused(withArea(light), ErrorCode::kInvalidScene, where, what);
  };
  refused({{"type", "sphere"}}, lights + "/type", "rect, disk");
  refused({{"size", 1}}, lights, "'type' is missing");
  refused({{"type", "rect"}, {"size", -1}}, lights + "/size", "out of range");
  refused({{"type", "rect"}, {"size", 1e30}}, lights + "/size", "out of range");
  refused({{"type", "rect"}, {"intensity", -1}}, lights + "/intensity", "out of range");
  refused({{"type", "rect"}, {"intensity", 1e38}, {"color", {10, 10, 10}}}, lights + "/intensity", "too bright");
  refused({{"type", "rect"}, {"size", 1e6}, {"rect", {{"aspect", 1e6}}}}, "/nodes/0", "larger than 1000 km");
  auto none = withArea({{"type", "rect"}});
  none.gltf["nodes"][0]["extensions"]["EXT_lights_area"]["light"] = 1;
  expectRefused(none, ErrorCode::kInvalidScene, "/nodes/0/extensions/EXT_lights_area/light", "has 1 entries");
}

TEST(AreaLights, withoutAreaSendNothingAndSaySo) {
  const auto scene = imported(withArea({{"type", "rect"}, {"size", 0}}));
  EXPECT_TRUE(scene.lights.empty());
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("has no area")));
}

TEST(LightRadius, makesABallOfAPointLightWhateverItsNodesScale) {
  EXPECT_EQ(imported(withPoint({{"radiosityRadius", 0.25}})).lights.at(0).half.x, 0.25);
  EXPECT_EQ(imported(withPoint({{"radiosityRadius", 0.25}}, "spot")).lights.at(0).half.x, 0.25);
  EXPECT_EQ(imported(withPoint(Json::object())).lights.at(0).half.x, 0.0);
  const auto sun = imported(withPoint({{"radiosityRadius", 0.25}}, "directional"));
  EXPECT_EQ(sun.lights.at(0).half.x, 0.0);
  EXPECT_THAT(sun.warnings, Contains(HasSubstr("means nothing to a directional light")));
  const std::string where = "/extensions/KHR_lights_punctual/lights/0/extras/radiosityRadius";
  for (const Json& wrong : {Json(-1), Json("big"), Json(1e9), Json(nullptr)})
    expectRefused(withPoint({{"radiosityRadius", wrong}}), ErrorCode::kInvalidScene, where, "metres in [0, 1e6]");
}

TEST(IesLights, comeFromDataUrisAndStayInTheDocumentAsBufferViews) {
  const auto builder = withIes({{"uri", kIesData}}, {{"multiplier", 2}, {"color", {1, 0.5, 0}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.lights.size(), 1U);
  const auto& lamp = scene.lights[0];
  EXPECT_EQ(lamp.kind, LightKind::kWeb);
  EXPECT_EQ(lamp.intensity, glm::vec3(2, 1, 0));
  EXPECT_EQ(lamp.direction, glm::dvec3(0, 0, -1));
  EXPECT_EQ(lamp.across, glm::dvec3(1, 0, 0));
  EXPECT_FLOAT_EQ(webCandela(lamp.web->table, 45, 0), 80);
  const auto document = builder.document();
  ASSERT_TRUE(document);
  const auto& light = document->gltf["extensions"]["EXT_lights_ies"]["lights"][0];
  EXPECT_FALSE(light.contains("uri"));
  const auto again = parseDocument("again.glb", *writeGlb(*document));
  ASSERT_TRUE(again) << again.error().text();
  const auto twin = importScene(*again);
  ASSERT_TRUE(twin) << twin.error().text();
  EXPECT_EQ(twin->lights, scene.lights);
}

TEST(IesLights, lieBesideTheirFile) {
  const auto folder = std::filesystem::temp_directory_path() / "radiosity-ies-test";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "lamp.ies") << kIes;
  auto gltf = withIes({{"uri", "lamp.ies"}}).gltf;
  std::ofstream(folder / "room.gltf") << gltf.dump();
  const auto document = loadDocument(folder / "room.gltf");
  ASSERT_TRUE(document) << document.error().text();
  const auto scene = importScene(*document);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->lights.size(), 1U);
  gltf["extensions"]["EXT_lights_ies"]["lights"][0]["uri"] = "../lamp.ies";
  std::ofstream(folder / "room.gltf") << gltf.dump();
  EXPECT_FALSE(loadDocument(folder / "room.gltf")) << "nothing above the folder is read";
  std::filesystem::remove_all(folder);
}

TEST(IesLights, thatAreWrongAreNamedWithTheLineOfTheirFile) {
  const std::string light = "/extensions/EXT_lights_ies/lights/0";
  expectRefused(withIes({{"uri", "data:,IES%0ATILT%3DNONE%0A1%20-1%201%201000000000"}}), ErrorCode::kInvalidScene,
                light, "line 3: number of vertical angles");
  expectRefused(withIes({{"uri", "data:,IES%0ATILT%3Dother.tlt"}}), ErrorCode::kUnsupported, light, "line 2: TILT");
  expectRefused(withIes(Json::object()), ErrorCode::kInvalidScene, light, "bufferView or a data URI");
  expectRefused(withIes({{"bufferView", 3}}), ErrorCode::kInvalidScene, light + "/bufferView", "has 0 entries");
  expectRefused(withIes({{"uri", kIesData}, {"mimeType", "text/plain"}}), ErrorCode::kInvalidScene, light + "/mimeType",
                "application/x-ies-lm-63");
  expectRefused(withIes({{"uri", kIesData}}, {{"multiplier", -1}}), ErrorCode::kInvalidScene,
                "/nodes/0/extensions/EXT_lights_ies/multiplier", "out of range");
}

TEST(IesLights, areReadOnceHoweverManyEditsComeAfter) {
  auto parsed = withIes({{"uri", kIesData}}).document();
  ASSERT_TRUE(parsed);
  const auto first = importEdited(std::move(*parsed), nullptr);
  ASSERT_TRUE(first) << first.error().text();
  const Json patch = Json::array({{{"op", "replace"}, {"path", "/nodes/0/translation"}, {"value", {0, 1, 0}}}});
  const auto second = editDocument(first->document, patch);
  ASSERT_TRUE(second) << second.error().text();
  ASSERT_EQ(second->scene.lights.size(), 1U);
  EXPECT_EQ(second->scene.lights[0].web.shared(), first->scene.lights[0].web.shared());
  const Json stronger =
      Json::array({{{"op", "replace"}, {"path", "/nodes/0/extensions/EXT_lights_ies/multiplier"}, {"value", 3}}});
  const auto third = editDocument(second->document, stronger);
  ASSERT_TRUE(third) << third.error().text();
  EXPECT_EQ(third->scene.lights[0].intensity, glm::vec3(3.0F));
}

TEST(IesLights, mayBeAppendedByAPatchWithADataUri) {
  const auto parsed = withIes({{"uri", kIesData}}).document();
  ASSERT_TRUE(parsed);
  const Json patch =
      Json::array({{{"op", "add"}, {"path", "/extensions/EXT_lights_ies/lights/-"}, {"value", {{"uri", kIesData}}}},
                   {{"op", "replace"}, {"path", "/nodes/0/extensions/EXT_lights_ies/light"}, {"value", 1}}});
  const auto edited = editDocument(*parsed, patch);
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->scene.lights.size(), 1U);
}

}  // namespace
}  // namespace radiosity::scene
