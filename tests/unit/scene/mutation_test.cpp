// Broken files made on purpose: bytes flipped, blocks cut, numbers replaced. Nothing may crash; what is refused has a
// place. The same variants on every run.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// Small, so that a mutated file cannot ask for much before it is refused.
const ImportLimits kLimits = {.max_json_depth = 64,
                              .max_file_bytes = std::size_t{1} << 24,
                              .max_image_pixels = std::size_t{1} << 20,
                              .max_vertices = std::size_t{1} << 20,
                              .max_triangles = std::size_t{1} << 18,
                              .max_nodes = std::size_t{1} << 16};

/// Everything the importer knows, in one file.
Bytes richScene() {
  test::GltfBuilder builder;
  const auto mesh = builder.square();
  auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
  primitive["attributes"]["TEXCOORD_0"] = builder.vec2({0, 0, 1, 0, 1, 1, 0, 1});
  primitive["attributes"]["COLOR_0"] = builder.accessor<std::uint8_t>(Bytes(16, 200), 5121, "VEC4", 4);
  builder.gltf["accessors"].back()["normalized"] = true;
  const auto which = builder.indices({1, 3});
  const auto values = builder.vec3({9, 0, 0, 0, 8, 0});
  builder.gltf["accessors"][0]["sparse"] = {{"count", 2},
                                            {"indices", {{"bufferView", which}, {"componentType", 5123}}},
                                            {"values", {{"bufferView", values}}}};
  builder.gltf["materials"] = Json::array({{{"name", "m"}, {"emissiveFactor", {1, 1, 1}}}});
  primitive["material"] = 0;
  const Json attributes = {{"TRANSLATION", builder.vec3({0, 0, 0, 0, 5, 0})}};
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"] =
      Json::array({{{"type", "spot"}, {"spot", {{"outerConeAngle", 0.5}}}}});
  builder.gltf["cameras"] = Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}}});
  builder.node(
      {{"mesh", mesh}, {"children", {1}}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
  builder.node({{"camera", 0}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return builder.glb();
}

Bytes readAll(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void mutate(Bytes& bytes, std::mt19937& random) {
  const auto pick = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  for (std::size_t edits = 1 + pick(4); edits > 0 && !bytes.empty(); --edits) {
    const auto at = pick(bytes.size());
    switch (pick(6)) {
      case 0:
        bytes[at] ^= static_cast<std::uint8_t>(1U << pick(8));
        break;
      case 1:
        bytes[at] = static_cast<std::uint8_t>(pick(256));
        break;
      case 2:
        bytes[at] = "0123456789-.e\"[]{},:"[pick(20)];
        break;
      case 3:  // another digit where there is one: an index, a count, an offset
        for (std::size_t i = at; i < bytes.size(); ++i) {
          if (bytes[i] < '0' || bytes[i] > '9') continue;
          bytes[i] = static_cast<std::uint8_t>('0' + pick(10));
          break;
        }
        break;
      case 4:
        bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                    bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at + 1 + pick(8), bytes.size())));
        break;
      default:
        if (pick(8) == 0) bytes.resize(at);
    }
  }
}

/// Keeps the container's lengths true, so that edits reach what lies inside.
void repairLengths(Bytes& bytes, std::size_t old_size) {
  if (bytes.size() < 20) return;
  const auto put = [&](std::size_t offset, std::size_t value) {
    for (std::size_t b = 0; b < 4; ++b) bytes[offset + b] = static_cast<std::uint8_t>(value >> (8 * b));
  };
  while (bytes.size() < old_size) bytes.insert(bytes.begin() + 20, ' ');
  put(8, bytes.size());
}

bool survives(const Bytes& bytes) {
  const auto document = parseDocument("m.glb", bytes, kLimits);
  if (!document) return !document.error().where.empty() && !document.error().message.empty();
  const auto scene = importScene(*document, kLimits);
  if (!scene) return !scene.error().where.empty() && !scene.error().message.empty();
  (void)writeGlb(*document);
  return true;
}

int countAccepted(const Bytes& seed, int variants) {
  std::mt19937 random(12345);
  int accepted = 0;
  for (int i = 0; i < variants; ++i) {
    auto bytes = seed;
    mutate(bytes, random);
    if (i % 4 != 0) repairLengths(bytes, seed.size());
    EXPECT_TRUE(survives(bytes)) << "variant " << i;
    accepted += parseDocument("m.glb", bytes, kLimits).has_value() ? 1 : 0;
  }
  return accepted;
}

TEST(Mutation, brokenVariantsOfARichSceneNeverCrash) {
  const auto accepted = countAccepted(richScene(), 3000);
  EXPECT_GT(accepted, 100);  // the edits must not all end at the first check
  EXPECT_LT(accepted, 2900);
}

TEST(Mutation, brokenVariantsOfSharedFilesNeverCrash) {
  const auto folder = fs::path(RADIOSITY_SHARED_DIR) / "scenes/features";
  if (!fs::exists(folder)) GTEST_SKIP() << "no shared scenes here";
  for (const auto* name : {"BoxTextured.glb", "playcanvas_Lights.glb", "playcanvas_simple-instancing.glb",
                           "RiggedSimple.glb", "SimpleSparseAccessor.embedded.gltf", "TextureSettingsTest.glb"}) {
    const auto seed = readAll(folder / name);
    ASSERT_FALSE(seed.empty()) << name;
    countAccepted(seed, 400);
  }
}

TEST(Mutation, wrongValuesInEveryPlaceOfTheJsonNeverCrash) {
  const auto glb = richScene();
  const auto chunks = splitGlb("m.glb", glb).value();
  const auto gltf = Json::parse(chunks.json);
  const auto flat = gltf.flatten();
  const std::vector<Json> wrong = {nullptr,
                                   true,
                                   -1,
                                   0,
                                   7,
                                   1e30,
                                   2147483647,
                                   4294967295U,
                                   "x",
                                   "",
                                   Json::array(),
                                   Json::object(),
                                   Json::array({1, 2, 3}),
                                   Json{{"a", 1}}};
  std::size_t variants = 0;
  for (const auto& [pointer, leaf] : flat.items()) {
    for (auto at = Json::json_pointer(pointer); !at.empty(); at.pop_back()) {
      for (const auto& value : wrong) {
        auto broken = gltf;
        broken[at] = value;
        ASSERT_TRUE(survives(joinGlb(broken.dump(), chunks.bin))) << at << " = " << value;
        ++variants;
      }
    }
  }
  EXPECT_GT(variants, 1000U);
}

}  // namespace
}  // namespace radiosity::scene
