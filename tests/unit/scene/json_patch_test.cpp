#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/scene/json_patch.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(JsonPatch, agreesWithEveryEnabledCaseOfTheCommonSuite) {
  const std::filesystem::path folder = std::filesystem::path(RADIOSITY_SHARED_DIR) / "suites/json-patch-tests";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no shared suites here";
  std::size_t run = 0;
  for (const auto* file : {"tests.json", "spec_tests.json"}) {
    std::ifstream in(folder / file);
    const auto cases = Json::parse(in);
    for (const auto& test : cases) {
      if (!test.contains("patch") || test.value("disabled", false)) continue;
      ++run;
      const auto result = applyJsonPatch(test["doc"], test["patch"]);
      if (test.contains("error")) {
        EXPECT_FALSE(result) << test.dump();
      } else {
        ASSERT_TRUE(result) << test.dump() << result.error().text();
        if (test.contains("expected")) {
          EXPECT_EQ(*result, test["expected"]) << test.dump();
        }
      }
    }
  }
  EXPECT_GT(run, 90U);
}

TEST(JsonPatch, addThroughAScalarParentIsAnErrorNotAnAbort) {
  const auto result = applyJsonPatch(Json{{"a", 1}}, R"([{"op":"add","path":"/a/b","value":2}])"_json);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, StartsWith("operation 0: "));
  EXPECT_EQ(result.error().where, "/a/b");
}

TEST(JsonPatch, removeThroughAScalarParentIsAnErrorNotIgnored) {
  EXPECT_FALSE(applyJsonPatch(Json{{"a", 1}}, R"([{"op":"remove","path":"/a/b"}])"_json));
}

TEST(JsonPatch, anErrorNamesItsOperationAndLeavesTheInputAlone) {
  const Json before = {{"a", 1}};
  const auto result =
      applyJsonPatch(before, R"([{"op":"replace","path":"/a","value":2},{"op":"test","path":"/a","value":3}])"_json);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kTestFailed);
  EXPECT_THAT(result.error().message, StartsWith("operation 1: "));
  EXPECT_EQ(before, (Json{{"a", 1}}));
}

TEST(JsonPatch, namesFindTheOneElementWithThatName) {
  const auto doc = R"({"nodes":[{"name":"floor"},{"name":"lamp/1","x":1},{"name":"twin"},{"name":"twin"}]})"_json;
  const auto moved = applyJsonPatch(doc, R"([{"op":"replace","path":"/nodes/@lamp~11/x","value":5}])"_json);
  ASSERT_TRUE(moved) << moved.error().text();
  EXPECT_EQ((*moved)["nodes"][1]["x"], 5);
  const auto absent = applyJsonPatch(doc, R"([{"op":"test","path":"/nodes/@nobody","value":1}])"_json);
  ASSERT_FALSE(absent);
  EXPECT_THAT(absent.error().message, HasSubstr("nothing is named 'nobody'"));
  const auto twice = applyJsonPatch(doc, R"([{"op":"test","path":"/nodes/@twin","value":1}])"_json);
  ASSERT_FALSE(twice);
  EXPECT_THAT(twice.error().message, HasSubstr("more than one"));
}

TEST(JsonPatch, malformedOperationsAreRefused) {
  for (const auto* patch :
       {"{}", "1", "[1]", "[{}]", R"([{"op":"add"}])", R"([{"op":1,"path":""}])", R"([{"op":"add","path":"/a"}])",
        R"([{"op":"add","path":"a","value":1}])", R"([{"op":"add","path":"/~2","value":1}])",
        R"([{"op":"spin","path":"/a"}])", R"([{"op":"move","path":"/a"}])",
        R"([{"op":"copy","from":"/no","path":"/a"}])", R"([{"op":"add","path":"/l/3","value":1}])",
        R"([{"op":"add","path":"/l/01","value":1}])", R"([{"op":"add","path":"/l/99999999999999999999","value":1}])",
        R"([{"op":"remove","path":"/l/-"}])", R"([{"op":"move","from":"/o","path":"/o/in"}])"}) {
    EXPECT_FALSE(applyJsonPatch(R"({"l":[1,2],"o":{}})"_json, Json::parse(patch))) << patch;
  }
}

