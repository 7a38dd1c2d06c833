// KHR_draco_mesh_compression: streams as the library's encoder makes them, and broken ones.
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <random>

#include "server/scene/compression/draco_mesh.h"
#include "server/scene/document/document.h"
#include "tests/unit/scene/compressed_meshes.h"
#include "tests/unit/scene/expect_refused.h"

namespace radiosity::scene {
namespace {

using test::addView;
using test::dracoDocument;
using test::dracoStream;
using test::expectRefused;
using test::GltfBuilder;
using test::Grid;
using test::Json;

constexpr const char* kDraco = "KHR_draco_mesh_compression";

Json& extensionIn(GltfBuilder& builder, std::size_t mesh = 0) {
  return builder.gltf["meshes"][mesh]["primitives"][0]["extensions"][kDraco];
}

/// Area in XY of all triangles that face the viewer.
double areaOf(const Primitive& primitive) {
  double area = 0.0;
  for (std::size_t i = 0; i < primitive.indices.size(); i += 3) {
    const auto& a = primitive.positions[primitive.indices[i]];
    const auto u = primitive.positions[primitive.indices[i + 1]] - a;
    const auto v = primitive.positions[primitive.indices[i + 2]] - a;
    area += 0.5 * (u.x * v.y - u.y * v.x);
  }
  return area;
}

TEST(Draco, isReadAsTheSameMeshByEitherMethodAndAnySpeed) {
  const Grid grid(9);
  for (const auto method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
    for (const int speed : {0, 3, 5, 10}) {
      const auto scene = dracoDocument(grid, dracoStream(grid, {method, speed})).scene();
      ASSERT_TRUE(scene) << scene.error().text();
      ASSERT_EQ(scene->primitives.size(), 1U);
      const auto& primitive = scene->primitives[0];
      EXPECT_EQ(primitive.positions.size(), grid.points());
      EXPECT_EQ(primitive.indices.size(), grid.indices.size());
      EXPECT_NEAR(areaOf(primitive), 1.0, 1e-3);
      for (std::size_t p = 0; p < primitive.positions.size(); ++p) {
        const auto& position = primitive.positions[p];
        EXPECT_NEAR(position.x, primitive.texcoord0[p].x, 1e-3) << "attributes go by their ids";
        EXPECT_NEAR(position.y, primitive.texcoord0[p].y, 1e-3);
        EXPECT_NEAR(position.z, 0.25 * position.x * position.y, 1e-3);
      }
    }
  }
}

TEST(Draco, leavesADocumentWithoutTheExtensionWhoseIndicesMeanWhatTheyMeant) {
  const Grid grid(4);
  auto builder = dracoDocument(grid, dracoStream(grid));
  const auto before = builder.gltf;
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto& gltf = document->gltf;
  EXPECT_FALSE(gltf.contains("extensionsRequired"));
  EXPECT_EQ(gltf.dump().find(kDraco), std::string::npos);
  const auto& primitive = gltf["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["attributes"], before["meshes"][0]["primitives"][0]["attributes"]);
  EXPECT_EQ(primitive["indices"], before["meshes"][0]["primitives"][0]["indices"]);
  EXPECT_EQ(gltf["accessors"].size(), before["accessors"].size());
  EXPECT_EQ(gltf["bufferViews"].size(), 4U) << "each has data that is used";
  ASSERT_EQ(document->buffers.size(), 1U) << "the stream is gone";
  test::expectSavedAndReadAsItIs(*document);
}

TEST(Draco, boundsAreThoseOfTheRoundedNumbers) {
  const Grid grid(3);
  auto builder = dracoDocument(grid, dracoStream(grid));
  auto& declared = builder.gltf["accessors"][0];
  declared["min"] = {-7, -7, -7};
  declared["max"] = {7, 7, 7};
  const auto document = builder.document();
  ASSERT_TRUE(document);
  const auto& accessor = document->gltf["accessors"][0];
  EXPECT_NEAR(accessor["min"][0].get<double>(), 0.0, 1e-3);
  EXPECT_NEAR(accessor["max"][2].get<double>(), 0.25, 1e-3);
}

TEST(Draco, whatElseLiesInTheBufferStaysReadable) {
  const Grid grid(2);
  GltfBuilder builder;
  const auto plain = builder.square();
  const auto mesh = test::addDracoMesh(builder, dracoStream(grid), grid);
  test::require(builder, kDraco);
  builder.node({{"mesh", plain}});
  builder.node({{"mesh", mesh}});
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  EXPECT_EQ(document->buffers.size(), 1U);
  const auto scene = importScene(*document);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_NEAR(areaOf(scene->primitives.at(0)), 1.0, 1e-9);
  EXPECT_NEAR(areaOf(scene->primitives.at(1)), 1.0, 1e-3);
}

TEST(Draco, primitivesMayShareAStreamOrAccessorsThatDeclareTheSame) {
  const Grid grid(5);
  auto builder = dracoDocument(grid, dracoStream(grid));
  builder.gltf["meshes"].push_back(builder.gltf["meshes"][0]);  // the same stream
  builder.gltf["meshes"].push_back(builder.gltf["meshes"][0]);
  Grid larger(5);  // another one, which the same accessors describe as well
  for (auto& x : larger.positions) x *= 3.0F;
  extensionIn(builder, 2)["bufferView"] = addView(builder, dracoStream(larger));
  for (const int mesh : {1, 2}) builder.node({{"mesh", mesh}});
  const auto document = builder.document();
  ASSERT_TRUE(document) << document.error().text();
  const auto& meshes = document->gltf["meshes"];
  EXPECT_EQ(meshes[0], meshes[1]);
  EXPECT_NE(meshes[0]["primitives"][0]["attributes"], meshes[2]["primitives"][0]["attributes"]);
  const auto scene = importScene(*document);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_NEAR(areaOf(scene->primitives.at(1)), 1.0, 1e-2);
  EXPECT_NEAR(areaOf(scene->primitives.at(2)), 9.0, 1e-2);
}

TEST(Draco, aPlainCopyBesideTheStreamIsReadInstead) {
  const Grid grid(2);
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  auto& primitive = builder.gltf["meshes"][0]["primitives"][0];
  primitive["extensions"][kDraco] = {{"bufferView", addView(builder, Bytes(8, 0))}, {"attributes", {{"POSITION", 0}}}};
  builder.gltf["extensionsUsed"] = {kDraco};
  const auto scene = builder.scene();
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->primitives.at(0).positions.size(), 4U);
}

TEST(Draco, stripsAndPrimitivesWithoutIndicesBecomeLists) {
  const Grid grid(3);
  for (const bool strip : {true, false}) {
    auto builder = dracoDocument(grid, dracoStream(grid));
    auto& primitive = builder.gltf["meshes"][0]["primitives"][0];
    strip ? primitive["mode"] = 5 : Json(primitive.erase("indices"));
    const auto scene = builder.scene();
    ASSERT_TRUE(scene) << scene.error().text();
    EXPECT_NEAR(areaOf(scene->primitives.at(0)), 1.0, 1e-2);
  }
}

TEST(Draco, anEditBringsCompressedMeshesToo) {
  GltfBuilder room;
  room.node({{"mesh", room.square()}});
  const auto document = room.document();
  ASSERT_TRUE(document);
  const Grid grid(6);
  const auto stream = std::make_shared<const Bytes>(dracoStream(grid));
  const auto views = document->gltf["bufferViews"].size(), accessors = document->gltf["accessors"].size();
  Json patch = Json::array();
  const auto add = [&](const char* path, Json value) {
    patch.push_back({{"op", "add"}, {"path", path}, {"value", std::move(value)}});
  };
  add("/buffers/-", {{"uri", "/uploads/stream"}});
  add("/bufferViews/-", {{"buffer", 1}, {"byteLength", stream->size()}});
  add("/accessors/-", {{"count", grid.points()}, {"componentType", 5126}, {"type", "VEC3"}});
  add("/accessors/-", {{"count", grid.indices.size()}, {"componentType", 5125}, {"type", "SCALAR"}});
  add("/meshes/-", {{"primitives",
                     {{{"attributes", {{"POSITION", accessors}}},
                       {"indices", accessors + 1},
                       {"extensions", {{kDraco, {{"bufferView", views}, {"attributes", {{"POSITION", 0}}}}}}}}}}});
  add("/nodes/-", {{"mesh", 1}});
  add("/scenes/0/nodes/-", 1);
  add("/extensionsRequired", {kDraco});
  const auto edited = editDocument(*document, patch, [&](const std::string&) { return stream; });
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->document.buffers[0], document->buffers[0]);
  EXPECT_EQ(edited->document.gltf["bufferViews"][0], document->gltf["bufferViews"][0]);
  EXPECT_FALSE(edited->document.gltf.contains("extensionsRequired"));
  EXPECT_NEAR(areaOf(edited->scene.primitives.at(1)), 1.0, 1e-3);
}

// To look through all meshes took 53 ms for 100,000 of them, in an edit that costs a few else.
TEST(Draco, anEditOfANodeLooksForNoneInMeshes) {
  GltfBuilder room;
  room.node({{"mesh", room.square()}});
  auto document = room.document();
  ASSERT_TRUE(document);
  document->gltf["meshes"][0]["primitives"][0]["extensions"][kDraco] = {{"bufferView", 0},
                                                                        {"attributes", {{"_NONE", 0}}}};
  const Json patch = {{{"op", "replace"}, {"path", "/nodes/0/translation"}, {"value", {1, 2, 3}}}};
  const auto edited = editDocument(*document, patch);
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->document.gltf["meshes"], document->gltf["meshes"]);
}

