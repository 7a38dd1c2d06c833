// Transforms that no author means, and trees that edits get wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> warningsOf(const GltfBuilder& builder) {
  const auto scene = builder.scene();
  EXPECT_TRUE(scene) << scene.error().text();
  return scene ? scene->warnings : std::vector<std::string>();
}

TEST(Lint, ScalesOfZeroAreToldOnceWithTheFirst) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}});
  builder.node({{"mesh", mesh}, {"scale", {1, 0, 1}}});
  EXPECT_THAT(warningsOf(builder), Contains(AllOf(HasSubstr("/nodes/1/scale: is 0"), Not(HasSubstr("other")))));
  for (int i = 0; i < 3; ++i) builder.node({{"mesh", mesh}, {"scale", {0, 0, 0}}});
  EXPECT_THAT(warningsOf(builder), Contains(AllOf(HasSubstr("/nodes/1/scale: is 0"), HasSubstr("in 3 other nodes"))));
}

TEST(Lint, TranslationsBeyondATerametreAreTold) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}, {"translation", {1e12, -1e12, 0}}});
  EXPECT_THAT(warningsOf(builder), ElementsAre());
  builder.node({{"mesh", mesh}, {"translation", {0, -1.1e12, 0}}});
  EXPECT_THAT(warningsOf(builder), Contains(HasSubstr("/nodes/1/translation: is beyond 1e12 m")));
}

TEST(Lint, MatricesThatCannotBeTakenApartAreLookedAtToo) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}, {"matrix", {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2e12, 0, 0, 1}}});
  const auto warnings = warningsOf(builder);
  EXPECT_THAT(warnings, Contains(HasSubstr("is 0; triangles")));
  EXPECT_THAT(warnings, Contains(HasSubstr("is beyond 1e12 m")));
}

TEST(Lint, InstancesAreToldOfByTheirAttribute) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  const auto places = builder.vec3({0, 0, 0, 2e12F, 0, 0, 3e12F, 0, 0});
  const auto scales = builder.vec3({1, 1, 1, 1, 1, 1, 1, 0, 1});
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const Json attributes = {{"TRANSLATION", places}, {"SCALE", scales}};
  builder.node({{"mesh", mesh}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
  const std::string pointer = "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes";
  const auto warnings = warningsOf(builder);
  EXPECT_THAT(warnings, Contains(HasSubstr(pointer + "/SCALE: is 0")));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr(pointer + "/TRANSLATION"), HasSubstr("in 1 other elements"))));
}

TEST(Lint, ARootNodeThatBecomesAChildIsRefusedWithTheCure) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  builder.node({{"name", "lamp"}});
  builder.gltf["scenes"] = Json::array({{{"nodes", {0, 1}}}});
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto adopt = Json::parse(R"([{"op": "add", "path": "/nodes/0/children", "value": [1]}])");
  const auto edited = applyPatch(*document, adopt);
  ASSERT_TRUE(edited) << edited.error().text();
  const auto refused = importScene(*edited);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().where, HasSubstr("/scenes/0/nodes/1"));
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr("/nodes/0/children lists it"),
                                             HasSubstr("take it out of /scenes/0/nodes in the same patch")));
  auto both = adopt;
  both.push_back({{"op", "remove"}, {"path", "/scenes/0/nodes/1"}});
  const auto cured = applyPatch(*document, both);
  ASSERT_TRUE(cured) << cured.error().text();
  EXPECT_TRUE(importScene(*cured));
}

}  // namespace
}  // namespace radiosity::scene::test
