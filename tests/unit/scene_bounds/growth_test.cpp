// Each thing that a scene can have, ten and a hundred times as often: time and memory to load it grow as n log n. Time
// is that of the processor, so that a busy machine changes nothing; the bounds are several times what is measured, and
// what grows with the square passes none of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <fstream>
#include <functional>
#include <random>
#include <string>

#include "server/scene/burial/burial_record.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {
namespace {

constexpr int kBase = 100;
/// Of n log n, between one size and the next; below so many seconds there is nothing to compare.
constexpr double kSlack = 3.0, kLeastSeconds = 0.1;
/// A hundred times as many, all in all.
constexpr double kMostSeconds = 20.0;
/// Of each thing: twice to four times what the largest of them takes, beside what any scene does.
constexpr double kMibEach = 0.1, kMibAtAll = 96.0;

double cpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double statusMib(const std::string& member) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(member + ":")) return std::stod(line.substr(member.size() + 1)) / 1024.0;
  return 0.0;
}

/// Of memory, from now on. False: this kernel does not let us.
bool resetPeak() {
  std::ofstream clear("/proc/self/clear_refs");
  return static_cast<bool>(clear << "5" << std::flush);
}

struct Cost {
  double seconds = 0.0, mib = 0.0;
  std::size_t warnings = 0;
};

Cost load(const Bytes& glb) {
  const bool measures_memory = resetPeak();
  const double before = statusMib("VmRSS"), start = cpuSeconds();
  Cost cost;
  auto document = parseDocument("growth.glb", glb);
  if (!document) ADD_FAILURE() << document.error().text();
  if (!document) return cost;
  const auto edited = importEdited(std::move(*document), nullptr);
  if (!edited) ADD_FAILURE() << edited.error().text();
  if (!edited) return cost;
  ChartOptions options;
  options.texel_budget = 1'000;
  const auto built = buildWithRecord(edited->scene, options);
  if (!built) ADD_FAILURE() << built.error().text();
  if (!built) return cost;
  const ShadingNormals normals(edited->scene, built->patches);
  const auto materials = shadePatches(edited->scene, built->patches);
  cost.seconds = cpuSeconds() - start;
  if (measures_memory) cost.mib = statusMib("VmHWM") - before;
  cost.warnings = built->patches.warnings.size();
  return cost;
}

/// A mesh for nodes to place, and the nodes.
struct Thing {
  const char* name;
  std::function<void(GltfBuilder&, int)> add;
  int steps = 3;  ///< each has ten times as many
};

void PrintTo(const Thing& thing, std::ostream* out) { *out << thing.name; }

std::size_t meshOf(GltfBuilder& builder, const std::vector<float>& positions, const std::vector<std::uint16_t>& index) {
  Json primitive = {{"attributes", {{"POSITION", builder.vec3(positions)}}}};
  if (!index.empty()) primitive["indices"] = builder.indices(index);
  builder.gltf["meshes"].push_back({{"primitives", Json::array({primitive})}});
  return builder.gltf["meshes"].size() - 1;
}

std::size_t cubeWithout(GltfBuilder& builder, std::size_t faces) {
  std::vector<float> positions;
  for (int i = 0; i < 8; ++i)
    for (const int bit : {4, 2, 1}) positions.push_back((i & bit) != 0 ? 0.5F : -0.5F);
  std::vector<std::uint16_t> corners{0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1,
                                     2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3};
  corners.resize(corners.size() - 6 * faces);
  return meshOf(builder, positions, corners);
}
std::size_t cube(GltfBuilder& builder) { return cubeWithout(builder, 0); }
std::size_t openCube(GltfBuilder& builder) { return cubeWithout(builder, 1); }
std::size_t tube(GltfBuilder& builder) { return cubeWithout(builder, 2); }

/// Nodes of one mesh, whose places come from a seeded source.
std::function<void(GltfBuilder&, int)> placed(std::size_t (*mesh_of)(GltfBuilder&),
                                              std::function<Json(std::mt19937&, int, int)> node_of) {
  return [=](GltfBuilder& builder, int n) {
    const auto mesh = mesh_of(builder);
    std::mt19937 random(1);
    for (int i = 0; i < n; ++i) {
      auto node = node_of(random, i, n);
      node["mesh"] = mesh;
      builder.node(std::move(node));
    }
  };
}