TEST(Draco, whatTheAccessorsDeclareMustBeWhatTheStreamHas) {
  const Grid grid(4);
  const auto stream = dracoStream(grid);
  const std::string extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
  const auto changed = [&](const auto& change) {
    auto builder = dracoDocument(grid, stream);
    change(builder);
    return builder;
  };
  const auto invalid = ErrorCode::kInvalidScene;
  expectRefused(changed([](auto& b) { b.gltf["accessors"][1]["count"] = 7; }), invalid, "/accessors/1/count",
                "differ in count");
  expectRefused(changed([](auto& b) {
                  for (const int i : {0, 1, 2}) b.gltf["accessors"][static_cast<std::size_t>(i)]["count"] = 7;
                }),
                invalid, extension, "has 25 vertices, but the accessors declare 7");
  expectRefused(changed([](auto& b) { b.gltf["accessors"][3]["count"] = 30; }), invalid, extension,
                "has 32 triangles, but the accessor of its indices declares 10");
  expectRefused(changed([](auto& b) { b.gltf["accessors"][3]["count"] = 31; }), invalid, "/accessors/3/count",
                "multiple of 3");
  expectRefused(changed([](auto& b) { b.gltf["accessors"][0]["type"] = "VEC4"; }), invalid, "/accessors/0",
                "has 4 components; the Draco stream has 3");
  expectRefused(changed([](auto& b) { b.gltf["accessors"][1]["componentType"] = 5123; }), invalid, "/accessors/1",
                "another component type");
  expectRefused(changed([](auto& b) { b.gltf["accessors"][0]["type"] = "MAT2"; }), invalid, "/accessors/0/type",
                "matrix");
  expectRefused(changed([](auto& b) { extensionIn(b)["attributes"]["POSITION"] = 17; }), invalid, extension,
                "no attribute of id 17");
  expectRefused(changed([](auto& b) { extensionIn(b)["attributes"] = Json::object(); }), invalid, extension,
                "names no attribute");
  expectRefused(changed([](auto& b) { b.gltf["meshes"][0]["primitives"][0]["mode"] = 1; }), invalid,
                "/meshes/0/primitives/0/mode", "must be 4 or 5");
  expectRefused(changed([](auto& b) { extensionIn(b)["bufferView"] = 9; }), invalid, extension + "/bufferView",
                "has 1 entries");
}

