// The exporters, on UVs made by hand: every triangle corner gets a UV of its own unless said otherwise.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <glm/common.hpp>
#include <set>
#include <string>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/lightmap/lit_glb_rules.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using Json = nlohmann::json;
namespace fs = std::filesystem;

glm::vec2 uvOf(std::size_t instance, std::size_t triangle, std::size_t corner) {
  return {static_cast<float>(instance * 1000 + triangle), static_cast<float>(corner)};
}

/// Triangles in turn on `page_count` pages.
PatchScene patchesFor(const Scene& scene, std::uint32_t page_count) {
  PatchScene patches;
  patches.pages.resize(page_count, {2, 2});
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    PatchScene::InstanceUv uv;
    const auto triangles = scene.primitives[scene.instances[i].primitive].indices.size() / 3;
    for (std::size_t t = 0; t < triangles; ++t) {
      uv.side[0].page.push_back(static_cast<std::uint32_t>(t) % page_count);
      uv.side[0].corners.push_back({uvOf(i, t, 0), uvOf(i, t, 1), uvOf(i, t, 2)});
    }
    patches.instance_uvs.push_back(std::move(uv));
  }
  return patches;
}

struct Corner {
  glm::dvec3 position;
  glm::vec2 uv;
  std::uint32_t page;
  bool operator<(const Corner& o) const {
    const auto key = [](const Corner& c) {
      return std::tuple(c.position.x, c.position.y, c.position.z, c.uv.x, c.uv.y, c.page);
    };
    return key(*this) < key(o);
  }
  bool operator==(const Corner&) const = default;
};

/// To 1e-7 m: an instance's transform is normalised once more when it is read as a node.
glm::dvec3 rounded(const glm::dvec4& p) { return glm::round(glm::dvec3(p) * 1e7) / 1e7; }

/// World position, lightmap UV and page of each corner that `patches` asked for.
std::multiset<Corner> expected(const Scene& scene, const PatchScene& patches) {
  std::multiset<Corner> out;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const auto& primitive = scene.primitives[scene.instances[i].primitive];
    for (std::size_t k = 0; k < primitive.indices.size(); ++k) {
      const auto position = scene.instances[i].world * glm::dvec4(primitive.positions[primitive.indices[k]], 1.0);
      const auto& uv = patches.instance_uvs[i].side[0];
      out.insert({rounded(position), uv.corners[k / 3][k % 3], uv.page[k / 3]});
    }
  }
  return out;
}

/// The same, read back from a file.
std::multiset<Corner> found(const Document& document, const Scene& scene) {
  std::multiset<Corner> out;
  for (const auto& instance : scene.instances) {
    const auto& primitive = scene.primitives[instance.primitive];
    const auto& json = document.gltf["meshes"][primitive.mesh]["primitives"][primitive.primitive];
    for (const auto index : primitive.indices) {
      const auto position = instance.world * glm::dvec4(primitive.positions[index], 1.0);
      out.insert({rounded(position), primitive.texcoord1[index], json["extras"]["lightmap"].get<std::uint32_t>()});
    }
  }
  return out;
}

/// Exports, writes, reads again and compares corner by corner; returns what was read.
Document roundTrip(const Document& document, std::uint32_t page_count) {
  const auto scene = importScene(document).value();
  const auto patches = patchesFor(scene, page_count);
  const auto lit = withLightmapUvs(document, scene, patches);
  EXPECT_TRUE(lit) << lit.error().text();
  const auto again = parseDocument("lit.glb", writeGlb(*lit).value());
  EXPECT_TRUE(again) << again.error().text();
  const auto read = importScene(*again);
  EXPECT_TRUE(read) << read.error().text();
  if (!read) return {};
  EXPECT_TRUE(found(*again, *read) == expected(scene, patches)) << document.name;
  return *again;
}

TEST(LitGlb, aSquareOnTwoPagesBecomesTwoPrimitives) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  const auto lit = roundTrip(*builder.document(), 2);
  const auto& primitives = lit.gltf["meshes"][0]["primitives"];
  ASSERT_EQ(primitives.size(), 2U);
  EXPECT_EQ(primitives[0]["extras"]["lightmap"], 0);
  EXPECT_EQ(primitives[1]["extras"]["lightmap"], 1);
}

TEST(LitGlb, instancesGetAMeshEach) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.node({{"mesh", mesh}});
  builder.node({{"mesh", mesh}, {"translation", {0, 0, 1}}});
  const auto lit = roundTrip(*builder.document(), 1);
  EXPECT_EQ(lit.gltf["meshes"].size(), 2U);
  EXPECT_NE(lit.gltf["nodes"][0]["mesh"], lit.gltf["nodes"][1]["mesh"]);
}

