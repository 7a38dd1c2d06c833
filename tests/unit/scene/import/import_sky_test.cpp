// The sky of a document: colours, pictures, daylight and extensions, what edits keep of them, and what is refused
// where.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/scene/document/png.h"
#include "server/scene/values/daylight.h"
#include "tests/unit/scene/expect_refused.h"
#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/imported.h"

namespace radiosity::scene {
namespace {

using std::numbers::pi;
using test::dataUri;
using test::expectRefused;
using test::GltfBuilder;
using test::imported;
using test::Json;
using testing::HasSubstr;

GltfBuilder withSky(const Json& sky) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  if (!sky.is_null()) builder.gltf["extras"]["radiositySky"] = sky;
  return builder;
}

/// Two columns, one row: 1 towards -Z and 2 towards +Z.
const std::string kHdr =
    "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n" + std::string("\x80\x80\x80\x81\x80\x80\x80\x82", 8);

TEST(ImportSky, ColoursAreAsTheyWere) {
  const auto sky = imported(withSky({{"upper", {1, 2, 3}}})).sky;
  ASSERT_TRUE(sky);
  EXPECT_EQ(sky->lower, glm::vec3(1, 2, 3));
  EXPECT_FALSE(sky->picture);
  EXPECT_FALSE(imported(withSky(nullptr)).sky);
  const auto bad = [](const Json& json, const char* member, const char* what) {
    expectRefused(withSky(json), ErrorCode::kInvalidScene, std::string("/extras/radiositySky") + member, what);
  };
  bad(7, "", "must be an object");
  bad(Json::object(), "", "upper, bufferView, uri or daylight");
  bad({{"upper", {1, 2}}}, "/upper", "three numbers");
  bad({{"upper", {1, 2, 3}}, {"lower", {1, -2, 3}}}, "/lower", "three numbers");
  bad({{"upper", {1, 2, 3}}, {"strength", -1}}, "/strength", "must be a number from 0 to 1000000000");
  bad({{"upper", {1, 2, 3}}, {"rotation", "north"}}, "/rotation", "must be a number");
}

TEST(ImportSky, PicturesBecomeABufferView) {
  const auto builder = withSky({{"uri", dataUri(kHdr)}, {"strength", 3}, {"rotation", 90}, {"upper", {1, 1, 1}}});
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto& json = document->gltf["extras"]["radiositySky"];
  EXPECT_FALSE(json.contains("uri"));
  ASSERT_TRUE(json.contains("bufferView"));
  const auto again = parseDocument("again.glb", *writeGlb(*document));
  ASSERT_TRUE(again) << again.error().text();
  const auto saved = importScene(*again, {});
  ASSERT_TRUE(saved) << saved.error().text();
  const auto sky = imported(builder).sky;
  ASSERT_TRUE(sky && sky->picture);
  EXPECT_EQ(saved->sky, sky);
  EXPECT_EQ(sky->strength, 3.0F);
  EXPECT_DOUBLE_EQ(sky->turn_rad, 0.5 * pi);
  EXPECT_EQ(sky->upper, glm::vec3(1.0F));
  EXPECT_EQ(sky->picture->image().texels[1], glm::vec3(2.0F));
}

TEST(ImportSky, OfPicturesTellsWhatIsWrong) {
  const auto bad = [](const Json& json, ErrorCode code, const char* member, const char* what) {
    expectRefused(withSky(json), code, std::string("/extras/radiositySky") + member, what);
  };
  bad({{"bufferView", 99}}, ErrorCode::kInvalidScene, "/bufferView", "is no buffer view");
  bad({{"bufferView", "a"}}, ErrorCode::kInvalidScene, "/bufferView", "is no buffer view");
  bad({{"bufferView", 0}}, ErrorCode::kUnsupported, "/bufferView", "neither a Radiance HDR nor");
  bad({{"uri", dataUri(kHdr.substr(0, 50))}}, ErrorCode::kInvalidScene, "/bufferView", "");
  bad({{"uri", dataUri(kHdr)}, {"daylight", Json::object()}}, ErrorCode::kInvalidScene, "", "not both");
  const auto file = withSky({{"uri", "sky.hdr"}}).document();
  ASSERT_FALSE(file);
  EXPECT_THAT(file.error().text(), HasSubstr("/extras/radiositySky/uri: refers to a file"));
}

TEST(ImportSky, EditsOfOtherThingsKeepThePicture) {
  auto document = withSky({{"uri", dataUri(kHdr)}}).document();
  ASSERT_TRUE(document);
  auto first = importEdited(std::move(*document), nullptr, {}, {});
  ASSERT_TRUE(first) << first.error().text();
  const auto turned = editDocument(first->document, Json::parse(R"([
    {"op": "add", "path": "/extras/radiositySky/rotation", "value": 30},
    {"op": "replace", "path": "/nodes/0/translation", "value": [1, 0, 0]}])"));
  ASSERT_TRUE(turned) << turned.error().text();
  EXPECT_EQ(&*turned->scene.sky->picture, &*first->scene.sky->picture) << "it is not read again";
  EXPECT_NE(turned->scene.sky, first->scene.sky);
  const auto wrong = editDocument(
      first->document, Json::parse(R"([{"op": "add", "path": "/extras/radiositySky/strength", "value": "much"}])"));
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().text(), HasSubstr("/extras/radiositySky/strength"));
}

