// EXT_meshopt_compression and KHR_meshopt_compression: views as the library's encoders make them, and broken ones.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/scene/document/document.h"
#include "tests/unit/scene/compressed_meshes.h"
#include "tests/unit/scene/expect_refused.h"

namespace radiosity::scene {
namespace {

using test::addView;
using test::expectRefused;
using test::GltfBuilder;
using test::Grid;
using test::Json;
using test::MeshoptBuilder;

constexpr const char* kExt = "EXT_meshopt_compression";
constexpr const char* kKhr = "KHR_meshopt_compression";

Json& formOf(GltfBuilder& builder, std::size_t view, const char* extension = kExt) {
  return builder.gltf["bufferViews"][view]["extensions"][extension];
}

TEST(Meshopt, viewsOfAllModesAreReadAsTheyWereToTheBit) {
  const Grid grid(9);
  for (const auto* extension : {kExt, kKhr}) {
    for (const auto* mode : {"TRIANGLES", "INDICES"}) {
      for (const std::size_t width : {2U, 4U}) {
        const auto builder = MeshoptBuilder(extension).mesh(grid, mode, width);
        const auto scene = builder.scene();
        ASSERT_TRUE(scene) << mode << scene.error().text();
        const auto& primitive = scene->primitives.at(0);
        ASSERT_EQ(primitive.indices.size(), grid.indices.size());
        for (std::size_t p = 0; p < grid.points(); ++p) {
          EXPECT_EQ(primitive.positions[p].x, grid.positions[3 * p]);
          EXPECT_EQ(primitive.positions[p].z, grid.positions[3 * p + 2]);
        }
      }
    }
  }
}

TEST(Meshopt, filtersAreUndone) {
  constexpr std::size_t kCount = 33;  // no multiple of what is decoded at once
  std::vector<float> directions;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto angle = 0.19F * static_cast<float>(i);
    directions.insert(directions.end(), {std::cos(angle) * 0.6F, std::sin(angle) * 0.6F, 0.8F, 0.0F});
  }
  MeshoptBuilder builder(kExt);
  Bytes octahedral(kCount * 4), quaternions(kCount * 8), exponential(kCount * 12);
  meshopt_encodeFilterOct(octahedral.data(), kCount, 4, 8, directions.data());
  meshopt_encodeFilterQuat(quaternions.data(), kCount, 8, 16, directions.data());
  std::vector<float> positions;
  for (std::size_t i = 0; i < kCount; ++i)
    positions.insert(positions.end(), directions.begin() + 4 * static_cast<long>(i),
                     directions.begin() + 4 * static_cast<long>(i) + 3);
  meshopt_encodeFilterExp(exponential.data(), kCount, 12, 20, positions.data());
  builder.attributes(octahedral, kCount, "OCTAHEDRAL");
  builder.attributes(quaternions, kCount, "QUATERNION");
  builder.attributes(exponential, kCount, "EXPONENTIAL");
  const auto document = builder.finish().document();
  ASSERT_TRUE(document) << document.error().text();
  const auto bytesOf = [&](std::size_t view) {
    return document->buffers[0]->data() + document->gltf["bufferViews"][view]["byteOffset"].get<std::size_t>();
  };
  for (std::size_t i = 0; i < kCount; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(static_cast<std::int8_t>(bytesOf(0)[4 * i + c]) / 127.0, directions[4 * i + c], 0.02);
      std::int16_t component = 0;
      std::memcpy(&component, bytesOf(1) + 8 * i + 2 * c, sizeof component);
      EXPECT_NEAR(component / 32767.0, directions[4 * i + c], 1e-3);
      float position = 0.0F;
      std::memcpy(&position, bytesOf(2) + 12 * i + 4 * c, sizeof position);
      EXPECT_NEAR(position, positions[3 * i + c], 1e-5);
    }
  }
}

TEST(Meshopt, leavesADocumentOfPlainViewsWithTheSameIndices) {
  const Grid grid(4);
  const auto builder = MeshoptBuilder(kExt).mesh(grid);
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto& gltf = document->gltf;
  EXPECT_EQ(gltf.dump().find("meshopt"), std::string::npos);
  EXPECT_FALSE(gltf.contains("extensionsRequired"));
  EXPECT_EQ(gltf["accessors"], builder.gltf["accessors"]);
  EXPECT_EQ(gltf["meshes"], builder.gltf["meshes"]);
  EXPECT_EQ(gltf["bufferViews"].size(), builder.gltf["bufferViews"].size());
  ASSERT_EQ(document->buffers.size(), 1U) << "neither what is compressed nor the place for what is decoded is there";
  EXPECT_EQ(gltf["buffers"].size(), 1U);
  test::expectSavedAndReadAsItIs(*document);
}

