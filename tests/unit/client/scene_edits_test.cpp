// Short forms of edits, as patches on a document.
#include <gmock/gmock.h>

#include <cstddef>
#include <limits>
#include <string>

#include "client/cli/model_merge.h"
#include "client/cli/scene_edits.h"

namespace radiosity::cli {
namespace {

using testing::HasSubstr;

Json document() {
  return Json::parse(R"({
    "scene": 0, "scenes": [{"nodes": [0, 2, 3]}],
    "nodes": [
      {"name": "lamp", "mesh": 0, "translation": [0, 1, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1],
       "children": [1], "extensions": {"KHR_node_visibility": {"visible": true}}},
      {"name": "bulb", "translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 2, 1],
       "extensions": {"KHR_lights_punctual": {"light": 0}}},
      {"name": "twin"}, {"name": "twin", "matrix": [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 1}]}],
    "materials": [{"name": "a/b", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}},
                  {"name": "glow", "emissiveFactor": [0, 0, 0], "doubleSided": false,
                   "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1}}}],
    "extensions": {"KHR_lights_punctual": {"lights": [{"name": "spot", "color": [1, 1, 1], "intensity": 5}]}},
    "buffers": [{"byteLength": 4}], "bufferViews": [{"buffer": 0, "byteLength": 4}], "accessors": [{}, {}]})");
}

void expectPatch(const Result<Json>& patch, const char* expected) {
  ASSERT_TRUE(patch) << patch.error().text();
  EXPECT_EQ(*patch, Json::parse(expected));
}

TEST(SceneEdits, propertiesAreFoundByTheThingsNameOrItsNodes) {
  const auto strength =
      R"([{"op":"replace","path":"/materials/@glow/extensions/KHR_materials_emissive_strength/emissiveStrength",
           "value":20}])";
  expectPatch(setPatch(document(), "@glow.emissiveStrength", "20"), strength);
  expectPatch(setPatch(document(), "@lamp.emissiveStrength", "20"), strength);
  const auto intensity =
      R"([{"op":"replace","path":"/extensions/KHR_lights_punctual/lights/@spot/intensity","value":7.5}])";
  expectPatch(setPatch(document(), "@spot.intensity", "7.5"), intensity);
  expectPatch(setPatch(document(), "@bulb.intensity", "7.5"), intensity);
  expectPatch(setPatch(document(), "@bulb.color", "1,0,0"),
              R"([{"op":"replace","path":"/extensions/KHR_lights_punctual/lights/@spot/color","value":[1,0,0]}])");
  expectPatch(setPatch(document(), "@bulb.scale", "[2,2,2]"),
              R"([{"op":"replace","path":"/nodes/@bulb/scale","value":[2,2,2]}])");
  expectPatch(setPatch(document(), "@lamp.texelScale", "2"),
              R"([{"op":"add","path":"/nodes/@lamp/extras","value":{"radiosityTexelScale":2}}])");
  expectPatch(setPatch(document(), "/materials/1/name", "\"x\""),
              R"([{"op":"add","path":"/materials/1/name","value":"x"}])");
}

TEST(SceneEdits, lampsWithASizeOrAWebHavePropertiesOfTheirOwn) {
  auto gltf = document();
  gltf["extensions"]["EXT_lights_area"]["lights"] = Json::parse(R"([{"name": "panel", "type": "rect", "size": 1}])");
  gltf["nodes"][2] = Json::parse(R"({"name": "tube", "extensions": {"EXT_lights_area": {"light": 0}}})");
  gltf["nodes"][3] = Json::parse(R"({"name": "lit", "extensions": {"EXT_lights_ies": {"light": 0, "multiplier": 1}}})");
  expectPatch(setPatch(gltf, "@panel.size", "2"),
              R"([{"op":"replace","path":"/extensions/EXT_lights_area/lights/@panel/size","value":2}])");
  expectPatch(setPatch(gltf, "@tube.intensity", "500"),
              R"([{"op":"add","path":"/extensions/EXT_lights_area/lights/@panel/intensity","value":500}])");
  expectPatch(setPatch(gltf, "@tube.aspect", "3"),
              R"([{"op":"add","path":"/extensions/EXT_lights_area/lights/@panel/rect","value":{"aspect":3}}])");
  expectPatch(setPatch(gltf, "@lit.multiplier", "0.5"),
              R"([{"op":"replace","path":"/nodes/@lit/extensions/EXT_lights_ies/multiplier","value":0.5}])");
  expectPatch(setPatch(gltf, "@bulb.radius", "0.1"),
              R"([{"op":"add","path":"/extensions/KHR_lights_punctual/lights/@spot/extras",
                   "value":{"radiosityRadius":0.1}}])");
}

