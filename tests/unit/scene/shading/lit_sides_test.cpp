// Which sides of double-sided surfaces get texels, and what files and pages make of them.
#include "server/scene/shading/lit_sides.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/gtc/matrix_transform.hpp>

#include "server/scene/burial/burial_record.h"
#include "server/scene/charts/build.h"
#include "server/scene/lightmap/lightmap.h"
#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/gltf_builder.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene {
namespace {

using test::addQuad;
using test::build;

Material sheet() {
  Material material;
  material.double_sided = true;
  return material;
}

/// A room of 4 x 3 x 5 m with a lamp below its ceiling. Instance 0 is the room, 1 the lamp.
Scene litRoom(bool inward) {
  Scene scene;
  test::place(scene, test::box({0, 0, 0}, {4, 3, 5}, inward), glm::dmat4(1.0), sheet());
  Primitive lamp;
  addQuad(lamp, {1.5, 2.9, 2}, {2.5, 2.9, 2}, {2.5, 2.9, 3}, {1.5, 2.9, 3});
  Material glow;
  glow.emission = glm::vec3(100.0F);
  test::place(scene, std::move(lamp), glm::dmat4(1.0), glow);
  return scene;
}

std::vector<const Surface*> surfacesOf(const PatchScene& patches, std::uint32_t instance) {
  std::vector<const Surface*> some;
  for (const Surface& surface : patches.surfaces)
    if (surface.instance == instance) some.push_back(&surface);
  return some;
}

glm::vec3 normalOf(const PatchScene& patches, const Surface& surface) {
  return patches.triangles[surface.first_triangle].normal;
}

glm::vec3 middleOf(const Surface& surface) { return 0.5F * (surface.bounds_min + surface.bounds_max); }

/// Of the unit box, which is around the room.
bool facesInward(const PatchScene& patches, const Surface& surface) {
  return glm::dot(normalOf(patches, surface), middleOf(surface)) < 0.0F;
}

TEST(LitSides, outsideOfALitRoomSharesBlackTexels) {
  const PatchScene patches = build(litRoom(true), 1000);
  ASSERT_NE(patches.black.page, kNone);
  for (const Surface* wall : surfacesOf(patches, 0)) {
    EXPECT_FALSE(wall->flipped);
    EXPECT_NE(wall->first_node[0], kNone);
    EXPECT_EQ(wall->first_node[1], kNone);
    EXPECT_EQ(wall->place[1].page, kNone);
    EXPECT_TRUE(wall->shows_back);
  }
  const Page& page = patches.pages[patches.black.page];
  const glm::vec2 black = (glm::vec2(patches.black.x, patches.black.y) + 0.5F * PatchScene::kBlackSide) /
                          glm::vec2(page.width, page.height);
  const auto& outside = patches.instance_uvs[0].side[1];
  ASSERT_EQ(outside.page.size(), 12U);
  for (std::size_t t = 0; t < 12; ++t) {
    EXPECT_EQ(outside.page[t], patches.black.page);
    for (const auto& uv : outside.corners[t]) EXPECT_EQ(uv, black);
  }
}

TEST(LitSides, aRoomTurnedInsideOutHasItsTexelsInside) {
  const PatchScene twin = build(litRoom(true), 1000), patches = build(litRoom(false), 1000);
  ASSERT_EQ(surfacesOf(patches, 0).size(), 6U);
  for (const Surface* wall : surfacesOf(patches, 0)) {
    EXPECT_TRUE(wall->flipped);
    EXPECT_TRUE(facesInward(patches, *wall));
    EXPECT_EQ(wall->first_node[1], kNone);
  }
  EXPECT_NEAR(test::areaOf(patches, 0, 0), test::areaOf(twin, 0, 0), 1e-3);
  // The back of the file's triangles has the texels, their front is black.
  const auto& uvs = patches.instance_uvs[0];
  for (std::size_t t = 0; t < 12; ++t) {
    EXPECT_EQ(uvs.side[0].corners[t][0], uvs.side[0].corners[t][1]);
    EXPECT_NE(uvs.side[1].corners[t][0], uvs.side[1].corners[t][1]);
  }
}

TEST(LitSides, nobodySeesTheInsideOfABox) {
  for (const double sunk : {0.0, 0.3}) {  // into the floor
    Scene scene = litRoom(true);
    test::place(scene, test::box({1, -sunk, 1}, {2, 1 - sunk, 2}), glm::dmat4(1.0), sheet());
    const PatchScene patches = build(scene, 1000);
    for (const Surface* face : surfacesOf(patches, 2)) {
      EXPECT_EQ(face->first_node[1], kNone) << sunk;
      EXPECT_FALSE(facesInward(patches, *face) && face->flipped) << sunk;
    }
    const auto& inside = patches.instance_uvs[2].side[1];
    const auto shown = std::ranges::count_if(inside.page, [](std::uint32_t page) { return page != kNone; });
    // The underside of a box that reaches through the floor is seen from below it.
    EXPECT_LE(shown, sunk > 0.0 ? 10 : 2);
  }
}

TEST(LitSides, aPartitionHasTexelsOnBothSides) {
  Scene scene = litRoom(true);
  Primitive screen;
  addQuad(screen, {1, 0, 1}, {3, 0, 1}, {3, 2, 1}, {1, 2, 1});
  test::place(scene, std::move(screen), glm::dmat4(1.0), sheet());
  const PatchScene patches = build(scene, 1000);
  const auto sides = surfacesOf(patches, 2);
  ASSERT_EQ(sides.size(), 1U);
  EXPECT_NE(sides[0]->first_node[1], kNone);
  EXPECT_NE(sides[0]->place[0], sides[0]->place[1]);
  EXPECT_EQ(patches.instance_uvs[2].side[1].page.size(), 2U);
}

TEST(LitSides, aShiningBoxKeepsItsFronts) {
  for (const bool inward : {true, false}) {
    Scene scene;
    Material glow = sheet();
    glow.emission = glm::vec3(1.0F);
    test::place(scene, test::box({0, 0, 0}, {1, 1, 1}, inward), glm::dmat4(1.0), glow);
    for (const Surface& face : build(scene, 100).surfaces) {
      EXPECT_FALSE(face.flipped);
      EXPECT_NE(face.first_node[0], kNone);
    }
  }
}

TEST(LitSides, singleSidedScenesAreLeftAlone) {
  Scene scene = litRoom(true);
  scene.materials[0].double_sided = false;
  const PatchScene patches = build(scene, 1000);
  EXPECT_EQ(patches.black.page, kNone);
  for (const Surface& surface : patches.surfaces) EXPECT_FALSE(surface.shows_back || surface.flipped);
  EXPECT_TRUE(patches.instance_uvs[0].side[1].page.empty());
}

/// The double-sided room is, patch by patch, the single-sided one: it costs as much.
TEST(LitSides, aDoubleSidedRoomHasThePatchesOfItsTwin) {
  Scene twin = litRoom(true);
  twin.materials[0].double_sided = false;
  EXPECT_EQ(build(litRoom(true), 1000).nodeCount(), build(twin, 1000).nodeCount());
}

TEST(LitSides, lightThatComesLaterNeedsNewTexels) {
  const Scene scene = litRoom(true);
  const PatchScene patches = build(scene, 1000);
  const auto reaches = [&](const Scene& next, const Sky& sky = {}) {
    return reachesDarkSides(patches, scene, {}, next, sky);
  };
  EXPECT_FALSE(reaches(scene));
  Scene brighter = scene;
  brighter.materials[1].emission = glm::vec3(500.0F, 1.0F, 1.0F);
  EXPECT_FALSE(reaches(brighter));
  Scene inside = scene;
  inside.lights.push_back({});
  inside.lights[0].position = {2, 1, 2};
  inside.lights[0].intensity = glm::vec3(10.0F);
  EXPECT_FALSE(reaches(inside));
  Scene outside = inside;
  outside.lights[0].position = {2, 4, 2};
  EXPECT_TRUE(reaches(outside));
  EXPECT_TRUE(reaches(scene, {glm::vec3(1.0F), glm::vec3(0.0F)}));
  Scene glowing = scene;
  glowing.materials[0].emission = glm::vec3(1.0F);
  EXPECT_TRUE(reaches(glowing));
}

/// Closed rooms in a row, each with a lamp and a small screen.
TEST(LitSides, smallThingsAreLitInABuildingOfManyLamps) {
  Scene scene;
  std::vector<std::uint32_t> screens;
  for (int i = 0; i < 60; ++i) {
    const double x = 5.0 * i;
    test::place(scene, test::box({x, 0, 0}, {x + 4, 3, 5}, true), glm::dmat4(1.0), sheet());
    Primitive screen;
    addQuad(screen, {x + 1, 0.5, 1}, {x + 1.2, 0.5, 1}, {x + 1.2, 0.7, 1}, {x + 1, 0.7, 1});
    screens.push_back(test::place(scene, std::move(screen), glm::dmat4(1.0), sheet()));
    PunctualLight light;
    light.position = {x + 2, 2.5, 2.5};
    light.intensity = glm::vec3(10.0F);
    scene.lights.push_back(light);
  }
  const PatchScene patches = build(scene, 6000);
  for (const auto screen : screens)
    for (const Surface* surface : surfacesOf(patches, screen)) EXPECT_NE(surface->first_node[1], kNone) << screen;
}

/// An empty room of one mesh, with a window of a hundredth of its walls.
TEST(LitSides, daylightComesThroughASmallWindow) {
  Scene scene;
  Primitive room = test::box({0, 0, 0}, {4, 3, 5}, false);  // turned inside out, as some exporters leave it
  room.indices.resize(room.indices.size() - 6);             // without its right wall, which has a window
  addQuad(room, {4, 0, 0}, {4, 3, 0}, {4, 3, 5}, {4, 0, 5});
  room.indices.resize(room.indices.size() - 6);
  const auto strip = [&](double y0, double y1, double z0, double z1) {
    addQuad(room, {4, y0, z0}, {4, y1, z0}, {4, y1, z1}, {4, y0, z1});
  };
  strip(0, 1, 0, 5);
  strip(2, 3, 0, 5);
  strip(1, 2, 0, 2);
  strip(1, 2, 2.9, 5);
  test::place(scene, std::move(room), glm::dmat4(1.0), sheet());
  scene.sky = Sky{glm::vec3(100.0F), glm::vec3(100.0F)};
  for (const Surface& wall : build(scene, 2000).surfaces) EXPECT_NE(wall.first_node[1], kNone);
}

/// One material for all, as of a texture atlas: it is bright where the lamp's coordinates are alone.
TEST(LitSides, onlyWhatItsTextureMakesShineIsALamp) {
  Scene scene = litRoom(true);
  Texture atlas;
  atlas.width = 2;
  atlas.height = 1;
  atlas.rgba = {0, 0, 0, 255, 255, 255, 255, 255};
  scene.textures = {atlas};
  scene.materials[0].emission = scene.materials[1].emission;
  for (auto& material : scene.materials) material.emissive_texture.texture = 0;
  auto room = scene.primitives[0], lamp = scene.primitives[1];
  room.texcoord0.assign(room.positions.size(), glm::vec2(0.2F, 0.5F));
  lamp.texcoord0.assign(lamp.positions.size(), glm::vec2(0.8F, 0.5F));
  scene.primitives = {room, lamp};
  for (auto& material : scene.materials) material.emissive_texture.nearest = true;
  const PatchScene patches = build(scene, 1000);
  for (const Surface* wall : surfacesOf(patches, 0)) EXPECT_EQ(wall->first_node[1], kNone);
}

TEST(LitSides, aClosedLampIsSwitchedWithoutNewTexels) {
  Scene scene = litRoom(true);
  Material glow = sheet();
  glow.emission = glm::vec3(50.0F);
  const auto bulb = test::place(scene, test::box({1, 1, 1}, {1.2, 1.2, 1.2}), glm::dmat4(1.0), glow);
  Scene off = scene;
  off.materials[bulb].emission = glm::vec3(0.0F);
  EXPECT_FALSE(reachesDarkSides(build(off, 1000), off, {}, scene, {}));
  for (const Surface* face : surfacesOf(build(scene, 1000), bulb)) EXPECT_EQ(face->first_node[1], kNone);
}

TEST(LitSides, anEditElsewhereOrInTheDarkTurnsNothing) {
  Scene scene = litRoom(false);
  const auto chair = test::place(scene, test::box({1, 0, 1}, {1.5, 0.5, 1.5}), glm::dmat4(1.0), sheet());
  const PatchScene before = build(scene, 1000);
  for (const bool dark : {false, true}) {
    Scene after = scene;
    after.instances[chair].world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, 0, 0.3));
    if (dark) after.materials[1].emission = glm::vec3(0.0F);
    ChartOptions options;
    options.texel_budget = 1000;
    const FormerScene former{scene, before};
    const PatchScene patches = buildPatchScene(after, options, &former).value();
    ASSERT_EQ(patches.surfaces.size(), before.surfaces.size());
    for (std::size_t s = 0; s < patches.surfaces.size(); ++s) {
      EXPECT_EQ(patches.surfaces[s].flipped, before.surfaces[s].flipped) << dark;
      EXPECT_EQ(patches.surfaces[s].place, before.surfaces[s].place) << dark;
    }
  }
}

