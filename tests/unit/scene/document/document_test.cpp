#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "server/scene/document/json_text.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using testing::HasSubstr;
namespace fs = std::filesystem;

Result<Document> parseText(const std::string& text, const ImportLimits& limits = {}) {
  return parseDocument("t.gltf", {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, limits);
}

TEST(Document, defaultsAreThereAndMatrixIsTrs) {
  GltfBuilder builder;
  builder.gltf["materials"] = Json::array({Json::object()});
  // Half a turn about Y, scale (2, 3, 4) mirrored in x, moved to (5, 6, 7).
  builder.node({{"matrix", {2, 0, 0, 0, 0, 3, 0, 0, 0, 0, -4, 0, 5, 6, 7, 1}}});
  builder.node(Json::object());
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto& moved = document->gltf["nodes"][0];
  EXPECT_FALSE(moved.contains("matrix"));
  EXPECT_EQ(moved["translation"], (Json{5.0, 6.0, 7.0}));
  const auto& material = document->gltf["materials"][0];
  EXPECT_EQ(material["pbrMetallicRoughness"]["metallicFactor"], 1.0);
  EXPECT_EQ(material["alphaMode"], "OPAQUE");
  EXPECT_EQ(material["doubleSided"], false);
  EXPECT_EQ(material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 1.0);
  EXPECT_THAT(document->gltf["extensionsUsed"], testing::Contains("KHR_materials_emissive_strength"));
  EXPECT_EQ(document->gltf["nodes"][1]["rotation"], (Json{0.0, 0.0, 0.0, 1.0}));
}

TEST(Document, aShearedMatrixStaysAndWarns) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}, {"matrix", {1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}});
  const auto document = builder.document();
  EXPECT_TRUE(document->gltf["nodes"][0].contains("matrix"));
  const auto scene = importScene(*document);
  ASSERT_TRUE(scene);
  EXPECT_THAT(scene->warnings, testing::Contains(HasSubstr("/nodes/0/matrix")));
  EXPECT_EQ(scene->instances[0].world[1], glm::dvec4(1, 1, 0, 0));
}

TEST(Document, nestingIsBoundedBeforeParsing) {
  const auto result = parseText(std::string(100'000, '[') + std::string(100'000, ']'));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kTooLarge);
  EXPECT_THAT(result.error().where, HasSubstr("line 1"));
}

TEST(Document, bracketsInStringsAreNotNesting) {
  EXPECT_TRUE(parseText(R"({"asset":{"version":"2.0","generator":")" + std::string(500, '[') + R"(\"["}})"));
}

TEST(Document, manyShortValuesAreBoundedBeforeParsing) {
  std::string text = "[";
  for (std::size_t i = 0; i < (std::size_t{1} << 24) + 2; ++i) text += "1,";
  const auto result = parseText(text + "1]");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kTooLarge);
}

TEST(Document, jsonSuiteIsReadOrRefusedWithAPlace) {
  const auto folder = fs::path(RADIOSITY_SHARED_DIR) / "suites/JSONTestSuite/test_parsing";
  if (!fs::exists(folder)) GTEST_SKIP() << "no shared suites here";
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    const auto parsed = parseJson(text, "t.json", 64);
    const auto verdict = entry.path().filename().string()[0];
    if (verdict == 'y') {
      EXPECT_TRUE(parsed) << entry.path() << parsed.error().text();
    }
    if (verdict == 'n') {
      EXPECT_FALSE(parsed) << entry.path();
    }
    if (!parsed) {
      EXPECT_FALSE(parsed.error().where.empty());
    }
    const auto document = parseText(text);  // none of them is a glTF
    ASSERT_FALSE(document) << entry.path();
    EXPECT_FALSE(document.error().where.empty());
  }
}