TEST(SceneEdits, coloursKeepTheirAlphaAndOneNumberIsGrey) {
  const auto path = [](const char* value) {
    return R"([{"op":"replace","path":"/materials/@a~1b/pbrMetallicRoughness/baseColorFactor","value":)" +
           std::string(value) + "}]";
  };
  expectPatch(setPatch(document(), "@a/b.color", "0.2,0.3,0.4"), path("[0.2,0.3,0.4,0.5]").c_str());
  expectPatch(setPatch(document(), "@a/b.color", "0.2"), path("[0.2,0.2,0.2,0.5]").c_str());
  expectPatch(setPatch(document(), "@a/b.alpha", "0.9"), path("[1,1,1,0.9]").c_str());
}

TEST(SceneEdits, whatIsNotThereIsSaidWithWhatIs) {
  const auto fault = [](const std::string& target, const std::string& value = "1") {
    const auto patch = setPatch(document(), target, value);
    EXPECT_FALSE(patch) << target;
    return patch ? std::string() : patch.error().text();
  };
  EXPECT_THAT(fault("@nobody.emissiveStrength"), HasSubstr("a/b, glow"));
  EXPECT_THAT(fault("@lamp.brightness"), HasSubstr("emissiveStrength"));
  EXPECT_THAT(fault("@twin.translation"), HasSubstr("2 nodes are called that"));
  EXPECT_THAT(fault("lamp.translation"), HasSubstr("@NAME.PROPERTY"));
  EXPECT_THAT(fault("@lamp"), HasSubstr("@NAME.PROPERTY"));
  EXPECT_THAT(fault("@a/b.alpha", "thick"), HasSubstr("must be a number"));
}

TEST(SceneEdits, scaleOfZeroOrOfNoNumberIsRefusedWithAReason) {
  const auto expectRefused = [](const Result<Json>& patch, const char* reason) {
    ASSERT_FALSE(patch) << patch->dump();
    EXPECT_THAT(patch.error().text(), HasSubstr(reason));
  };
  const double infinite = std::numeric_limits<double>::infinity(), none = std::numeric_limits<double>::quiet_NaN();
  for (const double wrong : {0.0, -0.0, infinite, none}) {
    expectRefused(scalePatch(document(), "@lamp", {wrong, 1, 1}), "other than 0");
    expectRefused(scalePatch(document(), "@lamp", {1, wrong, 1}), "other than 0");
    expectRefused(scalePatch(document(), "@lamp", {1, 1, wrong}), "other than 0");
  }
  for (const char* wrong : {"1,0,1", "0,0,0", "1,1", "2", "[1,1,\"x\"]"})
    expectRefused(setPatch(document(), "@lamp.scale", wrong), "other than 0");
  EXPECT_TRUE(scalePatch(document(), "@lamp", {-1, 1, 1}));  // a mirror image

  auto gltf = document();
  gltf["nodes"][0]["scale"] = {1e-200, 1.0, 1e200};
  expectRefused(scalePatch(gltf, "@lamp", {1e-200, 1, 1}), "too small");
  expectRefused(scalePatch(gltf, "@lamp", {1, 1, 1e200}), "too large");
  gltf["nodes"][0]["scale"] = {0.0, 1.0, 1.0};
  EXPECT_TRUE(scalePatch(gltf, "@lamp", {2, 2, 2})) << "a sheet that came as one may grow";
}