TEST(JsonPatch, operationsDepthAndGrowthAreBounded) {
  Json many = Json::array();
  for (int i = 0; i < 1001; ++i) many.push_back({{"op", "add"}, {"path", "/a"}, {"value", 1}});
  EXPECT_EQ(applyJsonPatch(Json::object(), many).error().code, ErrorCode::kTooLarge);
  // Each copy doubles the document: 2^1000 without a bound.
  Json doubling = Json::array();
  for (int i = 0; i < 60; ++i) doubling.push_back({{"op", "copy"}, {"from", "/a"}, {"path", "/a/-"}});
  EXPECT_EQ(applyJsonPatch(R"({"a":[1]})"_json, doubling).error().code, ErrorCode::kTooLarge);
  Json deep = 1;
  for (int i = 0; i < 70; ++i) deep = Json::array({deep});
  EXPECT_EQ(
      applyJsonPatch(Json::object(), Json::array({{{"op", "add"}, {"path", "/a"}, {"value", deep}}})).error().code,
      ErrorCode::kTooLarge);
}

class ScenePatch : public testing::Test {
 protected:
  ScenePatch() {
    builder_.gltf["materials"] = Json::array({{{"name", "white"}}, {{"name", "red"}}});
    builder_.node({{"name", "wall"}, {"mesh", builder_.square()}});
    builder_.node({{"name", "lamp"}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1}}});
    document_ = builder_.document().value();
  }
  test::GltfBuilder builder_;
  Document document_;
};

TEST_F(ScenePatch, findsMembersThatTheFileLeftOut) {
  const auto patched = applyPatch(document_, R"([
    {"op":"test","path":"/nodes/@lamp/translation","value":[4,5,6]},
    {"op":"replace","path":"/nodes/@lamp/scale","value":[2,2,2]},
    {"op":"replace","path":"/materials/@red/pbrMetallicRoughness/baseColorFactor","value":[1,0,0,1]},
    {"op":"replace","path":"/materials/1/extensions/KHR_materials_emissive_strength/emissiveStrength","value":7},
    {"op":"replace","path":"/materials/1/emissiveFactor","value":[1,1,1]}])"_json);
  ASSERT_TRUE(patched) << patched.error().text();
  const auto scene = importScene(*patched);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->materials[1].emission, glm::vec3(7.0F));
  EXPECT_EQ(scene->materials[1].base_color, glm::vec3(1.0F, 0.0F, 0.0F));
}

TEST_F(ScenePatch, whatIsAppendedGetsDefaultsToo) {
  const auto once = applyPatch(document_, R"([{"op":"add","path":"/nodes/-","value":{"name":"new","mesh":0}}])"_json);
  ASSERT_TRUE(once) << once.error().text();
  const auto twice = applyPatch(*once, R"([{"op":"replace","path":"/nodes/@new/translation","value":[0,1,0]}])"_json);
  ASSERT_TRUE(twice) << twice.error().text();
  EXPECT_EQ(importScene(*twice)->instances.size(), 2U);
}

TEST_F(ScenePatch, indicesAndBytesKeepTheirMeaning) {
  for (const auto* patch :
       {R"([{"op":"remove","path":"/nodes/0"}])", R"([{"op":"add","path":"/nodes/0","value":{}}])",
        R"([{"op":"replace","path":"/nodes","value":[]}])", R"([{"op":"remove","path":"/materials"}])",
        R"([{"op":"move","from":"/nodes/0","path":"/nodes/1"}])", R"([{"op":"replace","path":"","value":{}}])",
        R"([{"op":"replace","path":"/buffers/0/byteLength","value":9}])",
        R"([{"op":"add","path":"/images","value":[]}])",
        R"([{"op":"replace","path":"/bufferViews/0/byteOffset","value":4}])"}) {
    const auto patched = applyPatch(document_, Json::parse(patch));
    ASSERT_FALSE(patched) << patch;
    EXPECT_THAT(patched.error().message, StartsWith("operation 0: "));
  }
}

TEST_F(ScenePatch, aSceneThatBecameInvalidIsRefusedWithItsPlace) {
  const auto patched = applyPatch(document_, R"([{"op":"replace","path":"/nodes/0/mesh","value":7}])"_json);
  ASSERT_TRUE(patched);
  const auto scene = importScene(*patched);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::kInvalidScene);
  EXPECT_EQ(scene.error().where, "test.glb: /nodes/0/mesh");
}

}  // namespace
}  // namespace radiosity::scene
