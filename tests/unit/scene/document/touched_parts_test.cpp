// An edit of a few values is told, checked and kept by them alone: the outcome is that of looking at the whole
// document.
#include "server/scene/document/touched_parts.h"

#include <gtest/gtest.h>

#include "server/scene/document/document.h"
#include "server/scene/document/document_defaults.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

/// Three squares, a light, and materials with and without extensions.
Document someDocument() {
  test::GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf.merge_patch(R"({"scene":0,"extensionsUsed":["KHR_lights_punctual"],
    "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":5}]}},
    "materials":[{"name":"m"},{"extensions":{"KHR_materials_clearcoat":{}}},{"name":"n"}]})"_json);
  builder.node({{"name", "a"}, {"mesh", mesh}});
  builder.node({{"name", "b"}, {"mesh", mesh}, {"translation", {1, 0, 0}}});
  builder.node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  builder.node({{"mesh", mesh}, {"translation", {0, 2, 0}}});
  builder.gltf["scenes"] = {{{"nodes", {0, 1, 2, 3}}}};
  return builder.document().value();
}

constexpr std::array kFew = {
    R"([{"op":"replace","path":"/nodes/@b/translation","value":[4,5,6]}])",
    R"([{"op":"replace","path":"/materials/@m/emissiveFactor","value":[1,1,0]}])",
    R"([{"op":"add","path":"/materials/3","value":{}},{"op":"remove","path":"/materials/@m/alphaMode"}])",
    R"([{"op":"replace","path":"/materials/1","value":{"extensions":{"KHR_materials_unlit":{}}}}])",
    R"([{"op":"replace","path":"/extensions/KHR_lights_punctual/lights/0","value":{"type":"point"}}])",
    R"([{"op":"add","path":"/nodes/-","value":{"name":"c"}},{"op":"add","path":"/nodes/4/scale","value":[1,1,2]},
        {"op":"remove","path":"/nodes/0/name"}])",
    R"([{"op":"copy","from":"/nodes/1","path":"/nodes/-"},{"op":"test","path":"/nodes/0/name","value":"a"}])",
    R"([{"op":"add","path":"/materials/-","value":{"extensions":{"KHR_materials_unlit":{}}}}])"};
constexpr std::array kMany = {
    R"([{"op":"move","from":"/nodes/0/name","path":"/nodes/1/name"}])",
    R"([{"op":"replace","path":"/scenes/0/nodes","value":[0,1,2]}])", R"([{"op":"remove","path":"/extensionsUsed"}])",
    R"([{"op":"add","path":"/extras","value":[1]},{"op":"replace","path":"/nodes/0/name","value":"z"}])"};

/// Applied, with defaults written into all of it.
Json whollyPatched(const Document& document, const Json& patch) {
  auto gltf = applyJsonPatch(document.gltf, patch).value();
  materialiseDefaults(gltf);
  return gltf;
}

void expectOutcome(const char* text, bool all) {
  const auto document = importEdited(someDocument(), nullptr).value().document;
  const auto patch = Json::parse(text);
  const auto edited = editDocument(document, patch);
  ASSERT_TRUE(edited) << text << edited.error().text();
  EXPECT_EQ(edited->parts.all, all) << text;
  const auto& after = edited->document.gltf;
  EXPECT_TRUE(isIdentical(after, whollyPatched(document, patch))) << text;
  const auto wholly = importEdited(edited->document, nullptr).value();
  EXPECT_EQ(edited->scene.warnings, wholly.scene.warnings) << text;
  EXPECT_EQ(edited->scene.materials, wholly.scene.materials) << text;
  ASSERT_FALSE(edited->scene.instances.empty());
  ASSERT_FALSE(edited->scene.lights.empty());
  EXPECT_EQ(edited->scene.instances, wholly.scene.instances) << text;
  EXPECT_EQ(edited->scene.lights, wholly.scene.lights) << text;
  EXPECT_EQ(edited->scene.primitives.size(), wholly.scene.primitives.size()) << text;
  auto forth = document.gltf, back = after;
  forth.patch_inplace(diffDocuments(document.gltf, after, edited->parts));
  EXPECT_EQ(forth, after) << text;
  back.patch_inplace(diffDocuments(after, document.gltf, edited->parts));
  EXPECT_EQ(back, document.gltf) << text;
}

TEST(TouchedParts, AnEditOfAFewIsWhatAnEditOfAllWouldBe) {
  for (const auto* patch : kFew) expectOutcome(patch, false);
}
TEST(TouchedParts, WhatMayReachFurtherIsLookedAtAsAWhole) {
  for (const auto* patch : kMany) expectOutcome(patch, true);
}

/// Else what follows would be proportional to the document again, though all outcomes stay the same.
TEST(TouchedParts, NothingElseIsLookedAt) {
  auto before = someDocument().gltf, after = before;
  after["materials"][1]["name"] = "here";
  after["materials"][2]["name"] = after["nodes"][3]["name"] = "elsewhere";
  const auto parts = touchedParts(R"([{"op":"add","path":"/materials/1/name","value":"here"}])"_json,
                                  std::vector<Tokens>{{"materials", "1", "name"}});
  EXPECT_EQ(diffDocuments(before, after, parts), R"([{"op":"add","path":"/materials/1/name","value":"here"}])"_json);
  EXPECT_TRUE(touchMaterialsAlone(parts, before, after));
  Json bare = {{"nodes", {Json::object(), Json::object()}}, {"materials", {Json::object(), Json::object()}}};
  materialiseDefaults(bare, parts);
  EXPECT_FALSE(bare["nodes"][0].contains("scale"));
  EXPECT_FALSE(bare["materials"][0].contains("alphaMode"));
  EXPECT_TRUE(bare["materials"][1].contains("alphaMode"));
}

}  // namespace
}  // namespace radiosity::scene