TEST(SceneEdits, nodesMoveTurnAndGrowFromWhereTheyAre) {
  expectPatch(movePatch(document(), "@lamp", {1, 2, 3}, false),
              R"([{"op":"replace","path":"/nodes/@lamp/translation","value":[1.0,2.0,3.0]}])");
  expectPatch(movePatch(document(), "/nodes/0", {1, 2, 3}, true),
              R"([{"op":"replace","path":"/nodes/@lamp/translation","value":[1.0,3.0,3.0]}])");
  expectPatch(scalePatch(document(), "@bulb", {2, 2, 1}),
              R"([{"op":"replace","path":"/nodes/@bulb/scale","value":[2.0,4.0,1.0]}])");
  auto gltf = document();
  for (int i = 0; i < 4; ++i) {  // four quarters are a full turn: q or -q
    const auto turned = rotatePatch(gltf, "@lamp", 90.0, {0, 3, 0}, false);
    ASSERT_TRUE(turned);
    gltf["nodes"][0]["rotation"] = (*turned)[0]["value"];
    if (i == 0) {
      EXPECT_NEAR(gltf["nodes"][0]["rotation"][1].get<double>(), std::sqrt(0.5), 1e-12);
    }
  }
  EXPECT_NEAR(std::abs(gltf["nodes"][0]["rotation"][3].get<double>()), 1.0, 1e-12);
  EXPECT_FALSE(rotatePatch(document(), "@lamp", 90.0, {0, 0, 0}, false));
  EXPECT_FALSE(rotatePatch(document(), "@lamp", std::numeric_limits<double>::infinity(), {0, 1, 0}, false));
  EXPECT_TRUE((*rotatePatch(document(), "@lamp", 1e308, {0, 1, 0}, false))[0]["value"][1].is_number());
  EXPECT_THAT(movePatch(document(), "/nodes/3", {0, 0, 0}, false).error().message, HasSubstr("shears"));
  for (const auto* node : {"@twin", "@nobody", "/nodes/4", "/nodes/", "/nodes/1x", "lamp", "", "@"})
    EXPECT_FALSE(movePatch(document(), node, {0, 0, 0}, false)) << node;
}

TEST(SceneEdits, nodesAreHiddenAndDetached) {
  expectPatch(visibilityPatch(document(), "@lamp", false),
              R"([{"op":"replace","path":"/nodes/@lamp/extensions/KHR_node_visibility/visible","value":false}])");
  expectPatch(removePatch(document(), "@lamp"), R"([{"op":"replace","path":"/scenes/0/nodes","value":[2,3]}])");
  expectPatch(removePatch(document(), "@bulb"), R"([{"op":"remove","path":"/nodes/@lamp/children"}])");
  auto gltf = document();
  gltf["scenes"][0]["nodes"] = {0};
  EXPECT_THAT(removePatch(gltf, "/nodes/2").error().message, HasSubstr("in no scene"));
}

TEST(ModelMerge, everyIndexMovesAlong) {
  const auto model = Json::parse(R"({
    "scenes": [{"nodes": [1]}],
    "nodes": [{"mesh": 0, "skin": 0}, {"name": "lamp", "children": [0],
               "extensions": {"KHR_lights_punctual": {"light": 0}}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                   "extensions": {"KHR_x": {"someTexture": {"index": 0}}}, "extras": {"index": 0}}],
    "textures": [{"source": 0, "sampler": 0}], "samplers": [{}], "images": [{"bufferView": 0}],
    "accessors": [{"bufferView": 0, "sparse": {"indices": {"bufferView": 0}, "values": {"bufferView": 0}}}, {}],
    "bufferViews": [{"buffer": 0}], "buffers": [{"byteLength": 8}], "extensionsUsed": ["KHR_x"],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}})");
  const auto merge = mergeModel(document(), model, "/uploads/u", {"lamp", {1, 2, 3}, "@bulb"});
  ASSERT_TRUE(merge) << merge.error().text();
  EXPECT_EQ(merge->node, "@lamp 2");
  auto gltf = document();
  gltf["nodes"][1].erase("children");
  ASSERT_NO_THROW(gltf = gltf.patch(merge->patch)) << merge->patch;
  EXPECT_EQ(gltf["buffers"][1], Json::parse(R"({"byteLength":8,"uri":"/uploads/u"})"));
  EXPECT_EQ(gltf["bufferViews"][1]["buffer"], 1);
  EXPECT_EQ(gltf["accessors"][2],
            Json::parse(R"({"bufferView":1,"sparse":{"indices":{"bufferView":1},"values":{"bufferView":1}}})"));
  EXPECT_EQ(gltf["images"][0]["bufferView"], 1);
  EXPECT_EQ(gltf["textures"][0], Json::parse(R"({"source":0,"sampler":0})"));
  EXPECT_EQ(gltf["materials"][2], model["materials"][0]);  // there were no textures before
  EXPECT_EQ(gltf["meshes"][1]["primitives"][0],
            Json::parse(R"({"attributes":{"POSITION":2},"indices":3,"material":2})"));
  EXPECT_EQ(gltf["nodes"][4], Json::parse(R"({"mesh":1})"));
  EXPECT_EQ(gltf["nodes"][5]["children"], Json::parse("[4]"));
  EXPECT_EQ(gltf["nodes"][5]["extensions"]["KHR_lights_punctual"]["light"], 1);
  EXPECT_EQ(gltf["nodes"][6], Json::parse(R"({"name":"lamp 2","translation":[1.0,2.0,3.0],"children":[5]})"));
  EXPECT_EQ(gltf["nodes"][1]["children"], Json::parse("[6]"));
  EXPECT_EQ(gltf["extensionsUsed"], Json::parse(R"(["KHR_x"])"));
}

