#include "client/engines/lit_scene.h"

#include <gtest/gtest.h>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::engines {
namespace {

class LitSceneFile : public testing::Test {
 protected:
  [[nodiscard]] std::string write(const char* name, const Bytes& bytes) const {
    return folder_.write(name, {bytes.begin(), bytes.end()});
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(LitSceneFile, comesBackAsItWasWritten) {
  const Json gltf = Json::parse(R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 5}]})");
  const auto glb = writeGlb(gltf, Bytes{1, 2, 3, 4, 5});
  ASSERT_TRUE(glb);
  EXPECT_EQ(glb->size() % 4, 0U);
  const auto scene = readLitScene(write("a.glb", *glb), {});
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->gltf, gltf);
  ASSERT_GE(scene->bin.size(), 5U);
  EXPECT_EQ(scene->bin[4], 5);
}

TEST_F(LitSceneFile, errorsNameTheFile) {
  const auto missing = readLitScene("/nowhere/a.glb", {});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().where, "/nowhere/a.glb");
  auto glb = *writeGlb(Json::object(), {});
  const auto good = write("good.glb", glb), page = write("page.exr", {'n', 'o'});
  const auto bad_page = readLitScene(good, {page});
  ASSERT_FALSE(bad_page);
  EXPECT_EQ(bad_page.error().code, ErrorCode::kBadInput);
  EXPECT_EQ(bad_page.error().where, page);
  for (std::size_t size = 0; size < glb.size(); ++size) {
    const Bytes part(glb.begin(), glb.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(readLitScene(write("part.glb", part), {})) << size << " bytes";
  }
  glb = *writeGlb(Json::parse(R"({"buffers": [{}, {}]})"), {});
  EXPECT_FALSE(readLitScene(write("two.glb", glb), {}));
}

}  // namespace
}  // namespace radiosity::engines