TEST(LitGlb, whatIsTheFilesOwnAloneStaysWithTheFirstInstance) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["meshes"][mesh]["extras"]["note"] = std::string(1U << 20U, 'x');
  builder.gltf["meshes"][mesh]["primitives"][0]["extras"]["note"] = std::string(1U << 20U, 'y');
  for (int i = 0; i < 100; ++i) builder.node({{"mesh", mesh}, {"translation", {0, 0, i}}});
  const auto lit = roundTrip(*builder.document(), 1);
  ASSERT_EQ(lit.gltf["meshes"].size(), 100U);
  EXPECT_EQ(lit.gltf["meshes"][mesh]["extras"]["note"].get<std::string>().size(), 1U << 20U);
  EXPECT_LT(lit.gltf.dump().size(), 3U << 20U);
}

TEST(LitGlb, tooMuchJsonForManyInstancesIsRefused) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["meshes"][mesh]["name"] = std::string(1U << 20U, 'x');
  for (int i = 0; i < 100; ++i) builder.node({{"mesh", mesh}, {"translation", {0, 0, i}}});
  const auto document = builder.document().value();
  const auto scene = importScene(document).value();
  const auto lit = withLightmapUvs(document, scene, patchesFor(scene, 1));
  ASSERT_FALSE(lit);
  EXPECT_EQ(lit.error().code, ErrorCode::kTooLarge);
}

TEST(LitGlb, gpuInstancesBecomeChildNodes) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  const Json attributes = {{"TRANSLATION", builder.vec3({0, 0, 0, 0, 5, 0})}};
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  builder.gltf["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  builder.node({{"mesh", mesh},
                {"name", "trees"},
                {"translation", {1, 0, 0}},
                {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
  const auto lit = roundTrip(*builder.document(), 1);
  EXPECT_EQ(lit.gltf["nodes"][0]["children"].size(), 2U);
  EXPECT_FALSE(lit.gltf["nodes"][0].contains("mesh"));
  EXPECT_FALSE(lit.gltf.contains("extensionsRequired"));
  EXPECT_EQ(lit.gltf["nodes"][2]["name"], "trees #1");
}

TEST(LitGlb, otherAttributesAreCopiedAndOldLightmapUvsReplaced) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
  primitive["attributes"]["TEXCOORD_0"] = builder.vec2({0, 0, 1, 0, 1, 1, 0, 1});
  primitive["attributes"]["TEXCOORD_1"] = builder.vec2({9, 9, 9, 9, 9, 9, 9, 9});
  const auto colors =
      builder.accessor<std::uint8_t>({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16}, 5121, "VEC4", 4);
  builder.gltf["accessors"][colors]["normalized"] = true;
  primitive["attributes"]["COLOR_0"] = colors;
  primitive["attributes"]["_TAG"] = builder.accessor<std::uint8_t>({7, 8, 9, 10}, 5121, "SCALAR", 1);
  primitive["extras"] = {{"lightmap", "old"}, {"mine", 1}};
  builder.node({{"mesh", mesh}});
  const auto lit = roundTrip(*builder.document(), 1);
  EXPECT_EQ(lit.gltf["meshes"][0]["primitives"][0]["extras"]["mine"], 1);
  EXPECT_TRUE(lit.gltf["meshes"][0]["primitives"][0]["attributes"].contains("_TAG"));
  const auto scene = importScene(lit).value();
  const auto& read = scene.primitives.at(0);
  ASSERT_EQ(read.positions.size(), 6U);  // every corner has its own UV
  for (std::size_t v = 0; v < 6; ++v) {
    const glm::vec2 xy(read.positions[v]);
    EXPECT_EQ(read.texcoord0[v], xy);
    const auto corner = xy == glm::vec2(0, 0) ? 0 : xy == glm::vec2(1, 0) ? 1 : xy == glm::vec2(1, 1) ? 2 : 3;
    EXPECT_EQ(read.color0[v].r * 255.0F, static_cast<float>(4 * corner + 1));
  }
}

TEST(LitGlb, verticesAreSplitOnlyWhereUvsDiffer) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  const auto document = *builder.document();
  const auto scene = importScene(document).value();
  PatchScene patches;
  patches.pages.resize(1, {2, 2});
  const PatchScene::SideUv uv{
      {{glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(1, 1)}, {glm::vec2(0, 0), glm::vec2(1, 1), glm::vec2(0, 1)}},
      {0, 0}};
  patches.instance_uvs.push_back({{uv, {}}});
  const auto lit = withLightmapUvs(document, scene, patches);
  EXPECT_EQ(importScene(*lit)->primitives.at(0).positions.size(), 4U);
}