TEST(ModelMerge, indicesOfCompressedDataMoveAlongToo) {
  const auto model = Json::parse(R"({
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "extensions": {"KHR_draco_mesh_compression":
               {"bufferView": 0, "attributes": {"POSITION": 5}}}}]}],
    "textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}], "images": [{"bufferView": 1}],
    "accessors": [{}],
    "bufferViews": [{"buffer": 0}, {"buffer": 1, "extensions": {"EXT_meshopt_compression": {"buffer": 0}}}],
    "buffers": [{"byteLength": 8}, {"byteLength": 9}]})");
  auto gltf = document();
  gltf["images"] = Json::array({Json::object()});
  const auto merge = mergeModel(gltf, model, "/uploads/u", {"x", {}, {}});
  ASSERT_TRUE(merge) << merge.error().text();
  ASSERT_NO_THROW(gltf = gltf.patch(merge->patch)) << merge->patch;
  const auto& draco = gltf["meshes"][1]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
  EXPECT_EQ(draco, Json::parse(R"({"bufferView":1,"attributes":{"POSITION":5}})"));
  EXPECT_EQ(gltf["bufferViews"][2]["extensions"]["EXT_meshopt_compression"]["buffer"], 1);
  EXPECT_EQ(gltf["bufferViews"][2]["buffer"], 2);
  EXPECT_EQ(gltf["textures"][0]["extensions"]["EXT_texture_webp"]["source"], 1);
  EXPECT_EQ(gltf["buffers"][1]["uri"], "/uploads/u");
  EXPECT_FALSE(gltf["buffers"][2].contains("uri")) << "it has no data";
}

TEST(ModelMerge, aFileThatIsNotWhatItSeemsIsRefused) {
  for (const auto* model :
       {R"({})", R"({"nodes":5})", R"({"nodes":[7]})", R"({"nodes":[{"children":"x"}]})",
        R"({"nodes":[{"mesh":0}],"meshes":[{"primitives":{"attributes":3}}]})", R"({"nodes":[{}],"scenes":7})"}) {
    EXPECT_FALSE(mergeModel(document(), Json::parse(model), "", {"x", {}, {}})) << model;
  }
  EXPECT_FALSE(splitModel("glTF", "x.glb"));
  EXPECT_FALSE(splitModel(std::string("glTF\2\0\0\0\x20\0\0\0\xff\0\0\0JSON{}", 22), "x.glb"));
}

std::string glbOf(const std::string& json) {
  const auto word = [](std::size_t n) {
    return std::string{static_cast<char>(n & 0xFF), static_cast<char>(n >> 8U), 0, 0};
  };
  return "glTF" + word(2) + word(20 + json.size()) + word(json.size()) + "JSON" + json;
}

TEST(ModelMerge, aGlbThatNeedsOtherFilesOrNestsTooDeepIsRefusedHere) {
  EXPECT_TRUE(splitModel(glbOf(R"({"buffers":[{"byteLength":1},{"uri":"data:;base64,AA=="}]})"), "x.glb"));
  EXPECT_TRUE(splitModel(glbOf(R"({"asset":{}})" + std::string(3, '\0')), "x.glb")) << "so some exporters pad";
  const auto refused = splitModel(glbOf(R"({"images":[{"bufferView":0},{"uri":"wood.png"}]})"), "x.glb");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "x.glb: /images/1/uri");
  EXPECT_THAT(refused.error().message, HasSubstr("wood.png"));
  EXPECT_FALSE(splitModel(glbOf(R"({"extras":)" + std::string(5000, '[') + std::string(5000, ']') + "}"), "x.glb"));
}

}  // namespace
}  // namespace radiosity::cli