TEST(ImportSky, DaylightIsASkyAndASun) {
  const auto sky =
      imported(withSky({{"daylight", {{"time", "2026-06-21T12:00+02:00"}, {"latitude", 48.1}, {"longitude", 11.6}}},
                        {"rotation", 90}}))
          .sky;
  ASSERT_TRUE(sky && sky->picture && sky->sun);
  EXPECT_NEAR(sky->sun->diameter_rad, kSunDegrees * pi / 180.0, 1e-9);
  EXPECT_NEAR(std::asin(sky->sun->direction.y) * 180.0 / pi, 61.0, 1.5) << "an hour before it is highest";
  EXPECT_NEAR(sky->sun->direction.x, 0.38, 0.03) << "what it had towards the south is towards the east";
  EXPECT_NEAR(static_cast<double>(sky->sun->illuminance.x), 90'000.0, 15'000.0);
  const auto cie = imported(withSky({{"daylight", {{"sky", "overcast"}, {"diffuse", 1000}, {"ground", 0.5}}}})).sky;
  ASSERT_TRUE(cie && cie->picture);
  EXPECT_FALSE(cie->sun);
  EXPECT_NEAR(static_cast<double>(cie->picture->image().texels[0].x), 1000.0 * 9.0 / 7.0 / pi, 0.5);
  EXPECT_NEAR(static_cast<double>(cie->picture->image().texels.back().x), 500.0 / pi, 0.01);
  const auto night = imported(withSky({{"daylight", {{"altitude", -5}}}}));
  ASSERT_TRUE(night.sky);
  EXPECT_FALSE(night.sky->sun);
  EXPECT_THAT(night.warnings, testing::Contains(HasSubstr("below the horizon")));
}

TEST(ImportSky, OfDaylightTellsWhatIsWrong) {
  const auto bad = [](const Json& daylight, const char* member, const char* what) {
    expectRefused(withSky({{"daylight", daylight}}), ErrorCode::kInvalidScene,
                  std::string("/extras/radiositySky/daylight") + member, what);
  };
  bad(1, "", "must be an object");
  bad({{"sky", "sunny"}}, "/sky", "clear, intermediate, overcast, perez");
  bad({{"sky", 17}}, "/sky", "from 1 to 16");
  bad({{"time", "noon"}}, "/time", "2026-06-21T12:00+02:00");
  bad({{"time", "2026-06-21T12:00+02:00"}, {"latitude", 1}}, "", "latitude and longitude");
  bad({{"latitude", 91}}, "/latitude", "from -90 to 90");
  bad({{"turbidity", 0}}, "/turbidity", "from 1 to 12");
  bad({{"ground", 2}}, "/ground", "from 0 to 1");
  bad({{"direct", 3000}}, "/direct", "from 0 to 2000");
  bad({{"sun", "yes"}}, "/sun", "true or false");
  bad({{"sunAngle", 100}}, "/sunAngle", "from 0 to 90");
}

