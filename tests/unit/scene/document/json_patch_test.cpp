#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "server/scene/document/json_patch.h"
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

TEST(JsonPatch, aMoveIntoItselfIsSeenThroughNames) {
  const auto doc = R"({"l":[{"name":"a","in":{}}],"o":{"p":1}})"_json;
  EXPECT_FALSE(applyJsonPatch(doc, R"([{"op":"move","from":"/l/@a","path":"/l/0/in"}])"_json));
  EXPECT_FALSE(applyJsonPatch(doc, R"([{"op":"move","from":"/l/0","path":"/l/@a/in"}])"_json));
  EXPECT_EQ(applyJsonPatch(doc, R"([{"op":"move","from":"/l/@a","path":"/l/0"}])"_json).value(), doc);
  EXPECT_EQ(applyJsonPatch(doc, R"([{"op":"move","from":"","path":""}])"_json).value(), doc);
  const auto moved = applyJsonPatch(doc, R"([{"op":"move","from":"/l/@a","path":"/m"}])"_json);
  ASSERT_TRUE(moved) << moved.error().text();
  EXPECT_EQ((*moved)["m"], doc["l"][0]);
  EXPECT_EQ((*moved)["l"].size(), doc["l"].size() - 1);
  // A name that only begins like another is another.
  EXPECT_EQ(applyJsonPatch(R"({"a":1})"_json, R"([{"op":"move","from":"/a","path":"/ab"}])"_json).value(),
            (Json{{"ab", 1}}));
}

TEST(JsonPatch, theTouchedPathsAreTheResolvedOnes) {
  std::vector<Tokens> touched;
  const auto doc = R"({"l":[{"name":"a","x":1}]})"_json;
  const auto result = applyJsonPatch(
      doc, R"([{"op":"test","path":"/l/@a/x","value":1},{"op":"copy","from":"/l/0","path":"/l/-"}])"_json, {},
      &touched);
  ASSERT_TRUE(result);
  EXPECT_EQ(touched, (std::vector<Tokens>{{"l", "0", "x"}, {"l", "1"}}));
}

TEST(JsonPatch, aDifferenceLeadsFromOneValueToTheOther) {
  const auto shapes = {R"({})",
                       R"({"a":1,"b/~":{"c":[1,2,3]}})",
                       R"({"a":1.5,"b/~":{"c":[1,2]}})",
                       R"({"n":[{"t":[0,0,0]},{"t":[1,1,1],"x":"y"}]})",
                       R"({"n":[{"t":[0,5,0]}]})",
                       R"({"n":[{"t":[0,5,0]},{},{"z":[{"q":1}]}],"a":null})",
                       R"({"n":[]})",
                       R"({"n":{"0":1}})"};
  for (const auto* from : shapes) {
    for (const auto* to : shapes) {
      const auto before = Json::parse(from), after = Json::parse(to);
      const auto patch = diffJson(before, after);
      const auto result = applyJsonPatch(before, patch);
      ASSERT_TRUE(result) << from << " to " << to << ": " << patch << result.error().text();
      EXPECT_EQ(*result, after) << patch;
      if (before == after) {
        EXPECT_TRUE(patch.empty());
      }
    }
  }
  EXPECT_EQ(diffJson(Json::parse(R"({"n":[{"t":[0,0,0]}]})"), Json::parse(R"({"n":[{"t":[0,5,0]}]})")),
            R"([{"op":"replace","path":"/n/0/t","value":[0,5,0]}])"_json);
}

