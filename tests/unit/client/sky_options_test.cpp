// Options that name skies: what they come to, which go together, and edits of a scene's sky.
#include "client/cli/sky_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::cli {
namespace {

using testing::HasSubstr;

std::string refusal(const SkyOptions& options) {
  const auto choice = skyChoice(options);
  EXPECT_FALSE(choice);
  return choice ? "" : choice.error().text();
}

TEST(SkyOptions, NameASunByTimeAndPlace) {
  SkyOptions options;
  for (const auto* sun : {"2026-06-21T12:00+02:00@48.1,-11.6", "2026-06-21T12:00+02:00@+48.1, -11.6"}) {
    options.sun = sun;
    const auto choice = skyChoice(options);
    ASSERT_TRUE(choice) << choice.error().text();
    EXPECT_EQ(choice->sky, Json::parse(R"({"daylight": {"time": "2026-06-21T12:00+02:00", "latitude": 48.1,
                                           "longitude": -11.6}})"));
  }
  options.sky = "clear";
  options.sun_angle = 0.0;
  options.turbidity = 4.0;
  options.rotation = 90.0;
  const auto choice = skyChoice(options);
  ASSERT_TRUE(choice) << choice.error().text();
  EXPECT_EQ(choice->sky["rotation"], 90.0);
  EXPECT_EQ(choice->sky["daylight"]["sky"], "clear");
  EXPECT_EQ(choice->sky["daylight"]["sunAngle"], 0.0);
  EXPECT_EQ(choice->sky["daylight"]["turbidity"], 4.0);
  for (const auto* wrong : {"noon", "2026-06-21T12:00Z", "2026-06-21T12:00Z@1", "2026-06-21T12:00Z@1,x",
                            "2026-06-21T12:00Z@,1", "2026-06-21T12:00Z@++1,1"}) {
    options.sun = wrong;
    EXPECT_THAT(refusal(options), HasSubstr(wrong));
  }
}

TEST(SkyOptions, ThatDoNotGoTogetherAreRefused) {
  SkyOptions options;
  options.rotation = 10.0;
  EXPECT_THAT(refusal(options), HasSubstr("--sky-rotation"));
  options = {};
  options.sun_angle = 1.0;
  EXPECT_THAT(refusal(options), HasSubstr("--sun-angle"));
  options = {};
  options.sky = "1000";
  options.sun = "2026-06-21T12:00Z@1,1";
  EXPECT_THAT(refusal(options), HasSubstr("--sun"));
  options = {};
  options.sky = "sunny";
  EXPECT_THAT(refusal(options), HasSubstr("is no file, no model"));
  options.sky = "1000";
  const auto colours = skyChoice(options);
  ASSERT_TRUE(colours);
  EXPECT_FALSE(colours->isOfScene());
  EXPECT_TRUE(colours->colours);
}

TEST(SkyOptions, TurnTheSkyThatIsThere) {
  SkyOptions options;
  options.rotation = 30.0;
  options.strength = 2.0;
  const auto patch = skyTurnPatch(Json::parse(R"({"extras": {"radiositySky": {"bufferView": 3}}})"), options);
  ASSERT_TRUE(patch);
  EXPECT_EQ(*patch, Json::parse(R"([{"op": "add", "path": "/extras/radiositySky/rotation", "value": 30.0},
                                    {"op": "add", "path": "/extras/radiositySky/strength", "value": 2.0}])"));
  for (const auto* none : {"{}", R"({"extras": 1})", R"({"extras": {"radiositySky": {"upper": [1, 1, 1]}}})"}) {
    const auto refused = skyTurnPatch(Json::parse(none), options);
    ASSERT_FALSE(refused) << none;
    EXPECT_THAT(refused.error().text(), HasSubstr("no picture or daylight"));
  }
}

TEST(SkyOptions, PutASkyInTheScenesPlace) {
  SkyOptions options;
  options.sky = "overcast";
  const auto choice = skyChoice(options);
  ASSERT_TRUE(choice);
  const auto edit = skyPatch(Json::parse(R"({"bufferViews": [{}]})"), *choice, "/uploads/a", 99);
  EXPECT_EQ(edit, Json::parse(R"([{"op": "add", "path": "/buffers", "value": []},
    {"op": "add", "path": "/buffers/-", "value": {"uri": "/uploads/a", "byteLength": 99}},
    {"op": "add", "path": "/bufferViews/-", "value": {"buffer": 0, "byteLength": 99}},
    {"op": "add", "path": "/extras", "value": {}},
    {"op": "add", "path": "/extras/radiositySky", "value": {"daylight": {"sky": "overcast"}, "bufferView": 1}}])"));
}

// A file of JSON gets the picture as a data URI; what else it has in extras stays.
TEST(SkyOptions, PutAPictureIntoAFile) {
  const TemporaryFolder folder;
  const auto scene = folder.write("scene.gltf", R"({"asset": {"version": "2.0"}, "extras": {"mine": 1}})");
  SkyOptions options;
  options.sky = folder.write("sky.hdr", "abc");
  options.strength = 3.0;
  const auto choice = skyChoice(options);
  ASSERT_TRUE(choice) << choice.error().text();
  const auto made = withSky(scene, *choice);
  ASSERT_TRUE(made) << made.error().text();
  EXPECT_FALSE(made->is_glb);
  EXPECT_EQ(Json::parse(made->bytes)["extras"], Json::parse(R"({"mine": 1, "radiositySky": {"strength": 3.0,
                            "uri": "data:application/octet-stream;base64,YWJj"}})"));
}

}  // namespace
}  // namespace radiosity::cli
