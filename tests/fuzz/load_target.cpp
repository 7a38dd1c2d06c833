// A whole load: a small scene made by the rules that the bytes name, read, imported, charted and lit for a tenth of a
// second. What it costs is bounded by what it has: a find is a load that takes seconds or a gigabyte.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/pipeline/make_solver.h"
#include "server/solver/solver.h"
#include "tests/fuzz/cost.h"
#include "tests/fuzz/target.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::fuzz {
namespace {

using nlohmann::json;

// A scene has some hundred pieces at most; sanitizers make all of it ten to a hundred times as slow, and twice as
// large.
constexpr double kMostSeconds = 20.0, kLitSeconds = 0.1;
constexpr long kMostKilobytes = 1L << 20U;
constexpr std::uint32_t kFewTriangles = 64;

/// The rules, byte by byte; zeros when they are used up.
class Rules {
 public:
  explicit Rules(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const auto first = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return first;
  }
  std::uint32_t below(std::uint32_t count) { return byte() % count; }
  /// Places that coincide as often as not, and now and then extremes.
  float number() {
    constexpr std::array<float, 16> kNumbers{0.0F,   0.0F,  1.0F,  -1.0F, 0.5F, 2.0F,   1e-3F, 1e3F,
                                             1e-20F, 1e20F, 1e-7F, 1e6F,  3.0F, -0.25F, 0.1F,  1e12F};
    const auto rule = byte();
    return rule < 128 ? kNumbers[rule % 16] : static_cast<float>(rule - 192) / 16.0F;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

class SceneMaker {
 public:
  explicit SceneMaker(std::span<const std::uint8_t> bytes) : rules_(bytes) {}

  [[nodiscard]] std::string make() {
    gltf_ = {{"asset", {{"version", "2.0"}}}, {"scene", 0},
             {"nodes", json::array()},        {"meshes", json::array()},
             {"materials", json::array()},    {"accessors", json::array()},
             {"bufferViews", json::array()}};
    addMaterials();
    addMeshes();
    addNodes();
    gltf_["buffers"] = {{{"byteLength", bin_.size()}}};
    return glb();
  }

 private:
  json vector(std::size_t size) {
    json values = json::array();
    for (std::size_t i = 0; i < size; ++i) values.push_back(rules_.number());
    return values;
  }

  void addMaterials() {
    for (auto count = 1 + rules_.below(3); count > 0; --count) {
      json material = {{"doubleSided", rules_.below(2) == 1}};
      if (rules_.below(2) == 1) material["emissiveFactor"] = {1.0, 0.5, 0.25};
      if (rules_.below(4) == 1) material["alphaMode"] = "BLEND";
      material["pbrMetallicRoughness"] = {{"baseColorFactor", {0.5, 0.5, 0.5, rules_.below(2) == 1 ? 0.5 : 1.0}},
                                          {"metallicFactor", rules_.below(2)}};
      gltf_["materials"].push_back(std::move(material));
    }
  }

  std::size_t addAccessor(const std::vector<float>& values, std::size_t width, const char* type) {
    const auto begin = bin_.size();
    const auto* bytes = reinterpret_cast<const char*>(values.data());
    bin_.append(bytes, values.size() * sizeof(float));
    gltf_["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", values.size() * sizeof(float)}});
    json accessor = {{"bufferView", gltf_["bufferViews"].size() - 1},
                     {"componentType", 5126},
                     {"count", values.size() / width},
                     {"type", type}};
    if (width == 3) {
      json low = json::array(), high = json::array();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        float least = values[axis], most = least;
        for (std::size_t i = axis; i < values.size(); i += 3)
          least = std::min(least, values[i]), most = std::max(most, values[i]);
        low.push_back(least);
        high.push_back(most);
      }
      accessor["min"] = low;
      accessor["max"] = high;
    }
    gltf_["accessors"].push_back(std::move(accessor));
    return gltf_["accessors"].size() - 1;
  }