TEST(Document, glbContainerFaultsAreRefused) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  const auto good = builder.glb();
  const auto refused = [](Bytes bytes) {
    const auto result = parseDocument("t.glb", bytes);
    return !result && !result.error().where.empty();
  };
  EXPECT_TRUE(parseDocument("t.glb", good));
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_TRUE(refused({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)}));
  auto version = good;
  version[4] = 1;
  EXPECT_TRUE(refused(version));
  auto long_chunk = good;
  long_chunk[15] = 0xFF;
  EXPECT_TRUE(refused(long_chunk));
  auto extra = good;
  extra.push_back(0);
  EXPECT_TRUE(refused(extra));
}

class ExternalFiles : public testing::Test {
 protected:
  ExternalFiles() : folder_(fs::path(testing::TempDir()) / ("radiosity_uri_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_ / "scene/sub dir");
    write(folder_ / "secret.bin", "secret!!");
    write(folder_ / "scene/sub dir/d.bin", "0123456789ab");
  }
  ~ExternalFiles() override { fs::remove_all(folder_); }
  static void write(const fs::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

  Result<Document> loadWithUri(const std::string& uri, std::size_t length = 8) {
    const Json gltf = {{"asset", {{"version", "2.0"}}}, {"buffers", {{{"uri", uri}, {"byteLength", length}}}}};
    write(folder_ / "scene/s.gltf", gltf.dump());
    return loadDocument(folder_ / "scene/s.gltf");
  }
  fs::path folder_;
};

TEST_F(ExternalFiles, areReadFromTheScenesFolder) {
  const auto document = loadWithUri("sub%20dir/d.bin", 12);
  ASSERT_TRUE(document) << document.error().text();
  EXPECT_EQ(document->buffers[0]->size(), 12U);
}

TEST_F(ExternalFiles, nothingOutsideTheFolderIsOpened) {
  fs::create_symlink(folder_ / "secret.bin", folder_ / "scene/link.bin");
  for (const auto& uri :
       {std::string("../secret.bin"), std::string("%2e%2e/secret.bin"), std::string("..%2Fsecret.bin"),
        (folder_ / "secret.bin").string(), "file://" + (folder_ / "secret.bin").string(), std::string("link.bin"),
        std::string("sub dir/../../secret.bin"), std::string("..\\secret.bin"), std::string("http://x/y.bin"),
        std::string("a%00b"), std::string("%zz"), std::string(""), std::string("."), std::string("sub dir")}) {
    const auto document = loadWithUri(uri);
    ASSERT_FALSE(document) << uri;
    EXPECT_EQ(document.error().where, "s.gltf: /buffers/0/uri") << uri;
  }
}

TEST_F(ExternalFiles, aShortFileIsRefused) {
  const auto document = loadWithUri("sub dir/d.bin", 13);
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().where, "s.gltf: /buffers/0/byteLength");
}

TEST(Document, anUploadCannotNameFiles) {
  const auto result = parseText(R"({"asset":{"version":"2.0"},"buffers":[{"uri":"a.bin","byteLength":1}]})");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().where, "t.gltf: /buffers/0/uri");
}

TEST(Document, dataUrisAreDecodedAndTakenOutOfTheJson) {
  const auto result = parseText(
      R"({"asset":{"version":"2.0"},"buffers":[{"uri":"data:application/octet-stream;base64,AAEC/w==","byteLength":4}]})");
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(*result->buffers[0], (Bytes{0, 1, 2, 255}));
  EXPECT_FALSE(result->gltf["buffers"][0].contains("uri"));
  EXPECT_FALSE(parseText(R"({"asset":{"version":"2.0"},"buffers":[{"uri":"data:x;base64,A*==","byteLength":1}]})"));
}

TEST(Document, writeGlbRoundTrips) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}, {"name", "wall"}});
  const auto document = builder.document();
  const auto again = parseDocument("again.glb", writeGlb(*document).value());
  ASSERT_TRUE(again) << again.error().text();
  const auto scene = importScene(*again);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->primitives[0].positions, importScene(*document)->primitives[0].positions);
  EXPECT_EQ(again->gltf["nodes"], document->gltf["nodes"]);
}

}  // namespace
}  // namespace radiosity::scene
