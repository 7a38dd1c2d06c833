#include "client/cli/scene_file.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::cli {
namespace {

std::string base64Of(const std::string& text) {
  return base64(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

TEST(Base64, matchesTheVectorsOfRfc4648) {
  EXPECT_EQ(base64Of(""), "");
  EXPECT_EQ(base64Of("f"), "Zg==");
  EXPECT_EQ(base64Of("fo"), "Zm8=");
  EXPECT_EQ(base64Of("foo"), "Zm9v");
  EXPECT_EQ(base64Of("foob"), "Zm9vYg==");
  EXPECT_EQ(base64Of("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64Of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64Of("\xFF\xFE\xFD"), "//79");
}

TEST(SceneKind, looksAtTheContentNotTheName) {
  const TemporaryFolder folder;
  EXPECT_EQ(sceneKind(folder.write("a.bin", std::string("glTF\2\0\0\0\14\0\0\0", 12))), SceneKind::kGlb);
  EXPECT_EQ(sceneKind(folder.write("b.bin", " \n {\"asset\":{}}")), SceneKind::kGltf);
  EXPECT_EQ(sceneKind(folder.write("c.gltf", "\xEF\xBB\xBF{}")), SceneKind::kGltf);
}

TEST(SceneKind, refusesWithTheReasonAndThePath) {
  const TemporaryFolder folder;
  struct Case {
    std::string path;
    const char* reason;
  };
  for (const Case& c :
       {Case{folder.file("missing.glb"), "no such file"}, Case{folder.file(""), "folder"},
        Case{folder.write("empty.glb", ""), "empty"}, Case{folder.write("cut.glb", "glTF"), "cut off"},
        Case{folder.write("x.obj", "v 0 0 0"), "export the .obj"}, Case{folder.write("x.glb", "PK\3\4"), "neither"}}) {
    const auto kind = sceneKind(c.path);
    ASSERT_FALSE(kind) << c.path;
    EXPECT_EQ(kind.error().code, ErrorCode::kBadInput);
    EXPECT_EQ(kind.error().where, c.path);
    EXPECT_NE(kind.error().message.find(c.reason), std::string::npos) << kind.error().text();
  }
}

TEST(InlineExternalFiles, packsBuffersAndImagesAndKeepsTheRest) {
  const TemporaryFolder folder;
  folder.write("my data.bin", "foobar");
  folder.write("textures/wood.jpg", "foo");
  const auto path = folder.write("room.gltf", R"({"asset":{"version":"2.0"},"extras":{"f":0.1},
    "buffers":[{"uri":"my%20data.bin","byteLength":6},{"uri":"data:;base64,AA==","byteLength":1},{"byteLength":3}],
    "images":[{"uri":"textures/wood.jpg"},{"bufferView":0,"mimeType":"image/png"}]})");
  EXPECT_EQ(hasExternalFiles(path), true);
  const auto text = inlineExternalFiles(path);
  ASSERT_TRUE(text) << text.error().text();
  const auto document = nlohmann::json::parse(*text);
  EXPECT_EQ(document["buffers"][0]["uri"], "data:application/octet-stream;base64,Zm9vYmFy");
  EXPECT_EQ(document["buffers"][1]["uri"], "data:;base64,AA==");
  EXPECT_FALSE(document["buffers"][2].contains("uri"));
  EXPECT_EQ(document["images"][0]["uri"], "data:image/jpeg;base64,Zm9v");
  EXPECT_EQ(document["extras"]["f"], 0.1);
}

TEST(InlineExternalFiles, packsPhotometricFiles) {
  const TemporaryFolder folder;
  folder.write("lamp.ies", "foo");
  folder.write("lamp.ldt", "bar");
  const auto path = folder.write("room.gltf", R"({"asset":{"version":"2.0"},"extensions":{"EXT_lights_ies":
    {"lights":[{"uri":"lamp.ies"},{"uri":"lamp.ldt"}]}}})");
  EXPECT_EQ(hasExternalFiles(path), true);
  const auto text = inlineExternalFiles(path);
  ASSERT_TRUE(text) << text.error().text();
  const auto lights = nlohmann::json::parse(*text)["extensions"]["EXT_lights_ies"]["lights"];
  EXPECT_EQ(lights[0]["uri"], "data:application/x-ies-lm-63;base64,Zm9v");
  EXPECT_EQ(lights[1]["uri"], "data:application/x-eulumdat;base64,YmFy");
}

TEST(InlineExternalFiles, isNotNeededForASelfContainedFile) {
  const TemporaryFolder folder;
  EXPECT_EQ(hasExternalFiles(folder.write("a.gltf", R"({"buffers":[{"uri":"data:;base64,AA=="}]})")), false);
}

TEST(InlineExternalFiles, readsNothingOutsideTheFolder) {
  const TemporaryFolder folder;
  const auto secret = folder.write("secret.bin", "x");
  std::filesystem::create_directories(folder.file("scene"));
  std::filesystem::create_symlink(secret, folder.file("scene/link.bin"));
  for (const std::string& uri :
       {std::string("../secret.bin"), secret, std::string("link.bin"), std::string("%2e%2e/secret.bin"),
        std::string("a/../../secret.bin"), std::string("http://h/a.bin"), std::string("file:///etc/passwd")}) {
    const auto path = folder.write("scene/room.gltf", R"({"buffers":[{"uri":")" + uri + R"(","byteLength":1}]})");
    const auto text = inlineExternalFiles(path);
    ASSERT_FALSE(text) << uri;
    EXPECT_EQ(text.error().where, path + ": /buffers/0/uri");
  }
}

TEST(InlineExternalFiles, namesThePointerOfAMissingFile) {
  const TemporaryFolder folder;
  const auto path = folder.write("room.gltf", R"({"images":[{"bufferView":0},{"uri":"gone.png"}]})");
  const auto text = inlineExternalFiles(path);
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().where, path + ": /images/1/uri");
  EXPECT_NE(text.error().message.find("no such file"), std::string::npos);
}

TEST(InlineExternalFiles, refusesWhatIsNotAJsonObject) {
  const TemporaryFolder folder;
  for (const auto* content : {"{", "{\"a\":}", "{}x"})
    EXPECT_FALSE(inlineExternalFiles(folder.write("room.gltf", content))) << content;
  EXPECT_FALSE(inlineExternalFiles(folder.write("deep.gltf", "{\"a\":" + std::string(100'000, '['))));
}

}  // namespace
}  // namespace radiosity::cli