void expectTheSameLayout(const PatchScene& a, const PatchScene& b) {
  ASSERT_EQ(a.surfaces.size(), b.surfaces.size());
  for (std::size_t s = 0; s < a.surfaces.size(); ++s) {
    EXPECT_EQ(a.surfaces[s].flipped, b.surfaces[s].flipped) << s;
    EXPECT_EQ(a.surfaces[s].place, b.surfaces[s].place) << s;
    EXPECT_EQ(a.surfaces[s].first_node, b.surfaces[s].first_node) << s;
  }
  EXPECT_EQ(a.instance_uvs, b.instance_uvs);
  EXPECT_EQ(a.node_area, b.node_area);
}

/// A room that is turned inside out, an open box in it, and in that a light.
Scene lightInABox() {
  Scene scene = litRoom(false);
  auto box = test::box({1, 1, 1}, {2, 2, 2});
  box.indices.erase(box.indices.begin(), box.indices.begin() + 6);  // its bottom
  test::place(scene, std::move(box), glm::translate(glm::dmat4(1.0), glm::dvec3(0, -1, 0)), sheet());
  scene.lights.push_back({.position = {1.5, 0.5, 1.5}, .intensity = glm::vec3(10.0F)});
  return scene;
}

TEST(LitSides, asItWasOnceASceneIsLaidOutAgainWhateverItsLampsAreNow) {
  ChartOptions options;
  options.texel_budget = 1000;
  const Scene scene = lightInABox();
  const PatchScene patches = build(scene, 1000);
  const auto sides = sidesOf(scene, patches);
  const auto has = [&](unsigned bit) { return std::ranges::any_of(sides, [&](auto of) { return (of & bit) != 0; }); };
  EXPECT_TRUE(has(kFlipped) && has(kBackLit) && has(kShowsBack));
  Scene after = scene;
  after.lights[0].position = {3, 1, 3};
  EXPECT_NE(build(after, 1000).nodeCount(), patches.nodeCount());
  expectTheSameLayout(buildAgain(after, options, sides).value().patches, patches);
  Scene dark = scene;  // its outside, which no light reaches, has a texel a face
  test::place(dark, test::box({10, 0, 0}, {14, 3, 5}, true), glm::dmat4(1.0), sheet());
  const PatchScene coarse = build(dark, 1000);
  const auto of_dark = sidesOf(dark, coarse);
  EXPECT_TRUE(std::ranges::any_of(of_dark, [](auto of) { return (of & kLeftCoarse) != 0; }));
  dark.lights.push_back({.position = {12, 1, 2}, .intensity = glm::vec3(10.0F)});
  expectTheSameLayout(buildAgain(dark, options, of_dark).value().patches, coarse);
}