  /// Claimed, and not there.
  std::size_t addEmptyAccessor() {
    constexpr std::array<std::uint64_t, 4> kCounts{3, 100, 70'000, 60'000'000};
    gltf_["accessors"].push_back({{"componentType", 5126},
                                  {"count", kCounts[rules_.below(4)]},
                                  {"type", "VEC3"},
                                  {"min", {0, 0, 0}},
                                  {"max", {0, 0, 0}}});
    return gltf_["accessors"].size() - 1;
  }

  void addMeshes() {
    for (auto count = 1 + rules_.below(4); count > 0; --count) {
      json primitives = json::array();
      for (auto parts = 1 + rules_.below(4); parts > 0; --parts) {
        std::vector<float> corners;
        for (auto triangles = 1 + rules_.below(8); triangles > 0; --triangles)
          for (int i = 0; i < 9; ++i) corners.push_back(rules_.number());
        const auto position = rules_.below(16) == 15 ? addEmptyAccessor() : addAccessor(corners, 3, "VEC3");
        json primitive = {{"attributes", {{"POSITION", position}}},
                          {"material", rules_.below(static_cast<std::uint32_t>(gltf_["materials"].size()))}};
        primitives.push_back(std::move(primitive));
      }
      gltf_["meshes"].push_back({{"primitives", std::move(primitives)}});
    }
  }

  /// Chains, fans and crowds of nodes: each hangs below the last, below the first, or below none.
  void addNodes() {
    json roots = json::array();
    const auto count = 1 + rules_.below(64);
    for (std::uint32_t n = 0; n < count; ++n) {
      json node = json::object();
      if (rules_.below(4) != 0) node["mesh"] = rules_.below(static_cast<std::uint32_t>(gltf_["meshes"].size()));
      if (rules_.below(4) == 1) node["translation"] = vector(3);
      if (rules_.below(8) == 1) node["scale"] = vector(3);
      if (node.contains("mesh") && rules_.below(16) == 15) addInstances(node);
      gltf_["nodes"].push_back(std::move(node));
      const auto under = rules_.below(4);
      if (n == 0 || under < 2) {
        roots.push_back(n);
      } else {
        gltf_["nodes"][under == 2 ? n - 1 : 0]["children"].push_back(n);
      }
      if (rules_.empty() && n > 2) break;
    }
    gltf_["scenes"] = {{{"nodes", std::move(roots)}}};
  }

  void addInstances(json& node) {
    gltf_["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
    std::size_t places = 0;
    if (rules_.below(4) == 3) {
      places = addEmptyAccessor();
    } else {
      std::vector<float> values(3 * (1 + std::size_t{rules_.byte()}));
      for (auto& value : values) value = rules_.number();
      places = addAccessor(values, 3, "VEC3");
    }
    node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = places;
  }

  [[nodiscard]] std::string glb() const {
    auto text = gltf_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    auto bin = bin_;
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    std::string file;
    const auto put = [&](std::uint32_t value) {
      for (unsigned i = 0; i < 4; ++i) file.push_back(static_cast<char>(value >> 8 * i & 0xFF));
    };
    put(0x46546C67), put(2), put(static_cast<std::uint32_t>(28 + text.size() + bin.size()));
    put(static_cast<std::uint32_t>(text.size())), put(0x4E4F534A);
    file += text;
    put(static_cast<std::uint32_t>(bin.size())), put(0x004E4942);
    return file + bin;
  }

  Rules rules_;
  json gltf_;
  std::string bin_;
};

void light(const std::shared_ptr<const scene::PatchScene>& patches, const scene::PatchMaterials& materials) {
  test::RayTransport transport(16);
  if (!transport.setScene(patches)) return;
  solver::SolverSettings settings;
  settings.target_error = 0.5;
  const auto solver = solver::makeSolver(patches, materials, transport, settings);
  const auto begin = processorSeconds();
  while (processorSeconds() - begin < kLitSeconds) {
    const auto outcome = solver->step();
    if (!outcome || *outcome == solver::StepOutcome::kConverged || *outcome == solver::StepOutcome::kExhausted) break;
  }
  for (const auto& light : solver->irradiance())
    require(light.x == light.x && light.y == light.y && light.z == light.z, "light is a number");
}

void load(std::span<const std::uint8_t> bytes) {
  const auto file = SceneMaker(bytes).make();
  const auto* begin = reinterpret_cast<const std::uint8_t*>(file.data());
  const scene::ImportLimits limits{.max_scene_bytes = std::uint64_t{1} << 28U};
  const auto document = scene::parseDocument("fuzz.glb", {begin, file.size()}, limits);
  if (!document) return require(!document.error().message.empty(), "a refusal says why");
  const auto imported = scene::importScene(*document, limits);
  if (!imported) return require(!imported.error().message.empty(), "a refusal says why");
  scene::ChartOptions charts;
  charts.texel_budget = 256;
  charts.max_page_size = 256;
  auto built = scene::buildPatchScene(*imported, charts);
  if (!built) return require(!built.error().message.empty(), "a refusal says why");
  const auto patches = std::make_shared<const scene::PatchScene>(std::move(*built));
  if (patches->triangles.size() > kFewTriangles || patches->leaves.size() > 1024) return;  // the transport is plain
  light(patches, scene::shadePatches(*imported, *patches));
}

}  // namespace

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  for (const std::uint8_t stride : {1, 7, 31, 77, 129}) {
    Seed seed(700);
    for (std::size_t i = 0; i < seed.size(); ++i) seed[i] = static_cast<std::uint8_t>(i * stride + (i * i >> 5U));
    all.push_back(std::move(seed));
  }
  all.emplace_back(300, std::uint8_t{1});  // all in one place
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity::fuzz;  // NOLINT
  const Cost cost;
  load({data, size});
  cost.requireAtMost(kMostSeconds, kMostKilobytes);
  return 0;
}