double uniform(std::mt19937& random) { return std::uniform_real_distribution<double>(0.0, 1.0)(random); }
std::size_t square(GltfBuilder& builder) { return builder.square(); }

/// Turned any way.
Json leaning(std::mt19937& random, double spread, const Json& scale) {
  std::array<double, 4> turn{};
  double square = 0.0;
  for (auto& part : turn) {
    part = std::normal_distribution<double>()(random);
    square += part * part;
  }
  for (auto& part : turn) part /= std::sqrt(square);
  return {{"translation", {spread * uniform(random), spread * uniform(random), spread * uniform(random)}},
          {"rotation", turn},
          {"scale", scale}};
}

void addMaterials(GltfBuilder& builder, int n) {
  const auto mesh = builder.square();
  const auto side = static_cast<int>(std::sqrt(n)) + 1;
  for (int i = 0; i < n; ++i) {
    builder.gltf["materials"].push_back({{"emissiveFactor", {1.0 * i / n, 1.0, 1.0}}});
    auto copy = builder.gltf["meshes"][mesh];
    copy["primitives"][0]["material"] = i;
    builder.gltf["meshes"].push_back(copy);
    builder.node({{"mesh", builder.gltf["meshes"].size() - 1}, {"translation", {2 * (i % side), 2 * (i / side), 0}}});
  }
}

void addChain(GltfBuilder& builder, int n) {
  const auto mesh = builder.square();
  for (int i = 0; i < n; ++i) {
    Json node = {{"mesh", mesh}, {"translation", {0, 0, 1}}};
    if (i + 1 < n) node["children"] = {i + 1};
    builder.node(std::move(node));
  }
}

void addPrimitives(GltfBuilder& builder, int n) {
  const auto mesh = builder.square();
  auto& primitives = builder.gltf["meshes"][mesh]["primitives"];
  const Json first = primitives[0];
  for (int i = 1; i < n; ++i) primitives.push_back(first);
  builder.node({{"mesh", mesh}});
}

