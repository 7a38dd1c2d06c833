#include "client/engines/baked_nodes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/engines/gltf_json.h"

namespace radiosity::engines {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// Nodes, those that the scene has as its roots, and two punctual lights.
Json sceneOf(const char* nodes, const char* roots) {
  Json gltf = Json::parse(R"({"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3.0},
      {"type": "spot"}]}}, "extensionsUsed": ["KHR_lights_punctual", "KHR_node_visibility"]})");
  gltf["nodes"] = Json::parse(nodes);
  gltf["scenes"] = Json::array({{{"nodes", Json::parse(roots)}}});
  return gltf;
}

TEST(BakedNodes, keepWhatALampWas) {
  Json gltf = sceneOf(R"([{"name": "a", "extensions": {"KHR_lights_punctual": {"light": 0}}}])", "[0]");
  EXPECT_THAT(takeLightsOut(gltf), ElementsAre("a"));
  trimExtensionLists(gltf);
  EXPECT_EQ(gltf["nodes"],
            Json::parse(R"([{"name": "a", "extras": {"bakedLight": {"type": "point", "intensity": 3.0}}}])"));
  EXPECT_FALSE(gltf.contains("extensions"));
  EXPECT_FALSE(gltf.contains("extensionsUsed"));
}

TEST(BakedNodes, keepWhatTheNodeSaysOfItsPhotometricFile) {
  Json gltf = Json::parse(R"({"scenes": [{"nodes": [0]}], "nodes": [{"extensions": {"EXT_lights_ies":
      {"light": 0, "multiplier": 2.0, "color": [1, 0, 0]}}}], "extensions": {"EXT_lights_ies": {"lights": [{"uri": "a.ies"}]}}})");
  EXPECT_THAT(takeLightsOut(gltf), ElementsAre("node 0"));
  EXPECT_EQ(gltf["nodes"][0]["extras"]["bakedLight"],
            Json::parse(R"({"uri": "a.ies", "multiplier": 2.0, "color": [1, 0, 0]})"));
}

TEST(BakedNodes, lampsOfOneNameAreTwo) {
  Json gltf = sceneOf(R"([{"name": "a", "extensions": {"KHR_lights_punctual": {"light": 0}}},
      {"name": "a", "extensions": {"KHR_lights_punctual": {"light": 1}}}])",
                      "[0, 1]");
  EXPECT_THAT(takeLightsOut(gltf), ElementsAre("a", "a"));
}

TEST(BakedNodes, hiddenLampsAndThoseOfOtherScenesGoUnnamed) {
  Json gltf = sceneOf(R"([{"extensions": {"KHR_node_visibility": {"visible": false}}, "children": [1]},
      {"name": "hidden", "extensions": {"KHR_lights_punctual": {"light": 0}}},
      {"name": "elsewhere", "extensions": {"KHR_lights_punctual": {"light": 0}}},
      {"children": [4]}, {"name": "lit", "extensions": {"KHR_lights_punctual": {"light": 1}}}])",
                      "[0, 3]");
  takeHiddenOut(gltf);
  EXPECT_THAT(takeLightsOut(gltf), ElementsAre("lit"));
  trimExtensionLists(gltf);
  EXPECT_EQ(gltf["nodes"], Json::parse(R"([{"children": [1]}, {"name": "hidden"}, {"name": "elsewhere"},
      {"children": [4]}, {"name": "lit", "extras": {"bakedLight": {"type": "spot"}}}])"));
  EXPECT_FALSE(gltf.contains("extensionsUsed"));
}

TEST(BakedNodes, withoutScenesEveryNodeIsLit) {
  Json gltf = sceneOf(R"([{"name": "a", "extensions": {"KHR_lights_punctual": {"light": 0}}}])", "[0]");
  gltf.erase("scenes");
  EXPECT_THAT(takeLightsOut(gltf), ElementsAre("a"));
}

TEST(BakedNodes, whatMovesHiddenMeshesGoesWithThem) {
  Json gltf = sceneOf(R"([{"mesh": 0, "weights": [0.5], "extensions": {"KHR_node_visibility": {"visible": false}}},
      {"mesh": 0}])",
                      "[0, 1]");
  gltf["animations"] = Json::parse(R"([
      {"channels": [{"target": {"node": 0, "path": "weights"}}]},
      {"channels": [{"target": {"node": 0, "path": "weights"}}, {"target": {"node": 0, "path": "translation"}},
                    {"target": {"node": 1, "path": "weights"}}]}])");
  takeHiddenOut(gltf);
  takeDeadChannelsOut(gltf);
  EXPECT_EQ(gltf["nodes"], Json::parse(R"([{}, {"mesh": 0}])"));
  EXPECT_EQ(gltf["animations"], Json::parse(R"([{"channels": [{"target": {"node": 0, "path": "translation"}},
      {"target": {"node": 1, "path": "weights"}}]}])"));
}

TEST(BakedNodes, whatDimsABakedLampGoesWithIt) {
  Json gltf = sceneOf(R"([{"extensions": {"KHR_lights_punctual": {"light": 0}}}])", "[0]");
  gltf["extensionsUsed"].push_back("KHR_animation_pointer");
  const Json channel = Json::parse(R"({"target": {"path": "pointer", "extensions": {"KHR_animation_pointer":
      {"pointer": "/extensions/KHR_lights_punctual/lights/0/intensity"}}}})");
  gltf["animations"] = Json::array({{{"channels", Json::array({channel})}}});
  takeDeadChannelsOut(gltf);
  EXPECT_TRUE(gltf.contains("animations")) << "the lamp is there still";
  (void)takeLightsOut(gltf);
  takeDeadChannelsOut(gltf);
  trimExtensionLists(gltf);
  EXPECT_FALSE(gltf.contains("animations"));
  EXPECT_FALSE(gltf.contains("extensionsUsed"));
}

TEST(BakedNodes, whatIsNotAsGltfHasItIsLeftAlone) {
  for (const auto* text : {R"({})", R"({"nodes": 3, "scenes": 1, "animations": {}})", R"({"nodes": [1, null]})",
                           R"({"nodes": [{"children": [7, -1, "a"]}], "scenes": [{"nodes": [9]}], "scene": 4})"}) {
    const Json before = Json::parse(text);
    Json gltf = before;
    takeHiddenOut(gltf);
    EXPECT_THAT(takeLightsOut(gltf), IsEmpty());
    takeDeadChannelsOut(gltf);
    trimExtensionLists(gltf);
    EXPECT_EQ(gltf, before);
  }
}

}  // namespace
}  // namespace radiosity::engines