TEST(Draco, numbersThatDoNotFitTheAccessorsTypeAreRefused) {
  const Grid grid(19);  // _ID goes up to 199
  auto builder = dracoDocument(grid, dracoStream(grid));
  builder.gltf["accessors"][2]["componentType"] = 5120;
  expectRefused(builder, ErrorCode::kInvalidScene, "/accessors/2", "do not fit");
  auto narrow = dracoDocument(grid, dracoStream(grid));
  narrow.gltf["accessors"][3]["componentType"] = 5121;
  expectRefused(narrow, ErrorCode::kInvalidScene, "/accessors/3/componentType", "too narrow");
}

TEST(Draco, otherGeometryAndOtherVersionsAreRefusedByName) {
  const Grid grid(2);
  const std::string extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
  auto stream = dracoStream(grid);
  stream[5] = 1;
  expectRefused(dracoDocument(grid, stream), ErrorCode::kUnsupported, extension, "bitstream 1.2");
  stream = dracoStream(grid);
  stream[7] = 0;
  expectRefused(dracoDocument(grid, stream), ErrorCode::kUnsupported, extension, "points");
  stream = dracoStream(grid);
  stream[8] = 9;
  expectRefused(dracoDocument(grid, stream), ErrorCode::kUnsupported, extension, "method");
  stream[0] = 'X';
  expectRefused(dracoDocument(grid, stream), ErrorCode::kBadInput, extension, "is no Draco stream");
}

/// A header as the encoder writes it, and then `bytes`.
Bytes streamOf(std::uint8_t method, const Bytes& bytes) {
  Bytes stream = {'D', 'R', 'A', 'C', 'O', 2, 2, 1, method, 0, 0};
  stream.insert(stream.end(), bytes.begin(), bytes.end());
  return stream;
}