TEST(LitGlb, texturesThatUsedTheSecondSetFollowItToAFreeNumber) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
  primitive["attributes"]["TEXCOORD_1"] = builder.vec2({0, 0, 1, 0, 1, 1, 0, 1});
  primitive["material"] = 0;
  builder.gltf["textures"] = Json::array({Json::object()});
  builder.gltf["materials"] = Json::array({{{"emissiveTexture", {{"index", 0}, {"texCoord", 1}}}}});
  builder.node({{"mesh", mesh}});
  const auto lit = roundTrip(*builder.document(), 1);
  EXPECT_EQ(lit.gltf["materials"][0]["emissiveTexture"]["texCoord"], 2);
  EXPECT_TRUE(lit.gltf["meshes"][0]["primitives"][0]["attributes"].contains("TEXCOORD_2"));
}

TEST(LitGlb, everySharedSceneRoundTrips) {
  const auto folder = fs::path(RADIOSITY_SHARED_DIR) / "scenes";
  if (!fs::exists(folder)) GTEST_SKIP() << "no shared scenes here";
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    const auto name = entry.path().filename().string();
    if (extension != ".glb" && extension != ".gltf") continue;
    const auto document = loadDocument(entry.path());
    ASSERT_TRUE(document) << name;
    roundTrip(*document, 3);
  }
}

// Of one mesh and material, as of an atlas; which of them emits decides what is seen of the floor.
TEST(LitGlb, whatItsEmissiveTextureLeavesDarkIsSplitOffAndMarkedWhereFacesLieOnEachOther) {
  for (const double height : {0.0, 0.5}) {
    GltfBuilder builder;
    const auto floor = builder.square();
    const auto up = static_cast<float>(height);
    const auto corners = builder.vec3({.1F, .1F, up, .4F, .1F, up, .4F, .4F, up, .1F, .4F, up,  //
                                       .6F, .6F, up, .9F, .6F, up, .9F, .9F, up, .6F, .9F, up});
    const auto uvs = builder.vec2({.2F, 0, .2F, 1, .2F, 1, .2F, 0, .8F, 0, .8F, 1, .8F, 1, .8F, 0});
    builder.gltf["meshes"].push_back({{"primitives",
                                       {{{"attributes", {{"POSITION", corners}, {"TEXCOORD_0", uvs}}},
                                         {"indices", builder.indices({0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7})},
                                         {"material", 0}}}}});
    builder.gltf["materials"] = Json::array({{{"emissiveFactor", {1, 1, 1}}}});
    builder.node({{"mesh", floor}});
    builder.node({{"mesh", 1}});
    const auto document = *builder.document();
    auto scene = importScene(document).value();
    Texture halves;  // black, and white
    halves.width = 2;
    halves.height = 1;
    halves.rgba = {0, 0, 0, 255, 255, 255, 255, 255};
    scene.textures.push_back(std::make_shared<const Texture>(halves));
    scene.materials[0].emissive_texture.texture = 0;
    const auto patches = buildPatchScene(scene, {.texel_budget = 400, .sky = {}}).value();
    const auto lit = withLightmapUvs(document, scene, patches);
    ASSERT_TRUE(lit) << lit.error().text();
    EXPECT_FALSE(lit->gltf["meshes"][floor]["primitives"][0]["extras"].contains("lightmapEmits"));
    const auto& primitives = lit->gltf["meshes"][1]["primitives"];
    EXPECT_FALSE(primitives[0]["extras"].contains("lightmapEmits"));
    ASSERT_EQ(primitives.size(), height > 0.0 ? 1U : 2U);
    if (height > 0.0) continue;
    EXPECT_EQ(primitives[1]["extras"]["lightmapEmits"], false);
    const auto read = importScene(*lit).value();
    EXPECT_LT(read.primitives.at(2).positions[0].x, 0.5) << "the one that is black";
  }
}