/// Six images of one colour each, 4 x 4: R, G, B and alpha.
GltfBuilder imageBased(const std::vector<std::array<std::uint8_t, 4>>& colours) {
  auto builder = withSky(nullptr);
  Json faces = Json::array();
  for (const auto& colour : colours) {
    std::vector<std::uint8_t> pixels;
    for (int i = 0; i < 16; ++i) pixels.insert(pixels.end(), colour.begin(), colour.end());
    const auto png = encodePng(4, 4, 4, pixels);
    faces.push_back(faces.size());
    builder.gltf["images"].push_back({{"uri", dataUri({png.begin(), png.end()})}});
  }
  Json coefficients = Json::array();
  for (int i = 0; i < 9; ++i) coefficients.push_back({i == 0 ? 1 : 0, i == 0 ? 2 : 0, 0});
  builder.gltf["extensionsUsed"] = {"EXT_lights_image_based"};
  builder.gltf["extensions"]["EXT_lights_image_based"]["lights"] = {{{"intensity", 10},
                                                                     {"irradianceCoefficients", coefficients},
                                                                     {"specularImageSize", 4},
                                                                     {"specularImages", {faces}}}};
  builder.gltf["scenes"] = {{{"nodes", {0}}, {"extensions", {{"EXT_lights_image_based", {{"light", 0}}}}}}};
  builder.gltf["scene"] = 0;
  return builder;
}

TEST(ImportEnvironment, ReadsACubeOfImages) {
  const std::vector<std::array<std::uint8_t, 4>> colours{{255, 0, 0, 255},    {0, 255, 0, 255},  {0, 0, 255, 255},
                                                         {128, 128, 128, 51}, {255, 255, 0, 51}, {128, 128, 128, 255}};
  auto builder = imageBased(colours);
  const auto scene = imported(builder);
  ASSERT_TRUE(scene.sky && scene.sky->picture);
  const auto seen = [](const Scene& in, const glm::dvec3& d) { return glm::dvec3(in.sky->picture->radiance(d)); };
  EXPECT_LT(glm::distance(seen(scene, {1, 0, 0}), glm::dvec3(10, 0, 0)), 0.01);
  EXPECT_LT(glm::distance(seen(scene, {-1, 0, 0}), glm::dvec3(0, 10, 0)), 0.01);
  EXPECT_LT(glm::distance(seen(scene, {0, 1, 0}), glm::dvec3(0, 0, 10)), 0.01);
  const double half = 10.0 * std::pow(128.0 / 255.0, 2.2);
  EXPECT_LT(glm::distance(seen(scene, {0, -1, 0}), glm::dvec3(5.0 * half)), 0.01) << "divided by alpha";
  EXPECT_LT(glm::distance(seen(scene, {0, 0, 1}), glm::dvec3(50, 50, 0)), 0.1);
  EXPECT_LT(glm::distance(seen(scene, {0, 0, -1}), glm::dvec3(2.1586)), 0.01) << "encoded as sRGB";
  for (const auto& warning : scene.warnings) EXPECT_THAT(warning, testing::Not(HasSubstr("is ignored")));
  auto& light = builder.gltf["extensions"]["EXT_lights_image_based"]["lights"][0];
  light["rotation"] = {0.0, std::sqrt(0.5), 0.0, std::sqrt(0.5)};  // a quarter, from +Z towards +X
  EXPECT_LT(glm::distance(seen(imported(builder), {1, 0, 0}), glm::dvec3(50, 50, 0)), 0.1);
  builder.gltf["extras"]["radiositySky"] = {{"upper", {1, 1, 1}}};
  EXPECT_FALSE(imported(builder).sky->picture) << "ours goes first";
}