TEST(Meshopt, fallbackDataIsNotReadAndMayBeMissing) {
  const Grid grid(3);
  auto builder = MeshoptBuilder(kExt).mesh(grid);
  EXPECT_TRUE(builder.scene());
  builder.extra_buffers[0]["uri"] = "not-there.bin";
  EXPECT_TRUE(builder.scene()) << "loaders that know the extension need not load it";
  builder.extra_buffers[0].erase("extensions");
  EXPECT_FALSE(builder.scene());
  builder.extra_buffers[0].erase("uri");
  EXPECT_TRUE(builder.scene()) << "without a tag as well";
  builder.gltf["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 12}});
  expectRefused(builder, ErrorCode::kInvalidScene,
                "/bufferViews/" + std::to_string(builder.gltf["bufferViews"].size() - 1) + "/byteLength",
                "which has 0: all its data is compressed, but not this");
}

TEST(Meshopt, fallbackDataThatNoViewNamesLeavesNothing) {
  auto builder = MeshoptBuilder(kExt).mesh(Grid(3));
  builder.extra_buffers.push_back({{"byteLength", 6},
                                   {"uri", "data:application/octet-stream;base64,AAAAAAAA"},
                                   {"extensions", {{kExt, {{"fallback", true}}}}}});
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  EXPECT_EQ(document->gltf.dump().find("base64"), std::string::npos) << "clients are sent this with each scene";
  const auto again = parseDocument("again.glb", *writeGlb(*document));
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_TRUE(importScene(*again));
}

TEST(Meshopt, plainViewsAndPicturesBesideItStay) {
  const Grid grid(3);
  auto builder = MeshoptBuilder(kExt).mesh(grid);
  builder.node({{"mesh", builder.square()}});
  const auto picture = addView(builder, Bytes(5, 7));
  builder.gltf["images"] = Json::array(
      {{{"bufferView", picture}, {"mimeType", "image/png"}}, {{"bufferView", picture}, {"mimeType", "image/png"}}});
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  EXPECT_EQ(*document->images[1], Bytes(5, 7));
  const auto scene = importScene(*document);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->primitives.at(1).positions.size(), 4U);
}

TEST(Meshopt, anEditBringsCompressedViewsToo) {
  GltfBuilder room;
  room.node({{"mesh", room.square()}});
  const auto document = room.document();
  ASSERT_TRUE(document);
  const auto views = document->gltf["bufferViews"].size();
  const Grid grid(5);
  const auto model = MeshoptBuilder(kExt).mesh(grid);
  Json patch = Json::array();
  const auto add = [&](const std::string& path, Json value) {
    patch.push_back({{"op", "add"}, {"path", path}, {"value", std::move(value)}});
  };
  add("/buffers/-", {{"uri", "/uploads/stream"}});
  add("/buffers/-", model.extra_buffers[0]);
  for (auto view : model.gltf["bufferViews"]) {
    view["buffer"] = 2;
    view["extensions"][kExt]["buffer"] = 1;
    add("/bufferViews/-", view);
  }
  add("/accessors/-", {{"bufferView", views}, {"count", grid.points()}, {"componentType", 5126}, {"type", "VEC3"}});
  add("/meshes/-", {{"primitives", {{{"attributes", {{"POSITION", document->gltf["accessors"].size()}}}}}}});
  add("/extensionsRequired", {kExt});
  const auto bytes = std::make_shared<const Bytes>(model.bin);
  for (const bool tagged : {true, false}) {
    if (!tagged) patch[1]["value"].erase("extensions");
    const auto edited = editDocument(*document, patch, [&](const std::string&) { return bytes; });
    ASSERT_TRUE(edited) << edited.error().text();
    EXPECT_EQ(edited->document.buffers.size(), 2U);
    EXPECT_EQ(edited->document.buffers[0], document->buffers[0]);
    EXPECT_EQ(edited->document.gltf["bufferViews"][views]["buffer"], 1);
  }
}