TEST(LitGlb, unlitShowsThePages) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["materials"] = Json::array({{{"name", "wall"}, {"doubleSided", true}}});
  builder.gltf["meshes"][mesh]["primitives"][0]["material"] = 0;
  builder.node({{"mesh", mesh}});
  const auto document = *builder.document();
  const auto scene = importScene(document).value();
  const std::vector<Image> pages = {Image(2, 2, glm::vec3(1.0F, 0.0F, 0.5F)), Image(2, 2, glm::vec3(0.0F))};
  const auto glb = writeUnlitGlb(document, scene, patchesFor(scene, 2), pages);
  ASSERT_TRUE(glb) << glb.error().text();
  const auto read = parseDocument("unlit.glb", *glb);
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_THAT(read->gltf["extensionsUsed"], testing::Contains("KHR_materials_unlit"));
  const auto shown = importScene(*read);
  ASSERT_TRUE(shown) << shown.error().text();
  const auto& material = shown->materials.at(shown->primitives.at(0).material);
  EXPECT_FALSE(material.double_sided) << "each side that is seen is there by itself";
  EXPECT_EQ(material.base_color_texture.texcoord, 1);
  const auto& texture = shown->textures.at(material.base_color_texture.texture);
  EXPECT_EQ(texture.rgba[0], 255);
  EXPECT_EQ(texture.rgba[2], 128);
}

TEST(LitGlb, texcoordsHaveNoGapsAndTheirZerosAreSharedByAll) {
  GltfBuilder builder;
  for (int i = 0; i < 3; ++i) builder.node({{"mesh", builder.square()}});
  const auto lit = roundTrip(*builder.document(), 1);
  std::set<std::size_t> views;
  for (const auto& mesh : lit.gltf["meshes"]) {
    const auto& attributes = mesh["primitives"][0]["attributes"];
    ASSERT_TRUE(attributes.contains("TEXCOORD_0") && attributes.contains("TEXCOORD_1"));
    const auto& zeros = lit.gltf["accessors"][attributes["TEXCOORD_0"].get<std::size_t>()];
    EXPECT_EQ(zeros["count"], 6);
    views.insert(zeros["bufferView"].get<std::size_t>());
  }
  EXPECT_EQ(views.size(), 1U);
  const auto scene = importScene(lit).value();
  EXPECT_THAT(scene.primitives.at(0).texcoord0, testing::Each(glm::vec2(0.0F)));
}

TEST(LitGlb, aSetThatMovedLeavesNoGapInOtherMeshes) {
  GltfBuilder builder;
  for (int i = 0; i < 2; ++i) {
    const auto mesh = builder.square();
    auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
    for (const auto* name : {"TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_2"}) {
      if (i == 0 && std::string(name) == "TEXCOORD_2") continue;
      primitive["attributes"][name] = builder.vec2({0, 0, 1, 0, 1, 1, 0, 1});
    }
    primitive["material"] = 0;
    builder.node({{"mesh", mesh}});
  }
  builder.gltf["textures"] = Json::array({Json::object()});
  builder.gltf["materials"] = Json::array({{{"emissiveTexture", {{"index", 0}, {"texCoord", 1}}}}});
  const auto lit = roundTrip(*builder.document(), 1);
  EXPECT_EQ(lit.gltf["materials"][0]["emissiveTexture"]["texCoord"], 3);
  for (const auto& mesh : lit.gltf["meshes"])
    for (const auto* name : {"TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_2", "TEXCOORD_3"})
      EXPECT_TRUE(mesh["primitives"][0]["attributes"].contains(name)) << name;
}

TEST(LitGlb, aCutoffStaysBesideMaskAlone) {
  GltfBuilder builder;
  builder.node({{"mesh", builder.square()}});
  builder.gltf["materials"] =
      Json::array({{{"name", "wall"}}, {{"alphaMode", "BLEND"}}, {{"alphaMode", "MASK"}, {"alphaCutoff", 0.25}}});
  const auto document = *builder.document();
  const auto scene = importScene(document).value();
  const auto lit =
      withLightmapUvs(document, scene, patchesFor(scene, 1)).value();  // not read again: that adds defaults
  EXPECT_FALSE(lit.gltf["materials"][0].contains("alphaCutoff"));
  EXPECT_FALSE(lit.gltf["materials"][1].contains("alphaCutoff"));
  EXPECT_EQ(lit.gltf["materials"][2]["alphaCutoff"], 0.25);
}

TEST(LitGlb, conesOfASpotAreApartInWhatIsWritten) {
  auto gltf = R"({"extensions":{"KHR_lights_punctual":{"lights":[
      {"type":"spot","spot":{"innerConeAngle":0.5,"outerConeAngle":0.5}},
      {"type":"spot","spot":{"innerConeAngle":0.2,"outerConeAngle":0.5}},
      {"type":"spot","spot":{"innerConeAngle":1}},
      {"type":"point"}]}}})"_json;
  separateCones(gltf);
  const auto& lights = gltf["extensions"]["KHR_lights_punctual"]["lights"];
  EXPECT_LT(lights[0]["spot"]["innerConeAngle"].get<double>(), 0.5);
  EXPECT_NEAR(lights[0]["spot"]["innerConeAngle"].get<double>(), 0.5, 1e-6);
  EXPECT_EQ(lights[1]["spot"]["innerConeAngle"], 0.2);
  EXPECT_LT(lights[2]["spot"]["innerConeAngle"].get<double>(), 0.7853981634);  // the outer's default
  EXPECT_FALSE(lights[3].contains("spot"));
}