TEST(ImportEnvironment, TellsWhatIsWrong) {
  const std::vector<std::array<std::uint8_t, 4>> grey(6, {9, 9, 9, 255});
  const std::string light = "/extensions/EXT_lights_image_based/lights/0";
  auto builder = imageBased(grey);
  auto& json = builder.gltf["extensions"]["EXT_lights_image_based"]["lights"][0];
  json["specularImages"][0][3] = 77;
  expectRefused(builder, ErrorCode::kInvalidScene, light + "/specularImages/0/3", "is no image");
  json["specularImages"][0].erase(3);
  expectRefused(builder, ErrorCode::kInvalidScene, light + "/specularImages/0", "six images");
  json["rotation"] = {0, 0, 0, 0};
  expectRefused(builder, ErrorCode::kInvalidScene, light + "/rotation", "quaternion");
  json["intensity"] = -1;
  expectRefused(builder, ErrorCode::kInvalidScene, light + "/intensity", "not negative");
  builder.gltf["scenes"][0]["extensions"]["EXT_lights_image_based"]["light"] = 1;
  expectRefused(builder, ErrorCode::kInvalidScene, "/scenes/0/extensions/EXT_lights_image_based/light",
                "must point into");
}

/// KTX 2.0, one level: faces of 2 x 2 texels of 32-bit floats whose red is the number of the face.
std::string ktx(std::uint32_t format) {
  std::string bytes("\xABKTX 20\xBB\r\n\x1A\n", 12);
  const auto word = [&](std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFFU);
  };
  for (const std::uint32_t value : {format, 4U, 2U, 2U, 0U, 0U, 6U, 1U, 0U}) word(value, 4);
  for (int i = 0; i < 4; ++i) word(0, 4);
  for (int i = 0; i < 2; ++i) word(0, 8);
  const std::uint64_t length = 6 * 4 * 12;
  word(bytes.size() + 24, 8);
  word(length, 8);
  word(length, 8);
  for (int f = 0; f < 6; ++f) {
    for (int i = 0; i < 4; ++i) {
      const std::array<float, 3> rgb{static_cast<float>(f), 1.0F, 0.5F};
      bytes.append(reinterpret_cast<const char*>(rgb.data()), 12);
    }
  }
  return bytes;
}

TEST(ImportEnvironment, ReadsACubeOfKtx) {
  auto builder = withSky(nullptr);
  builder.gltf["extensionsUsed"] = {"KHR_environment_map"};
  builder.gltf["images"] = {{{"uri", dataUri(ktx(106))}, {"mimeType", "image/ktx2"}}};
  builder.gltf["extensions"]["KHR_environment_map"] = {{"cubemaps", {{{"source", 0}, {"layer", 0}, {"intensity", 2}}}},
                                                       {"environment_maps", {{{"cubemap", 0}}}}};
  builder.gltf["scenes"] = {{{"nodes", {0}}, {"extensions", {{"KHR_environment_map", {{"environment_map", 0}}}}}}};
  builder.gltf["scene"] = 0;
  const auto sky = imported(builder).sky;
  ASSERT_TRUE(sky && sky->picture);
  EXPECT_NEAR(sky->picture->radiance({0, 0, 1}).x, 8.0F, 1e-3F);
  EXPECT_NEAR(sky->picture->radiance({0, 1, 0}).x, 4.0F, 1e-3F);
  EXPECT_NEAR(sky->picture->radiance({0, 1, 0}).z, 1.0F, 1e-3F);
  // One that cannot be read is left out, or stood in for by its irradiance; one that is required is refused.
  builder.gltf["images"][0]["uri"] = dataUri(ktx(145));
  const auto dark = imported(builder);
  EXPECT_FALSE(dark.sky && dark.sky->picture);
  EXPECT_THAT(dark.warnings, testing::Contains(HasSubstr("no sky by it: its format (145)")));
  builder.gltf["extensionsRequired"] = {"KHR_environment_map"};
  expectRefused(builder, ErrorCode::kUnsupported, "/extensions/KHR_environment_map/cubemaps/0", "format (145)");
  // Irradiance under 1 nit is pi: all of it is in the first coefficient, times 2 sqrt(pi). The cubemap doubles it.
  Json coefficients = Json::array();
  for (int i = 0; i < 9; ++i) coefficients.push_back({i == 0 ? pi * 2.0 * std::sqrt(pi) : 0.0, 0, 0});
  builder.gltf["extensions"]["KHR_environment_map"]["environment_maps"][0]["irradianceCoefficients"] = coefficients;
  const auto even = imported(builder);
  EXPECT_NEAR(even.sky->picture->image().texels[100].x, 2.0F, 1e-3F);
  EXPECT_THAT(even.warnings, testing::Contains(HasSubstr("its irradiance is used")));
  auto cut = ktx(106);
  cut.pop_back();
  builder.gltf["images"][0]["uri"] = dataUri(cut);
  expectRefused(builder, ErrorCode::kInvalidScene, "/extensions/KHR_environment_map/cubemaps/0", "ends before");
}