TEST(JsonPatch, operationsDepthAndGrowthAreBounded) {
  Json many = Json::array();
  for (int i = 0; i < 5001; ++i) many.push_back({{"op", "add"}, {"path", "/a"}, {"value", 1}});
  EXPECT_EQ(applyJsonPatch(Json::object(), many).error().code, ErrorCode::kTooLarge);
  many.erase(many.size() - 1);
  EXPECT_TRUE(applyJsonPatch(Json::object(), many));
  // Names are looked for among all elements.
  Json named = {{"nodes", Json::array()}};
  for (int i = 0; i < 20'000; ++i) named["nodes"].push_back({{"name", std::to_string(i)}});
  for (auto& operation : many) operation = {{"op", "replace"}, {"path", "/nodes/@7/name"}, {"value", "7"}};
  const auto searched = applyJsonPatch(named, many);
  ASSERT_FALSE(searched);
  EXPECT_EQ(searched.error().code, ErrorCode::kTooLarge);
  EXPECT_NE(searched.error().text().find("names"), std::string::npos) << searched.error().text();
  // What is added before a long array moves all of it.
  Json numbers = {{"a", std::vector<int>(100'000)}};
  for (auto& operation : many) operation = {{"op", "add"}, {"path", "/a/0"}, {"value", 1}};
  const auto moved = applyJsonPatch(numbers, many);
  ASSERT_FALSE(moved);
  EXPECT_EQ(moved.error().code, ErrorCode::kTooLarge);
  for (auto& operation : many) operation = {{"op", "remove"}, {"path", "/a/0"}};
  EXPECT_FALSE(applyJsonPatch(numbers, many));
  for (auto& operation : many) operation = {{"op", "add"}, {"path", "/a/-"}, {"value", 1}};
  EXPECT_TRUE(applyJsonPatch(numbers, many));
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
  const auto once = applyPatch(document_, R"([{"op":"add","path":"/nodes/-","value":{"name":"new","mesh":0}},
                                              {"op":"add","path":"/scenes/0/nodes/-","value":2}])"_json);
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
        R"([{"op":"replace","path":"/buffers/0","value":{"byteLength":9}}])",
        R"([{"op":"remove","path":"/buffers/0"}])",
        R"([{"op":"replace","path":"/bufferViews/0/byteOffset","value":4}])"}) {
    const auto patched = applyPatch(document_, Json::parse(patch));
    ASSERT_FALSE(patched) << patch;
    EXPECT_THAT(patched.error().message, StartsWith("operation 0: "));
  }
}

TEST_F(ScenePatch, vectorsAreReplacedWhole) {
  for (const auto* patch : {R"([{"op":"replace","path":"/nodes/@lamp/translation/1","value":2}])",
                            R"([{"op":"add","path":"/nodes/@lamp/scale/-","value":2}])",
                            R"([{"op":"remove","path":"/materials/0/emissiveFactor/0"}])",
                            R"([{"op":"move","from":"/nodes/1/scale/0","path":"/nodes/1/name"}])"}) {
    const auto patched = applyPatch(document_, Json::parse(patch));
    ASSERT_FALSE(patched) << patch;
    EXPECT_THAT(patched.error().message, HasSubstr("a vector is replaced whole: /")) << patch;
  }
  EXPECT_TRUE(applyPatch(document_, R"([{"op":"test","path":"/nodes/@lamp/translation/1","value":5}])"_json));
}

TEST_F(ScenePatch, aNodeIsDetachedFromTheScenesThatTheFileLeftOut) {
  ASSERT_EQ(document_.gltf["scenes"], R"([{"nodes":[0,1]}])"_json);
  const auto edited = editDocument(document_, R"([{"op":"replace","path":"/scenes/0/nodes","value":[1]}])"_json);
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_TRUE(edited->scene.instances.empty());
  const auto hidden = editDocument(
      document_,
      R"([{"op":"replace","path":"/nodes/@wall/extensions/KHR_node_visibility/visible","value":false}])"_json);
  ASSERT_TRUE(hidden) << hidden.error().text();
  EXPECT_FALSE(hidden->scene.instances.at(0).visible);
}

TEST_F(ScenePatch, texelsOfOneNodeAndAllBelowItAreScaled) {
  const auto patch = R"([{"op":"add","path":"/nodes/@wall/children","value":[1]},
                         {"op":"replace","path":"/scenes/0/nodes","value":[0]},
                         {"op":"add","path":"/nodes/1/mesh","value":0},
                         {"op":"add","path":"/nodes/@wall/extras","value":{"radiosityTexelScale":2}}])"_json;
  const auto edited = editDocument(document_, patch);
  ASSERT_TRUE(edited) << edited.error().text();
  ASSERT_EQ(edited->scene.instances.size(), 2U);
  for (const auto& instance : edited->scene.instances) EXPECT_EQ(instance.texel_scale, 2.0F);
  for (const auto* value : {"0", "-1", "\"fine\"", "65", "null"}) {
    const auto refused =
        editDocument(document_, Json::parse(R"([{"op":"add","path":"/nodes/0/extras","value":{"radiosityTexelScale":)" +
                                            std::string(value) + "}}]"));
    ASSERT_FALSE(refused) << value;
    EXPECT_EQ(refused.error().where, "/nodes/0/extras/radiosityTexelScale");
  }
}

