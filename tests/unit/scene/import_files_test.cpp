// The importer over files that others made: every scene, and the validator's collection of broken ones.
#include <gtest/gtest.h>

#include <filesystem>
#include <iostream>

#include "server/scene/document/document.h"

namespace radiosity::scene {
namespace {

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

TEST(ImportFiles, everySharedSceneIsAcceptedWithTriangles) {
  if (!fs::exists(kShared / "scenes")) GTEST_SKIP() << "no shared scenes here";
  for (const auto& file : sceneFiles(kShared / "scenes")) {
    const auto scene = load(file);
    ASSERT_TRUE(scene) << file << ": " << scene.error().text();
    EXPECT_FALSE(scene->instances.empty()) << file;
    EXPECT_GT(scene->materials.size(), 0U) << file;
  }
}

// Their names are of a time when they were refused.
TEST(ImportFiles, compressedScenesAreReadAsThePlainOne) {
  if (!fs::exists(kShared / "scenes")) GTEST_SKIP() << "no shared scenes here";
  const auto plain = load(kShared / "scenes/features/Box.glb");
  ASSERT_TRUE(plain) << plain.error().text();
  for (const auto* name : {"REFUSE_BoxDraco.gltf", "REFUSE_BoxMeshopt.glb"}) {
    const auto scene = load(kShared / "scenes/features" / name);
    ASSERT_TRUE(scene) << name << ": " << scene.error().text();
    ASSERT_EQ(scene->primitives.size(), 1U) << name;
    EXPECT_EQ(scene->primitives[0].positions.size(), plain->primitives.at(0).positions.size()) << name;
    EXPECT_EQ(scene->primitives[0].indices.size(), plain->primitives[0].indices.size()) << name;
    EXPECT_EQ(scene->primitives[0].normals.size(), plain->primitives[0].normals.size()) << name;
    EXPECT_EQ(scene->triangles_dropped, 0U) << name;
  }
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