TEST(Draco, aStreamThatClaimsBillionsIsRefusedBeforeTheyAreMade) {
  const Grid grid(1);
  const std::string extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
  const Bytes huge = {0xFF, 0xFF, 0xFF, 0xFF, 0x04};  // 1,342,177,279 as a varint
  for (const std::uint8_t method : {0, 1}) {
    Bytes counts = method == 1 ? Bytes{0} : Bytes{};
    for (int i = 0; i < 2; ++i) counts.insert(counts.end(), huge.begin(), huge.end());
    counts.push_back(0);
    counts.insert(counts.end(), huge.begin(), huge.end());
    counts.push_back(0);
    auto builder = dracoDocument(grid, streamOf(method, counts));
    expectRefused(builder, ErrorCode::kInvalidScene, extension, "1342177279 triangles");
    builder.gltf["meshes"][0]["primitives"][0].erase("indices");
    expectRefused(builder, ErrorCode::kTooLarge, extension, "claims 1342177279 triangles");
    builder.gltf["meshes"][0]["primitives"][0]["indices"] = 3;
    builder.gltf["accessors"][3]["count"] = 1'342'177'278;
    expectRefused(builder, ErrorCode::kTooLarge, extension, "once geometry is decoded");
  }
}

// Each attribute that has seams gets tables of all faces at once: the count of them is one byte.
TEST(Draco, tablesOfSeamsCountAgainstTheLimits) {
  const Grid grid(4);
  const std::string extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
  auto stream = dracoStream(grid);
  constexpr std::size_t kSeams = 11 + 3;  // behind the header, the way of traversal, vertices and faces
  const ImportLimits limits{.max_scene_bytes = 200'000};
  EXPECT_TRUE(dracoDocument(grid, stream).scene(limits));
  ASSERT_LT(stream[kSeams], 4);
  stream[kSeams] = 255;
  expectRefused(dracoDocument(grid, stream), ErrorCode::kTooLarge, extension, "seams of 255 attributes", limits);
}

// A stream that many primitives name by other accessors is decoded again for each, with all that nobody asks for.
TEST(Draco, whatIsDecodedAgainAndAgainCountsAgainstTheLimits) {
  const Grid grid(30);
  const auto stream = dracoStream(grid);
  std::vector<DracoAttribute> none;
  DracoRequest request{std::move(none), grid.points(), grid.indices.size() / 3, 1U << 30U, 1U << 30U, "here"};
  const auto mesh = decodeDraco(stream, request);
  ASSERT_TRUE(mesh) << mesh.error().text();
  EXPECT_GE(mesh->attribute_bytes, grid.points() * (3 * 4 + 2 * 4 + 2));
  request.attribute_room = mesh->attribute_bytes - 1;
  const auto refused = decodeDraco(stream, request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooLarge);
}

TEST(Draco, decodedSizeCountsAgainstTheLimits) {
  const Grid grid(100);
  const auto builder = dracoDocument(grid, dracoStream(grid));
  const std::string extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
  ImportLimits limits;
  limits.max_file_bytes = 200'000;  // the file has some 30,000
  expectRefused(builder, ErrorCode::kTooLarge, extension, "more than 200000 bytes once geometry is decoded", limits);
  limits = {.max_scene_bytes = 1'000'000};
  expectRefused(builder, ErrorCode::kTooLarge, extension, "--max-scene-memory", limits);
}

// The library takes a count of bits, four bytes, at its word: two billion of them take seconds and 256 MiB.
TEST(Draco, aCountOfTurnsBeyondTheTextureCoordinatesIsRefusedAtOnce) {
  const Grid grid(12);
  const auto whole = dracoStream(grid);
  const auto begin = std::clock();
  std::size_t found = 0;
  for (std::size_t i = 11; i < whole.size(); ++i) {
    auto broken = whole;
    broken[i] = 0x7F;
    const auto scene = dracoDocument(grid, broken).scene();
    if (!scene && scene.error().message.find("more turns than") != std::string::npos) ++found;
  }
  EXPECT_GE(found, 2U);
  EXPECT_LT(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, 5.0);
}

TEST(Draco, brokenStreamsAreRefusedOrReadAndNothingElse) {
  const Grid grid(12);
  std::mt19937 random(1);
  std::size_t refused = 0;
  for (const auto method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
    const auto whole = dracoStream(grid, {method, 3});
    for (std::size_t length = 1; length < whole.size(); length += 3) {
      const auto scene = dracoDocument(grid, Bytes(whole.begin(), whole.begin() + static_cast<long>(length))).scene();
      EXPECT_FALSE(scene && areaOf(scene->primitives.at(0)) > 2.0);
      refused += scene ? 0 : 1;
    }
    EXPECT_GT(refused, whole.size() / 4);
    for (int i = 0; i < 400; ++i) {
      auto broken = whole;
      for (int edits = 0; edits < 3; ++edits) broken[random() % broken.size()] = static_cast<std::uint8_t>(random());
      const auto scene = dracoDocument(grid, broken).scene();
      EXPECT_TRUE(scene || !(scene.error().where.empty() || scene.error().message.empty()));
    }
  }
}

}  // namespace
}  // namespace radiosity::scene