TEST_F(ScenePatch, aFaultOfTheSceneNamesTheOperationThatMadeIt) {
  const auto fault = [&](const char* patch) {
    const auto edited = editDocument(document_, Json::parse(patch));
    EXPECT_FALSE(edited) << patch;
    return edited ? Error{} : edited.error();
  };
  const auto mesh = fault(R"([{"op":"replace","path":"/nodes/@lamp/name","value":"x"},
                              {"op":"replace","path":"/nodes/@wall/mesh","value":7},
                              {"op":"replace","path":"/nodes/@wall/scale","value":[1,1,1]}])");
  EXPECT_EQ(mesh.operation, 1U);
  EXPECT_EQ(mesh.where, "/nodes/0/mesh");
  const auto cycle = fault(R"([{"op":"add","path":"/nodes/0/children","value":[1]},
                               {"op":"add","path":"/nodes/1/children","value":[0]},
                               {"op":"replace","path":"/scenes/0/nodes","value":[]}])");
  EXPECT_THAT(cycle.message, HasSubstr("cycle"));
  EXPECT_TRUE(cycle.operation == 0U || cycle.operation == 1U);
  EXPECT_EQ(fault(R"([{"op":"replace","path":"/nodes/1/rotation","value":[0,0,0,0]}])").operation, 0U);
}

/// What of an edited document is taken from the one before must be what importing it would find.
TEST_F(ScenePatch, aChainOfEditsImportsAsEachDocumentWouldByItself) {
  auto now = document_;
  for (const auto* patch :
       {R"([{"op":"replace","path":"/materials/0/emissiveFactor","value":[0.5,1,2]}])",
        R"([{"op":"replace","path":"/nodes/@wall/translation","value":[1,2,3]}])",
        R"([{"op":"add","path":"/materials/-","value":{"name":"new"}}])",
        R"([{"op":"add","path":"/meshes/0/primitives/0/material","value":1}])",
        R"([{"op":"add","path":"/nodes/-","value":{"name":"more","mesh":0,"scale":[2,2,2]}},
            {"op":"add","path":"/scenes/0/nodes/-","value":2}])",
        R"([{"op":"replace","path":"/nodes/@wall/extensions/KHR_node_visibility/visible","value":false}])",
        R"([{"op":"add","path":"/extensions","value":{"KHR_lights_punctual":{"lights":[{"type":"point"}]}}},
            {"op":"add","path":"/nodes/@lamp/extensions/KHR_lights_punctual","value":{"light":0}}])",
        R"([{"op":"remove","path":"/nodes/@more/mesh"}])",
        R"([{"op":"replace","path":"/materials/0/alphaMode","value":"BLEND"}])",
        R"([{"op":"add","path":"/extras","value":{"radiositySky":{"upper":[1,2,3]}}}])",
        R"([{"op":"replace","path":"/materials/0/pbrMetallicRoughness/metallicFactor","value":1},
            {"op":"add","path":"/materials/1/extensions/KHR_materials_unlit","value":{}},
            {"op":"replace","path":"/materials/1/emissiveFactor","value":[0,0,7]}])",
        R"([{"op":"remove","path":"/materials/1/extensions/KHR_materials_unlit"}])",
        R"([{"op":"remove","path":"/meshes/0/primitives/0/material"}])",
        R"([{"op":"replace","path":"/materials/0/emissiveFactor","value":[0,1,0]}])",
        R"([{"op":"add","path":"/materials/0/emissiveTexture","value":{"index":0}}])",
        R"([{"op":"add","path":"/materials/1/extensions/KHR_materials_pbrSpecularGlossiness",
             "value":{"specularFactor":[0.25,0,0]}}])",
        R"([{"op":"test","path":"/materials/0/emissiveFactor","value":[0,1,0]}])"}) {
    const auto edited = editDocument(now, Json::parse(patch));
    ASSERT_TRUE(edited) << patch << edited.error().text();
    ASSERT_TRUE(edited->document.imported);
    now = edited->document;
    auto alone = now;
    alone.imported.reset();
    const auto fresh = importScene(alone);
    ASSERT_TRUE(fresh) << patch;
    EXPECT_EQ(edited->scene.materials, fresh->materials) << patch;
    EXPECT_EQ(edited->scene.primitives, fresh->primitives) << patch;
    EXPECT_EQ(edited->scene.instances, fresh->instances) << patch;
    EXPECT_EQ(edited->scene.lights, fresh->lights) << patch;
    EXPECT_EQ(edited->scene.sky, fresh->sky) << patch;
    EXPECT_EQ(edited->scene.warnings, fresh->warnings) << patch;
  }
  for (const auto& [patch, where] :
       {std::pair{R"([{"op":"replace","path":"/nodes/0/mesh","value":9}])", "/nodes/0/mesh"},
        std::pair{R"([{"op":"replace","path":"/nodes/0/mesh","value":0.0}])", "/nodes/0/mesh"},
        std::pair{R"([{"op":"replace","path":"/accessors/0/count","value":3.0},
                      {"op":"replace","path":"/materials/0/emissiveFactor","value":[0,0,0]}])",
                  "/accessors/0/count"},
        std::pair{R"([{"op":"replace","path":"/materials/1/alphaMode","value":"GLASS"}])", "/materials/1/alphaMode"},
        std::pair{R"([{"op":"replace","path":"/materials/0/emissiveFactor","value":[]}])",
                  "/materials/0/emissiveFactor"}}) {
    const auto refused = editDocument(now, Json::parse(patch));
    ASSERT_FALSE(refused) << patch;
    EXPECT_EQ(refused.error().where, where);
  }
}

