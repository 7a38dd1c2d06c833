// The importer over files that others made: every scene, and the validator's collection of broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <iostream>

#include "server/scene/document/document.h"

namespace radiosity::scene {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

const fs::path kShared = RADIOSITY_SHARED_DIR;

std::vector<fs::path> sceneFiles(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".glb" || extension == ".gltf") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

Result<Scene> load(const fs::path& file) {
  const auto document = loadDocument(file);
  if (!document) return tl::unexpected(document.error());
  return importScene(*document);
}

bool mustRefuse(const fs::path& file) { return file.filename().string().rfind("REFUSE_", 0) == 0; }

TEST(ImportFiles, everySharedSceneIsAcceptedWithTriangles) {
  if (!fs::exists(kShared / "scenes")) GTEST_SKIP() << "no shared scenes here";
  for (const auto& file : sceneFiles(kShared / "scenes")) {
    if (mustRefuse(file)) continue;
    const auto scene = load(file);
    ASSERT_TRUE(scene) << file << ": " << scene.error().text();
    EXPECT_FALSE(scene->instances.empty()) << file;
    EXPECT_GT(scene->materials.size(), 0U) << file;
  }
}

TEST(ImportFiles, compressedScenesAreRefusedByName) {
  if (!fs::exists(kShared / "scenes")) GTEST_SKIP() << "no shared scenes here";
  const auto draco = load(kShared / "scenes/features/REFUSE_BoxDraco.gltf");
  ASSERT_FALSE(draco);
  EXPECT_EQ(draco.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(draco.error().text(), HasSubstr("KHR_draco_mesh_compression"));
  const auto meshopt = load(kShared / "scenes/features/REFUSE_BoxMeshopt.glb");
  ASSERT_FALSE(meshopt);
  EXPECT_EQ(meshopt.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(meshopt.error().text(), HasSubstr("EXT_meshopt_compression"));
}

TEST(ImportFiles, everyValidatorFileIsAcceptedOrRefusedWithAPlace) {
  if (!fs::exists(kShared / "suites/gltf-validator")) GTEST_SKIP() << "no shared suites here";
  for (const auto& file : sceneFiles(kShared / "suites/gltf-validator")) {
    const auto scene = load(file);
    if (scene) {
      continue;
    }
    EXPECT_FALSE(scene.error().where.empty()) << file;
    EXPECT_FALSE(scene.error().message.empty()) << file;
  }
}

TEST(ImportFiles, validFilesOfTheValidatorAreAccepted) {
  const auto root = kShared / "suites/gltf-validator/test/base/data";
  if (!fs::exists(root)) GTEST_SKIP() << "no shared suites here";
  std::size_t valid = 0;
  for (const auto& file : sceneFiles(root)) {
    if (file.filename() != "valid.gltf" && file.filename() != "valid.glb") continue;
    if (file.parent_path().filename() == "accessor") continue;  // its buffer has no data, and accessors that read it
    const auto scene = load(file);
    EXPECT_TRUE(scene) << file << ": " << scene.error().text();
    ++valid;
  }
  EXPECT_GT(valid, 5U);
}

}  // namespace
}  // namespace radiosity::scene