void addLights(GltfBuilder& builder, int n) {
  builder.gltf["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 9.0}}};
  builder.gltf["extensionsUsed"] = {"KHR_lights_punctual"};
  builder.node({{"mesh", builder.square()}});
  for (int i = 0; i < n; ++i)
    builder.node({{"translation", {0.001 * i, 0, 1}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
}

/// A disc of triangles that all meet in its middle.
void addDisc(GltfBuilder& builder, int n) {
  std::vector<float> positions;
  for (int i = 0; i < n; ++i) {
    const auto corner = [&](int k) {
      positions.push_back(std::cos(2.0F * 3.14159265F * static_cast<float>(k) / static_cast<float>(n)));
      positions.push_back(std::sin(2.0F * 3.14159265F * static_cast<float>(k) / static_cast<float>(n)));
      positions.push_back(0.0F);
    };
    positions.insert(positions.end(), 3, 0.0F);
    corner(i);
    corner((i + 1) % n);
  }
  builder.node({{"mesh", meshOf(builder, positions, {})}});
}

/// Few of the vertices of a long list are used, by each node.
void addUnused(GltfBuilder& builder, int n) {
  builder.gltf["bufferViews"] = Json::array();
  const auto values = builder.vec3({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const auto view = builder.gltf["accessors"][values]["bufferView"];
  const auto index = builder.gltf["accessors"][builder.indices({0, 1, 2})]["bufferView"];
  builder.gltf["accessors"].push_back({{"componentType", 5126},
                                       {"type", "VEC3"},
                                       {"count", 30 * n},
                                       {"sparse",
                                        {{"count", 3},
                                         {"indices", {{"bufferView", index}, {"componentType", 5123}}},
                                         {"values", {{"bufferView", view}}}}}});
  const auto positions = builder.gltf["accessors"].size() - 1;
  builder.gltf["meshes"].push_back(
      {{"primitives", {{{"attributes", {{"POSITION", positions}}}, {"indices", builder.indices({0, 1, 2})}}}}});
  for (int i = 0; i < n; ++i) builder.node({{"mesh", 0}, {"translation", {0, 0, 2 * i}}});
}

/// Triangles that all have one edge, as the pages of a book.
void addBook(GltfBuilder& builder, int n) {
  std::vector<float> positions;
  for (int i = 0; i < n; ++i) {
    const float angle = 2.0F * 3.14159265F * static_cast<float>(i) / static_cast<float>(n);
    positions.insert(positions.end(), {0, 0, 0, 0, 0, 1, std::cos(angle), std::sin(angle), 0.5F});
  }
  builder.node({{"mesh", meshOf(builder, positions, {})}});
}

/// Squares of one mesh, apart, whose own lightmap layout has all of them in one place; or in a row, side by side.
void addIslands(GltfBuilder& builder, int n, bool in_one_place) {
  std::vector<float> positions, places;
  for (int i = 0; i < n; ++i) {
    const auto x = 2.0F * static_cast<float>(i), width = in_one_place ? 1.0F : 1.0F / static_cast<float>(n),
               u = in_one_place ? 0.0F : width * static_cast<float>(i);
    for (const auto& [right, up] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}}) {
      positions.insert(positions.end(), {x + static_cast<float>(right), static_cast<float>(up), 0.0F});
      places.insert(places.end(), {u + width * static_cast<float>(right), static_cast<float>(up)});
    }
  }
  const auto mesh = meshOf(builder, positions, {});
  builder.gltf["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_1"] = builder.vec2(places);
  builder.node({{"mesh", mesh}});
}

/// Shapes that one square may take.
void addTargets(GltfBuilder& builder, int n) {
  const auto mesh = builder.square();
  auto& primitive = builder.gltf["meshes"][mesh]["primitives"][0];
  primitive["targets"] = Json::array();
  for (int i = 0; i < n; ++i) primitive["targets"].push_back({{"POSITION", primitive["attributes"]["POSITION"]}});
  builder.gltf["meshes"][mesh]["weights"] = std::vector<double>(static_cast<std::size_t>(n), 1.0 / n);
  builder.node({{"mesh", mesh}});
}

/// Bones of one skin, and nodes that it moves.
void addJoints(GltfBuilder& builder, int n) {
  const auto mesh = builder.square();
  auto& attributes = builder.gltf["meshes"][mesh]["primitives"][0]["attributes"];
  attributes["JOINTS_0"] = builder.accessor(std::vector<std::uint16_t>(16, 1), 5123, "VEC4", 4);
  attributes["WEIGHTS_0"] = builder.accessor(std::vector<float>(16, 0.25F), 5126, "VEC4", 4);
  Json joints = Json::array();
  for (int i = 0; i < n; ++i) joints.push_back(builder.node({{"translation", {i, 0, 0}}}));
  builder.gltf["skins"] = {{{"joints", joints}}};
  for (int i = 0; i < n; ++i) builder.node({{"mesh", mesh}, {"skin", 0}});
}

/// Places that the file has no data for.
void addInstances(GltfBuilder& builder, int n) {
  builder.gltf["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const auto mesh = builder.square();
  builder.gltf["accessors"].push_back({{"componentType", 5126}, {"count", n}, {"type", "VEC3"}});
  const Json attributes = {{"TRANSLATION", builder.gltf["accessors"].size() - 1}};
  builder.node({{"mesh", mesh}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
}

/// Lamps that are surfaces, beside each other.
void addLamps(GltfBuilder& builder, int n) {
  const auto mesh = builder.square();
  builder.gltf["materials"] = {{{"emissiveFactor", {1, 1, 1}}}};
  builder.gltf["meshes"][mesh]["primitives"][0]["material"] = 0;
  for (int i = 0; i < n; ++i) builder.node({{"mesh", mesh}, {"translation", {1.5 * i, 0, 0}}});
}

std::vector<Thing> things() {
  const auto nowhere = [](std::mt19937&, int, int) { return Json::object(); };
  const auto apart = [](std::mt19937&, int i, int n) -> Json {
    const auto side = static_cast<int>(std::sqrt(n)) + 1;
    return {{"translation", {2 * (i % side), 2 * (i / side), 0}}};
  };
  const auto tiles = [](std::mt19937& random, int, int n) -> Json {
    const double side = std::sqrt(n) / 2.0;
    return {{"translation", {side * uniform(random), side * uniform(random), 0}}};
  };
  const auto anywhere = [](std::mt19937& random, int, int) -> Json {
    return {{"translation", {uniform(random), uniform(random), uniform(random)}}};
  };
  const auto within = [](std::mt19937&, int i, int n) -> Json {
    const double size = 1.0 + 1.0 * i / n;
    return {{"scale", {size, size, size}}};
  };
  const auto slabs = [](std::mt19937& random, int, int) { return leaning(random, 1.0, {1.0, 1.0, 0.02}); };
  const auto rods = [](std::mt19937& random, int, int) {
    const auto size = [&](double mean) { return mean * std::exp(2.0 * std::normal_distribution<double>()(random)); };
    const double length = size(1.0), width = size(1.0), height = size(0.005);
    return leaning(random, 4.0, {length, width, height});
  };
  const auto far = [](std::mt19937&, int i, int) -> Json {
    return {{"translation", {i == 0 ? 1e20 : 1e-20 * i, 0, 0}}};
  };
  const auto large = [](std::mt19937&, int i, int) -> Json {
    const double size = i == 0 ? 1e6 : 1.0;
    return {{"translation", {2 * i, 0, i == 0 ? -1 : 0}}, {"scale", {size, size, size}}};
  };
  return {{"nodesInOnePlace", placed(square, nowhere)},
          {"nodesApart", placed(square, apart)},
          {"tilesOnEachOther", placed(square, tiles)},
          {"cubesInOnePlace", placed(cube, nowhere)},
          {"cubesWithinCubes", placed(cube, within)},
          {"cubesThroughCubes", placed(cube, anywhere)},
          {"openCubesThroughCubes", placed(openCube, anywhere)},
          {"leaningSlabsThroughSlabs", placed(cube, slabs)},
          {"leaningTubesThroughTubes", placed(tube, rods)},
          {"nodesFarApart", placed(square, far)},
          {"nodesBesideALargeOne", placed(square, large)},
          {"materials", addMaterials},
          {"nodesBelowEachOther", addChain},
          {"primitives", addPrimitives},
          {"lights", addLights},
          {"trianglesOfADisc", addDisc},
          {"trianglesOfABook", addBook},
          {"verticesOfNoTriangle", addUnused},
          {"islandsInOnePlace", [](GltfBuilder& builder, int n) { addIslands(builder, n, true); }},
          {"islandsInARow", [](GltfBuilder& builder, int n) { addIslands(builder, n, false); }},
          {"morphTargets", addTargets},
          {"joints", addJoints},
          {"instances", addInstances},
          {"shiningNodes", addLamps}};
}

class Growth : public testing::TestWithParam<Thing> {};

TEST_P(Growth, ofAThingCostsAsMuchAsThereIsOfIt) {
  double before = 0.0;
  int count = kBase;
  for (int step = 0; step < GetParam().steps; ++step, count *= 10) {
    GltfBuilder builder;
    GetParam().add(builder, count);
    const auto cost = load(builder.glb());
    SCOPED_TRACE(std::string(GetParam().name) + ": " + std::to_string(count) + " take " + std::to_string(cost.seconds) +
                 " s and " + std::to_string(cost.mib) + " MiB, ten times fewer took " + std::to_string(before) + " s");
    std::printf("%-24s %6d: %6.2f s %7.1f MiB\n", GetParam().name, count, cost.seconds, cost.mib);
    const double n_log_n = 10.0 * std::log(count) / std::log(count / 10.0);
    if (step > 0) {
      EXPECT_LT(cost.seconds, kSlack * n_log_n * std::max(before, kLeastSeconds / n_log_n));
    }
    EXPECT_LT(cost.seconds, kMostSeconds);
    EXPECT_LT(cost.mib, kMibAtAll + kMibEach * count);
    EXPECT_LT(cost.warnings, 30U) << "what is wrong with all is told in one warning";
    before = cost.seconds;
  }
}

INSTANTIATE_TEST_SUITE_P(Things, Growth, testing::ValuesIn(things()),
                         [](const testing::TestParamInfo<Thing>& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace radiosity::scene::test
