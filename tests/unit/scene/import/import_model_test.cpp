// Nodes are read from the JSON without tinygltf, which is ten times as slow: what is read is what tinygltf reads.
#include "server/scene/import/import_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using Json = nlohmann::json;

std::vector<tinygltf::Node> readByTinygltf(const Json& gltf) {
  const Json all{{"asset", {{"version", "2.0"}}}, {"nodes", gltf.value("nodes", Json::array())}};
  const auto text = all.dump(-1, ' ', false, Json::error_handler_t::replace);
  tinygltf::TinyGLTF loader;
  tinygltf::Model model;
  std::string error, warning;
  EXPECT_TRUE(
      loader.LoadASCIIFromString(&model, &error, &warning, text.c_str(), static_cast<unsigned>(text.size()), ""))
      << error;
  return model.nodes;
}

void expectAsByTinygltf(const Document& document) {
  const auto model = parseModel(document);
  ASSERT_TRUE(model) << model.error().text();
  const auto expected = readByTinygltf(document.gltf);
  ASSERT_EQ(model->nodes.size(), expected.size());
  for (std::size_t n = 0; n < expected.size(); ++n) {
    SCOPED_TRACE(n);
    const auto &one = model->nodes[n], &other = expected[n];
    EXPECT_EQ(one.name, other.name);
    EXPECT_EQ(one.mesh, other.mesh);
    EXPECT_EQ(one.skin, other.skin);
    EXPECT_EQ(one.camera, other.camera);
    EXPECT_EQ(one.children, other.children);
    EXPECT_EQ(one.matrix, other.matrix);
    EXPECT_EQ(one.translation, other.translation);
    EXPECT_EQ(one.rotation, other.rotation);
    EXPECT_EQ(one.scale, other.scale);
    EXPECT_EQ(one.weights, other.weights);
  }
}

Json numbers(std::mt19937& random, std::size_t count, int largest = 30) {
  Json values = Json::array();
  for (std::size_t i = 0; i < count; ++i) {
    if (random() % 3 == 0) {
      values.push_back(static_cast<int>(random() % 9) - 4);
    } else {
      const double part = std::uniform_real_distribution<double>(-1.0, 1.0)(random);
      values.push_back(std::ldexp(part, static_cast<int>(random() % 60) - 60 + largest));
    }
  }
  return values;
}

TEST(ImportModel, randomNodesAreReadAsByTinygltf) {
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    GltfBuilder builder;
    const auto mesh = builder.square();
    const std::size_t count = 1 + random() % 60;
    for (std::size_t n = 0; n < count; ++n) {
      Json node = Json::object();
      if (random() % 2 == 0) node["name"] = "n\u00f6de \"" + std::to_string(n) + "\"\n";
      if (random() % 2 == 0) node["mesh"] = mesh;
      if (random() % 3 == 0) {
        node["matrix"] = numbers(random, 16);
      } else {
        if (random() % 2 == 0) node["translation"] = numbers(random, 3);
        if (random() % 2 == 0) node["rotation"] = numbers(random, 4);
        if (random() % 2 == 0) node["scale"] = numbers(random, 3);
      }
      if (2 * n + 2 < count) node["children"] = {2 * n + 1, 2 * n + 2};
      if (random() % 4 == 0) node["weights"] = numbers(random, random() % 4, 15);
      if (random() % 4 == 0) node["extras"] = {{"matrix", "of no node"}};
      builder.node(std::move(node));
    }
    const auto document = builder.document();
    ASSERT_TRUE(document) << document.error().text();
    expectAsByTinygltf(*document);
  }
}

TEST(ImportModel, nodesOfTheSharedScenesAreReadAsByTinygltf) {
  const std::filesystem::path folder(RADIOSITY_SHARED_DIR "/scenes");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is missing";
  std::size_t read = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const auto kind = entry.path().extension();
    if ((kind != ".glb" && kind != ".gltf") || read == 40) continue;
    const auto document = loadDocument(entry.path().string());
    if (!document || !importScene(*document)) continue;
    SCOPED_TRACE(entry.path());
    expectAsByTinygltf(*document);
    ++read;
  }
  EXPECT_GT(read, 0U);
}

TEST(ImportModel, nodesOfNoNodeAreRefusedByTheirPlace) {
  const auto refusedAt = [](const Json& node) {
    GltfBuilder builder;
    (void)builder.square();
    builder.node(node);
    const auto scene = builder.scene();
    return scene ? std::string() : scene.error().where;
  };
  EXPECT_EQ(refusedAt({{"mesh", 0}}), "");
  EXPECT_EQ(refusedAt({{"mesh", 1}}), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(refusedAt({{"mesh", -1}}), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(refusedAt({{"mesh", 1e30}}), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(refusedAt({{"mesh", "0"}}), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(refusedAt({{"mesh", nullptr}}), "test.glb: /nodes/0/mesh");
  EXPECT_EQ(refusedAt({{"children", {1}}}), "test.glb: /nodes/0/children/0");
  EXPECT_EQ(refusedAt({{"children", {0.5}}}), "test.glb: /nodes/0/children/0");
  EXPECT_EQ(refusedAt({{"translation", {0, 0}}}), "test.glb: /nodes/0/translation");
  EXPECT_EQ(refusedAt({{"translation", {0, 0, "0"}}}), "test.glb: /nodes/0/translation/2");
  EXPECT_EQ(refusedAt({{"scale", {0, 0, 1e300}}}), "test.glb: /nodes/0/scale/2");
  EXPECT_EQ(refusedAt({{"matrix", Json::array()}}), "test.glb: /nodes/0/matrix");
  EXPECT_EQ(refusedAt({{"name", 7}}), "test.glb: /nodes/0/name");
  EXPECT_EQ(refusedAt(7), "test.glb: /nodes/0");
}

}  // namespace
}  // namespace radiosity::scene