/// A square of 4 x 4 texels whose alpha is 1 left of 3/8, and 0 right of it: within the second column.
struct CutSquare {
  Document document;
  Scene scene;
  PatchScene patches;

  explicit CutSquare(AlphaMode mode) {
    GltfBuilder builder;
    const auto mesh = builder.square();
    auto& attributes = builder.gltf["meshes"][mesh]["primitives"][0]["attributes"];
    attributes["TEXCOORD_0"] = builder.vec2({0, 0, 1, 0, 1, 1, 0, 1});
    attributes["COLOR_0"] = builder.accessor<float>(std::vector<float>(12, 0.5F), 5126, "VEC3", 3);
    builder.gltf["materials"] = Json::array({{{"name", "leaf"}}});
    builder.gltf["meshes"][mesh]["primitives"][0]["material"] = 0;
    builder.node({{"mesh", mesh}});
    document = *builder.document();
    scene = importScene(document).value();
    Texture texture{8, 1, true, {}};
    for (int x = 0; x < 8; ++x)
      texture.rgba.insert(texture.rgba.end(), {9, 9, 9, x < 3 ? std::uint8_t{255} : std::uint8_t{0}});
    scene.textures.push_back(std::move(texture));
    auto& material = scene.materials[0];
    material.alpha_mode = mode;
    material.base_color_texture = {.texture = 0, .repeat_u = false, .repeat_v = false};
    patches = buildPatchScene(scene, {.texel_budget = 16, .sky = {}}).value();
  }

  [[nodiscard]] Scene unlit() const {
    const Image page(static_cast<int>(patches.pages.at(0).width), static_cast<int>(patches.pages.at(0).height),
                     glm::vec3(0.25F, 0.5F, 1.0F));
    const auto glb = writeUnlitGlb(document, scene, patches, std::vector<Image>{page});
    return importScene(parseDocument("unlit.glb", glb.value()).value()).value();
  }

  /// The unlit picture's pixel at a place of the square.
  [[nodiscard]] glm::ivec4 pixelAt(const Scene& unlit, const glm::vec2& place) const {
    const auto& texture = unlit.textures.at(unlit.materials.at(0).base_color_texture.texture);
    const auto& uv = patches.instance_uvs[0].side[0].corners[0];
    const auto at =
        (uv[0] + (uv[1] - uv[0]) * place.x + (uv[2] - uv[1]) * place.y) * glm::vec2(texture.width, texture.height);
    const auto* rgba =
        &texture.rgba[4 * static_cast<std::size_t>(static_cast<int>(at.y) * texture.width + static_cast<int>(at.x))];
    return {rgba[0], rgba[1], rgba[2], rgba[3]};
  }
};

TEST(LitGlb, unlitCutsOutWhatMaskCutsOutFinerThanItsTexels) {
  const CutSquare square(AlphaMode::kMask);
  ASSERT_EQ(square.patches.surfaces.at(0).width, 4U);
  const auto unlit = square.unlit();
  EXPECT_EQ(unlit.materials.at(0).alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(square.pixelAt(unlit, {0.10F, 0.5F}), glm::ivec4(64, 128, 255, 255));
  EXPECT_EQ(square.pixelAt(unlit, {0.30F, 0.5F}).a, 255);  // of one texel
  EXPECT_EQ(square.pixelAt(unlit, {0.45F, 0.5F}).a, 0);
  EXPECT_EQ(square.pixelAt(unlit, {0.90F, 0.5F}).a, 0);
  EXPECT_TRUE(unlit.primitives.at(0).color0.empty());  // colours are on the page
}

TEST(LitGlb, unlitBlendsAsTheSurfaceDoes) {
  CutSquare square(AlphaMode::kBlend);
  square.scene.materials[0].base_color_texture = {};
  square.scene.materials[0].alpha = 0.4F;
  square.patches = buildPatchScene(square.scene, {.texel_budget = 16, .sky = {}}).value();
  const auto unlit = square.unlit();
  EXPECT_EQ(unlit.materials.at(0).alpha_mode, AlphaMode::kBlend);
  EXPECT_EQ(unlit.materials.at(0).alpha, 1.0F);
  EXPECT_EQ(square.pixelAt(unlit, {0.5F, 0.5F}).a, 102);
}

}  // namespace
}  // namespace radiosity::scene