/// PNG of 2 x 1 pixels: red, then blue.
constexpr std::array<std::uint8_t, 72> kRedAndBluePng = {
    0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x7B, 0x40, 0xE8, 0xDD, 0x00, 0x00, 0x00,
    0x0F, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9C, 0x63, 0xF8, 0xCF, 0xC0, 0xC0, 0xC0, 0xF0, 0x1F, 0x00, 0x07, 0x00,
    0x01, 0xFF, 0x52, 0xB3, 0x73, 0x8B, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};

/// Nor is a mesh read, or an image decoded, for an edit of a material.
TEST_F(ScenePatch, whatAnEditLeavesAloneIsSharedWithTheSceneBefore) {
  auto textured = document_;
  textured.gltf["images"] = Json::array({{{"mimeType", "image/png"}}});
  textured.images = {std::make_shared<const Bytes>(kRedAndBluePng.begin(), kRedAndBluePng.end())};
  textured.gltf["textures"] = Json::array({{{"source", 0}}});
  auto& surface = textured.gltf["materials"][0]["pbrMetallicRoughness"];
  surface["baseColorTexture"] = surface["metallicRoughnessTexture"] = {{"index", 0}};
  const auto before = importEdited(textured, nullptr);
  ASSERT_TRUE(before) << before.error().text();
  ASSERT_EQ(before->scene.textures.size(), 2U);  // one as colours, one as numbers
  const auto editOf = [](const EditedDocument& from, const char* patch) {
    return editDocument(from.document, Json::parse(patch)).value();
  };

  const auto lit = editOf(*before, R"([{"op":"replace","path":"/materials/0/emissiveFactor","value":[1,0,0]}])");
  EXPECT_EQ(lit.scene.textures.element(0), before->scene.textures.element(0));
  EXPECT_EQ(lit.scene.primitives.element(0), before->scene.primitives.element(0));
  EXPECT_EQ(lit.scene.textures.element(1), before->scene.textures.element(1));
  EXPECT_EQ(lit.scene.materials[0].metallic_texture, before->scene.materials[0].metallic_texture);
  const auto moved = editOf(lit, R"([{"op":"replace","path":"/nodes/@wall/translation","value":[1,2,3]}])");
  EXPECT_EQ(moved.scene.textures.element(0), before->scene.textures.element(0));

  const auto bare = editOf(moved, R"([{"op":"remove","path":"/materials/0/pbrMetallicRoughness/baseColorTexture"}])");
  ASSERT_EQ(bare.scene.textures.size(), 1U);
  EXPECT_EQ(bare.scene.textures.element(0), before->scene.textures.element(1));
  const auto again =
      editOf(bare, R"([{"op":"add","path":"/materials/0/pbrMetallicRoughness/baseColorTexture","value":{"index":0}}])");
  EXPECT_EQ(again.scene.textures, before->scene.textures);

  ImportLimits small;
  small.max_image_pixels = 0;
  const auto refused = editDocument(
      lit.document, R"([{"op":"replace","path":"/materials/0/emissiveFactor","value":[0,0,0]}])"_json, {}, small);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooLarge);
}