// Six pictures in which every texel tells its face, column and row.
TEST(ImportEnvironment, HasItsFacesAsTheExtensionSaysTheyLie) {
  auto builder = imageBased(std::vector<std::array<std::uint8_t, 4>>(6, {0, 0, 0, 255}));
  for (std::size_t f = 0; f < 6; ++f) {
    std::vector<std::uint8_t> pixels;
    for (int i = 0; i < 16; ++i)
      for (const int value : {i % 4 < 2 ? 255 : 0, i / 4 < 2 ? 255 : 0, 255, 255})
        pixels.push_back(static_cast<std::uint8_t>(value));
    const auto png = encodePng(4, 4, 4, pixels);
    builder.gltf["images"][f]["uri"] = dataUri({png.begin(), png.end()});
  }
  const auto sky = imported(builder).sky;
  ASSERT_TRUE(sky && sky->picture);
  // Seen from within, a face has its left at the right of its picture: red is the right half there, green the upper.
  struct Face {
    glm::dvec3 to, right, up;
  };
  const glm::dvec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  for (const auto& [to, right, up] : {Face{x, -z, y}, {-x, z, y}, {y, x, -z}, {-y, x, z}, {z, x, y}, {-z, -x, y}}) {
    for (const double across : {-0.5, 0.5}) {
      for (const double along : {-0.5, 0.5}) {
        const auto seen = sky->picture->radiance(glm::normalize(to + across * right + along * up));
        // Interpolated between texels that are a quarter of a face wide.
        EXPECT_NEAR(seen.x, across > 0.0 ? 10.0F : 0.0F, 1.5F) << to.x << to.y << to.z;
        EXPECT_NEAR(seen.y, along > 0.0 ? 10.0F : 0.0F, 1.5F) << to.x << to.y << to.z;
      }
    }
  }
}

TEST(ImportLights, ADirectionalLightMayHaveAnAngle) {
  auto builder = withSky(nullptr);
  builder.gltf["extensionsUsed"] = {"KHR_lights_punctual"};
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "directional"}, {"extras", {{"radiosityAngle", 0.5}}}}};
  builder.node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const auto scene = imported(builder);
  ASSERT_EQ(scene.lights.size(), 1U);
  EXPECT_NEAR(scene.lights[0].half.x, 0.25 * pi / 180.0, 1e-12);
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"][0]["extras"]["radiosityAngle"] = 120;
  expectRefused(builder, ErrorCode::kInvalidScene, "/extensions/KHR_lights_punctual/lights/0/extras/radiosityAngle",
                "degrees");
}

}  // namespace
}  // namespace radiosity::scene