TEST(LitSides, sidesThatASceneCannotHaveAreRefused) {
  const Scene scene = litRoom(true);
  const auto sides = sidesOf(scene, build(scene, 1000));
  const auto isRefused = [&](const SideBits& bits) {
    const auto built = buildAgain(scene, {.texel_budget = 1000, .sky = {}}, bits);
    return !built && built.error().code == ErrorCode::kBadInput;
  };
  EXPECT_FALSE(isRefused(sides));
  EXPECT_TRUE(isRefused({}));
  EXPECT_TRUE(isRefused(SideBits(sides.begin() + 1, sides.end())));
  const auto with = [&](std::size_t surface, unsigned bits) {
    auto others = sides;
    others[surface] = static_cast<std::uint8_t>(bits);
    return others;
  };
  EXPECT_TRUE(isRefused(with(0, 16)));
  EXPECT_TRUE(isRefused(with(0, kBackLit))) << "one sees what is lit";
  EXPECT_TRUE(isRefused(with(sides.size() - 1, kShowsBack))) << "the lamp is single-sided";
  Scene single = scene;
  single.materials[0].double_sided = false;
  EXPECT_TRUE(sidesOf(single, build(single, 1000)).empty());
}

TEST(LitSides, theTreeAtHandIsAskedForOnlyWhereSomethingIsToBeTracedAndAnswersAlike) {
  const Scene scene = litRoom(true);
  const PatchScene patches = build(scene, 1000);
  const auto own = std::make_shared<const geometry::RayScene>(raySceneOf(patches));
  int asked = 0;
  const auto reaches = [&](const glm::dvec3& place) {
    Scene next = scene;
    next.lights.push_back({.position = place, .intensity = glm::vec3(10.0F)});
    return reachesDarkSides(patches, scene, {}, next, {}, [&] { return ++asked, own; });
  };
  EXPECT_FALSE(reachesDarkSides(patches, scene, {}, scene, {}, [&] { return ++asked, own; }));
  EXPECT_EQ(asked, 0);
  EXPECT_FALSE(reaches({2, 1, 2}));
  EXPECT_TRUE(reaches({2, 4, 2}));
  EXPECT_EQ(asked, 2);
}