Json accessorPatch(const std::string& uri) {
  // A triangle: three positions of 12 bytes.
  return Json::parse(R"([{"op":"add","path":"/buffers/-","value":{"uri":")" + uri + R"("}},
    {"op":"add","path":"/bufferViews/-","value":{"buffer":1,"byteLength":36}},
    {"op":"add","path":"/accessors/-","value":{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"}},
    {"op":"add","path":"/meshes/-","value":{"primitives":[{"attributes":{"POSITION":2}}]}},
    {"op":"replace","path":"/nodes/@wall/mesh","value":1}])");
}

TEST_F(ScenePatch, anUploadBecomesAMesh) {
  const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 0, 2, 0};
  Bytes bytes(36);
  std::memcpy(bytes.data(), corners.data(), bytes.size());
  const auto upload = std::make_shared<const Bytes>(bytes);
  const auto find = [&](const std::string& uri) { return uri == "/uploads/abc" ? upload : nullptr; };
  const auto edited = editDocument(document_, accessorPatch("/uploads/abc"), find);
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->scene.primitives.at(0).positions.at(2), glm::dvec3(0, 2, 0));
  EXPECT_EQ(edited->document.buffers.at(1), upload);  // shared, not copied
  EXPECT_EQ(edited->document.gltf["buffers"][1], (Json{{"byteLength", 36}}));
  const auto again = parseDocument("again.glb", writeGlb(edited->document).value());
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(importScene(*again)->primitives, edited->scene.primitives);

  const auto gone = editDocument(document_, accessorPatch("/uploads/abd"), find);
  ASSERT_FALSE(gone);
  EXPECT_EQ(gone.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(gone.error().operation, 0U);
  EXPECT_EQ(gone.error().where, "/buffers/1/uri");
  EXPECT_TRUE(editDocument(document_, accessorPatch("data:;base64," + std::string(48, 'A')), {}));
  for (const auto* uri : {"data:;base64,AAAA", "http://x/y.bin", "../x.bin", ""})
    EXPECT_FALSE(editDocument(document_, accessorPatch(uri), find)) << uri;
}

TEST_F(ScenePatch, appendedBytesAreCheckedAndBounded) {
  const auto upload = std::make_shared<const Bytes>(Bytes(100));
  const auto find = [&](const std::string&) { return upload; };
  for (const auto* value : {R"(5)", R"({})", R"({"uri":7})", R"({"uri":"/uploads/a","byteLength":101})",
                            R"({"uri":"/uploads/a","byteLength":-1})", R"({"uri":"/uploads/a","byteLength":"x"})"}) {
    const auto patch = Json::parse(R"([{"op":"add","path":"/buffers/-","value":)" + std::string(value) + "}]");
    const auto edited = editDocument(document_, patch, find);
    ASSERT_FALSE(edited) << value;
    EXPECT_THAT(edited.error().where, StartsWith("/buffers/1")) << value;
  }
  for (const auto* value : {R"({"bufferView":0,"uri":"/uploads/a"})", R"({"bufferView":99})", R"({})", R"(7)"}) {
    const auto patch = Json::parse(R"([{"op":"add","path":"/images","value":[)" + std::string(value) + "]}]");
    const auto edited = editDocument(document_, patch, find);
    ASSERT_FALSE(edited) << value;
    EXPECT_THAT(edited.error().where, StartsWith("/images/0")) << value;
  }
  ImportLimits limits;
  limits.max_file_bytes = 250;
  const auto patch = R"([{"op":"add","path":"/buffers/-","value":{"uri":"/uploads/a"}},
                         {"op":"add","path":"/buffers/-","value":{"uri":"/uploads/a"}},
                         {"op":"add","path":"/buffers/-","value":{"uri":"/uploads/a"}}])"_json;
  EXPECT_EQ(editDocument(document_, patch, find, limits).error().code, ErrorCode::kTooLarge);
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
