// What a file claims is summed up before any of it is made.
#include "server/scene/import/scene_memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <string>

#include "common/memory_limit.h"
#include "server/scene/document/scene_limit.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {
namespace {

constexpr std::uint64_t kMib = std::uint64_t{1} << 20;

ImportLimits withMemory(std::uint64_t bytes) {
  ImportLimits limits;
  limits.max_scene_bytes = bytes;
  return limits;
}

/// An accessor that has no data: zeros, as many as it says.
std::size_t emptyAccessor(GltfBuilder& builder, std::uint64_t count, const char* type = "VEC3") {
  builder.gltf["accessors"].push_back({{"componentType", 5126}, {"count", count}, {"type", type}});
  return builder.gltf["accessors"].size() - 1;
}

void expectRefused(const Result<Scene>& scene, const std::string& where) {
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(scene.error().where, "test.glb: " + where);
  EXPECT_THAT(scene.error().message, testing::HasSubstr("--max-scene-memory"));
}

/// Of geometry alone.
Result<std::uint64_t> claimOf(const Document& document, const ImportLimits& limits) {
  const auto model = parseModel(document);
  if (!model) return tl::unexpected(model.error());
  return claimOfGeometry(document, *model, 0, limits);
}

long peakKib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TEST(SceneMemory, AQuarterOfWhatThereIsIsTheLimitUnlessAnotherIsNamed) {
  EXPECT_EQ(sceneMemoryLimit({}).bytes, memoryLimitBytes() / 4);
  EXPECT_EQ(sceneMemoryLimit(withMemory(5)).bytes, 5U);
}

/// Who set no option must not be told what it allows.
TEST(SceneMemory, TheLimitIsNamedByWhatItComesFrom) {
  const auto fault = [](const SceneLimit& limit) {
    return sceneMemoryFault(limit.bytes + kMib, limit, "its vertices");
  };
  EXPECT_EQ(fault(sceneMemoryLimit(withMemory(2048 * kMib))),
            "with its vertices the scene would take 2.0 GiB or more; --max-scene-memory allows 2.0 GiB");
  EXPECT_EQ(fault(likelySceneMemory({}, 8 * kMib)),
            "with its vertices the scene would take 1.5 GiB or more; the limit is 1.5 GiB, for so few bytes of data, "
            "unless --max-scene-memory names another");
  EXPECT_THAT(fault(sceneMemoryLimit({})),
              testing::EndsWith(", a quarter of the memory there is, unless --max-scene-memory names another"));
}

TEST(SceneMemory, InstancesWithoutDataAreRefusedBeforeTheyAreMade) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  const auto positions = emptyAccessor(builder, 60'000'000);
  builder.node(
      {{"mesh", mesh}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", positions}}}}}}}});
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const auto before = peakKib();
  expectRefused(builder.scene(withMemory(1024 * kMib)),
                "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION");
  EXPECT_LT(peakKib() - before, 64 * 1024);
}

/// A million triangles in one place took 20 s and 4 GB.
TEST(SceneMemory, MoreThanIsLikelyOfSoFewBytesIsRefusedUnlessALimitIsNamed) {
  for (const auto count : {150'000, 400'000}) {
    GltfBuilder builder;
    const auto mesh = builder.square();
    const auto positions = emptyAccessor(builder, static_cast<std::uint64_t>(count));
    const Json attributes = {{"TRANSLATION", positions}};
    builder.node({{"mesh", mesh}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
    builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
    const auto document = builder.document();
    ASSERT_TRUE(document);
    const auto claim = [&](const ImportLimits& limits) { return claimOf(*document, limits); };
    const auto likely = claim({});
    EXPECT_EQ(likely.has_value(), count < 300'000);
    EXPECT_THAT(likely ? "" : likely.error().message,
                testing::HasSubstr(count < 300'000 ? "" : "for so few bytes of data, unless --max-scene-memory"));
    EXPECT_TRUE(claim(withMemory(4096 * kMib)));
  }
}

TEST(SceneMemory, EachRendererHoldsTheTriangles) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  for (int i = 0; i < 1000; ++i) builder.node({{"mesh", mesh}});
  const auto document = builder.document();
  ASSERT_TRUE(document);
  auto limits = withMemory(1024 * kMib);
  const auto of_one = claimOf(*document, limits);
  limits.renderers = 9;
  const auto of_nine = claimOf(*document, limits);
  ASSERT_TRUE(of_one && of_nine);
  EXPECT_EQ(*of_nine - *of_one, 8U * 1000U * (300U + 2U * 850U));
}

TEST(SceneMemory, MoreInstancesThanThereMayBeAreRefusedLikewise) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  const auto positions = emptyAccessor(builder, 2'000'000);
  builder.node(
      {{"mesh", mesh}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", positions}}}}}}}});
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const auto scene = builder.scene(withMemory(std::uint64_t{1} << 40));
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::kTooLarge);
  EXPECT_THAT(scene.error().message, testing::HasSubstr("instances"));
}

TEST(SceneMemory, VerticesWithoutDataCountForEachPrimitive) {
  GltfBuilder builder;
  const auto positions = emptyAccessor(builder, 1'000'000);
  Json primitives = Json::array();
  for (int i = 0; i < 40; ++i) primitives.push_back({{"attributes", {{"POSITION", positions}}}});
  builder.gltf["meshes"] = Json::array({{{"primitives", primitives}}});
  builder.node({{"mesh", 0}});
  expectRefused(builder.scene(withMemory(512 * kMib)), "/meshes/0");
}

TEST(SceneMemory, NodesTimesTrianglesCount) {
  GltfBuilder builder;
  std::vector<float> positions;
  for (int i = 0; i < 3000; ++i) positions.insert(positions.end(), {float(i % 2), float(i % 3), float(i)});
  const auto accessor = builder.vec3(positions);
  builder.gltf["meshes"] = Json::array({{{"primitives", {{{"attributes", {{"POSITION", accessor}}}}}}}});
  for (int i = 0; i < 100; ++i) builder.node({{"mesh", 0}});
  EXPECT_TRUE(builder.scene(withMemory(256 * kMib)));
  const auto scene = builder.scene(withMemory(32 * kMib));
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().where, testing::StartsWith("test.glb: /nodes/"));
}

TEST(SceneMemory, WhatIsNotShownDoesNotCount) {
  GltfBuilder builder;
  const auto positions = emptyAccessor(builder, 10'000'000);
  builder.gltf["meshes"] = Json::array({{{"primitives", {{{"attributes", {{"POSITION", positions}}}}}}}});
  const auto square = builder.square();
  builder.node({{"mesh", 0}});
  builder.node({{"mesh", square}});
  builder.gltf["scenes"] = Json::array({{{"nodes", {1}}}});
  builder.gltf["scene"] = 0;
  EXPECT_TRUE(builder.scene(withMemory(64 * kMib)));
}

TEST(SceneMemory, EntriesOfListsCount) {
  GltfBuilder builder;
  builder.gltf["nodes"] = Json::array();
  for (int i = 0; i < 10'000; ++i) builder.gltf["nodes"].push_back(Json::object());
  expectRefused(builder.scene(withMemory(16 * kMib)), "/nodes");
}

/// A mebibyte of materials took 2.5 GiB, one of nodes that place nothing 1.2 GiB once somebody edited.
TEST(SceneMemory, MoreEntriesThanAreLikelyAreRefusedBeforeTheyHaveDefaults) {
  for (const std::string list : {"materials", "nodes"}) {
    GltfBuilder builder;
    builder.gltf[list] = Json::array();
    for (int i = 0; i < 350'000; ++i) builder.gltf[list].push_back(Json::object());
    const auto glb = builder.glb();
    const auto before = peakKib();
    const auto document = parseDocument("test.glb", glb);
    ASSERT_FALSE(document);
    EXPECT_EQ(document.error().code, ErrorCode::kTooLarge);
    EXPECT_EQ(document.error().where, "test.glb: /" + list);
    EXPECT_THAT(document.error().message, testing::HasSubstr("for so few bytes of data"));
    EXPECT_LT(peakKib() - before, 128 * 1024);
  }
}

TEST(SceneMemory, EntriesAndGeometryCountTogether) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}});
  const auto document = builder.document();
  ASSERT_TRUE(document);
  const auto model = parseModel(*document);
  ASSERT_TRUE(model);
  const auto likely = likelySceneMemory({}, bytesOfData(*document)).bytes;
  EXPECT_TRUE(claimOfGeometry(*document, *model, likely - kMib, {}));
  const auto refused = claimOfGeometry(*document, *model, likely, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "test.glb: /meshes/" + std::to_string(mesh));
}

TEST(SceneMemory, AnEditThatClaimsTooMuchIsRefusedAndChangesNothing) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}});
  const auto limits = withMemory(64 * kMib);
  const auto document = builder.document();
  ASSERT_TRUE(document);
  const auto edited = importEdited(*document, nullptr, limits);
  ASSERT_TRUE(edited);
  const Json patch = Json::array({{{"op", "add"},
                                   {"path", "/accessors/-"},
                                   {"value", {{"componentType", 5126}, {"count", 10'000'000}, {"type", "VEC3"}}}},
                                  {{"op", "add"},
                                   {"path", "/meshes/0/primitives/0/attributes/POSITION"},
                                   {"value", builder.gltf["accessors"].size()}}});
  const auto after = editDocument(edited->document, patch, {}, limits);
  ASSERT_FALSE(after);
  EXPECT_EQ(after.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(after.error().where, "/meshes/0");
  EXPECT_EQ(after.error().operation, 1U);
}

}  // namespace
}  // namespace radiosity::scene::test