TEST(Meshopt, theRulesOfTheExtensionAreChecked) {
  const Grid grid(4);
  const std::string positions = "/bufferViews/0", indices = "/bufferViews/1";
  const std::string form = positions + "/extensions/EXT_meshopt_compression";
  const auto refuse = [&](std::size_t view, const char* member, Json value, ErrorCode code, const std::string& where,
                          const std::string& what) {
    auto builder = MeshoptBuilder(kExt).mesh(grid);
    formOf(builder, view)[member] = std::move(value);
    expectRefused(builder, code, where, what);
  };
  const auto of_indices = indices + "/extensions/EXT_meshopt_compression";
  const auto invalid = ErrorCode::kInvalidScene, unsupported = ErrorCode::kUnsupported;
  refuse(0, "mode", "POINTS", unsupported, form + "/mode", "'POINTS' is not known");
  refuse(0, "filter", "COLOR", unsupported, form + "/filter", "'COLOR' is not known");
  refuse(0, "filter", "OCTAHEDRAL", invalid, form + "/byteStride", "OCTAHEDRAL");
  refuse(0, "byteStride", 10, invalid, form + "/byteStride", "multiple of 4");
  refuse(0, "count", 7, invalid, positions + "/byteLength", "count times");
  refuse(0, "byteLength", 100'000, invalid, form, "ends past its buffer");
  refuse(0, "buffer", 7, invalid, form + "/buffer", "has 2 entries");
  refuse(1, "filter", "EXPONENTIAL", invalid, of_indices + "/filter", "only for ATTRIBUTES");
  refuse(1, "byteStride", 8, invalid, of_indices + "/byteStride", "2 or 4");
  refuse(1, "count", 95, invalid, of_indices + "/count", "multiple of 3");
  auto builder = MeshoptBuilder(kExt).mesh(grid);
  builder.gltf["bufferViews"][0]["byteStride"] = 16;
  expectRefused(builder, invalid, positions + "/byteStride", "not that of its compressed form");
}

TEST(Meshopt, laterVersionsOfTheCodecAreRefusedByName) {
  const Grid grid(4);
  auto builder = MeshoptBuilder(kKhr).mesh(grid);
  builder.bin[formOf(builder, 0, kKhr)["byteOffset"].get<std::size_t>()] = 0xA1;
  expectRefused(builder, ErrorCode::kUnsupported, "/bufferViews/0/extensions/KHR_meshopt_compression",
                "version 1 of the codec for ATTRIBUTES");
  builder.bin[formOf(builder, 0, kKhr)["byteOffset"].get<std::size_t>()] = 0xE1;
  expectRefused(builder, ErrorCode::kBadInput, "/bufferViews/0/extensions/KHR_meshopt_compression",
                "no stream of the mode ATTRIBUTES");
}

TEST(Meshopt, decodedSizeCountsAgainstTheLimits) {
  GltfBuilder builder = MeshoptBuilder(kExt).mesh(Grid(2));
  const std::string form = "/bufferViews/0/extensions/EXT_meshopt_compression";
  formOf(builder, 0)["count"] = 100'000'000;
  builder.gltf["bufferViews"][0]["byteLength"] = 1'200'000'000;
  expectRefused(builder, ErrorCode::kTooLarge, form, "once geometry is decoded");
  formOf(builder, 0)["count"] = 50'000'000;
  builder.gltf["bufferViews"][0]["byteLength"] = 600'000'000;
  expectRefused(builder, ErrorCode::kTooLarge, form, "--max-scene-memory", {.max_scene_bytes = 1'000'000'000});
}

TEST(Meshopt, brokenStreamsAreRefusedOrReadAndNothingElse) {
  const Grid grid(12);
  const auto whole = MeshoptBuilder(kExt).mesh(grid);
  std::mt19937 random(1);
  std::size_t refused = 0;
  for (int i = 0; i < 2000; ++i) {
    auto builder = whole;
    auto& form = formOf(builder, random() % 2);
    if (i % 2 == 0) {
      form["byteLength"] = 1 + random() % form["byteLength"].get<std::size_t>();
    } else {
      for (int edits = 0; edits < 3; ++edits)
        builder.bin[random() % builder.bin.size()] = static_cast<std::uint8_t>(random());
    }
    const auto scene = builder.scene();
    refused += scene ? 0 : 1;
    EXPECT_TRUE(scene || !(scene.error().where.empty() || scene.error().message.empty()));
  }
  EXPECT_GT(refused, 900U);
}

}  // namespace
}  // namespace radiosity::scene