TEST(LitSides, skyAndSunReachTheOutside) {
  Scene sky = litRoom(true);
  sky.sky = Sky{glm::vec3(100.0F), glm::vec3(0.0F)};
  Scene sun = litRoom(true);
  PunctualLight light;
  light.kind = LightKind::kDirectional;
  light.direction = glm::normalize(glm::dvec3(0.2, -1.0, 0.1));
  light.intensity = glm::vec3(1000.0F);
  sun.lights.push_back(light);
  for (const Scene* scene : {&sky, &sun}) {
    const PatchScene patches = build(*scene, 1000);
    const auto walls = surfacesOf(patches, 0);
    const auto top = std::ranges::find_if(walls, [](const Surface* s) { return middleOf(*s).y > 0.2F; });
    ASSERT_NE(top, walls.end());
    EXPECT_NE((*top)->first_node[1], kNone);
  }
}

/// A square with everything a vertex can have, double-sided, under a light above and one below.
Document squareBetweenLights(test::GltfBuilder& builder) {
  using nlohmann::json;
  const auto mesh = builder.square();
  auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
  primitive["attributes"]["NORMAL"] = builder.vec3({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitive["material"] = 0;
  builder.gltf["materials"] = json::array({{{"doubleSided", true}}});
  builder.gltf["extensionsUsed"] = json::array({"KHR_lights_punctual"});
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"] = json::array({{{"type", "point"}, {"intensity", 10.0}}});
  builder.node({{"mesh", mesh}});
  for (const double z : {1.0, -1.0})
    builder.node({{"translation", {0.5, 0.5, z}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return *builder.document();
}

TEST(LitSides, theLitFileHasAFrontAndAFlippedCopy) {
  test::GltfBuilder builder;
  const Document document = squareBetweenLights(builder);
  const Scene scene = importScene(document).value();
  const PatchScene patches = build(scene, 64);
  const auto lit = withLightmapUvs(document, scene, patches);
  ASSERT_TRUE(lit) << lit.error().text();
  const auto& primitives = lit->gltf["meshes"][0]["primitives"];
  ASSERT_EQ(primitives.size(), 2U);
  EXPECT_FALSE(primitives[0]["extras"].contains("lightmapSide"));
  EXPECT_EQ(primitives[1]["extras"]["lightmapSide"], "back");
  EXPECT_FALSE(lit->gltf["materials"][0].value("doubleSided", false));
  EXPECT_TRUE(document.gltf["materials"][0]["doubleSided"].get<bool>()) << "what clients edit stays as it is";
  const Scene read = importScene(*lit).value();
  ASSERT_EQ(read.primitives.size(), 2U);
  const auto facing = [&](std::size_t p) {
    const Primitive& primitive = read.primitives[p];
    const auto at = [&](std::size_t k) { return primitive.positions[primitive.indices[k]]; };
    return glm::cross(at(1) - at(0), at(2) - at(0)).z;
  };
  EXPECT_GT(facing(0), 0.0);
  EXPECT_LT(facing(1), 0.0);
  const auto normals = read.primitives[1].normals;
  for (const auto& normal : normals) EXPECT_EQ(normal, glm::vec3(0, 0, -1));
  EXPECT_NE(read.primitives[0].texcoord1, read.primitives[1].texcoord1);
}

TEST(LitSides, whatIsHiddenKeepsItsDoubleSidedMaterial) {
  test::GltfBuilder builder;
  squareBetweenLights(builder);
  const auto other = builder.square();
  builder.gltf["meshes"][other]["primitives"][0]["material"] = 0;
  const auto node = builder.node({{"mesh", other}});
  builder.gltf["nodes"][node]["extensions"]["KHR_node_visibility"]["visible"] = false;
  builder.gltf["extensionsUsed"].push_back("KHR_node_visibility");
  const Document document = *builder.document();
  const Scene scene = importScene(document).value();
  const auto lit = withLightmapUvs(document, scene, build(scene, 64)).value();
  const auto material = lit.gltf["meshes"][other]["primitives"][0]["material"].get<std::size_t>();
  EXPECT_NE(material, 0U);
  EXPECT_TRUE(lit.gltf["materials"][material]["doubleSided"].get<bool>());
}

TEST(LitSides, blackTexelsStayBlackInCoarserMips) {
  const PatchScene patches = build(litRoom(true), 1000);
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(100.0F));
  auto page = assemblePages(patches, values).at(patches.black.page);
  for (int mip = 0; mip < 2; ++mip) {
    const auto at = [&](std::uint32_t from) { return static_cast<int>((from + PatchScene::kBlackSide / 2) >> mip); };
    EXPECT_EQ(page.irradiance.at(at(patches.black.x), at(patches.black.y)), glm::vec3(0.0F)) << mip;
    page = coarserMip(page);
  }
}

}  // namespace
}  // namespace radiosity::scene
