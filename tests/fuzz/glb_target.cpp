// A scene file: read, checked and imported, or refused; small ones also charted.
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/values/patch_scene.h"
#include "tests/fuzz/target.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/scene/compressed_meshes.h"

namespace radiosity::fuzz {
namespace {

// Small, so that a file cannot ask for much before it is refused.
constexpr scene::ImportLimits kLimits = {.max_json_depth = 64,
                                         .max_file_bytes = std::size_t{1} << 22,
                                         .max_image_pixels = std::size_t{1} << 18,
                                         .max_vertices = std::size_t{1} << 18,
                                         .max_triangles = std::size_t{1} << 14,
                                         .max_nodes = std::size_t{1} << 12};
constexpr std::size_t kFewTriangles = 200;

}  // namespace

std::vector<Seed> seeds() {
  const scene::test::Grid compressed(3);
  return {
      scene::test::dracoDocument(compressed, scene::test::dracoStream(compressed)).glb(),
      scene::test::MeshoptBuilder("EXT_meshopt_compression").mesh(compressed).glb(),
      test_scenes::encodeGlb(test_scenes::lumpedCube(0.5)), test_scenes::encodeGlb(test_scenes::cornell()),
      seedOf(
          R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,"count":3,"componentType":5126,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})"),
      // The same in a pose, of a material of textures that are not there.
      seedOf(
          R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0,"skin":0,"weights":[0.5]},{"translation":[0,1,0]}],"skins":[{"joints":[1,0]}],"meshes":[{"weights":[1],"primitives":[{"material":0,"attributes":{"POSITION":0,"NORMAL":0,"JOINTS_0":1,"WEIGHTS_0":2},"targets":[{"POSITION":0,"NORMAL":0}]}]}],"materials":[{"alphaMode":"MASK","pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":0}},"extensions":{"KHR_materials_pbrSpecularGlossiness":{"specularFactor":[0,0.5,0],"diffuseTexture":{"index":0}}}}],"textures":[{"source":0,"sampler":0}],"samplers":[{"magFilter":9728}],"accessors":[{"bufferView":0,"count":3,"componentType":5126,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{"count":3,"componentType":5121,"type":"VEC4"},{"bufferView":0,"count":3,"componentType":5126,"type":"VEC4","sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":0}}}],"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteLength":1}],"buffers":[{"byteLength":48,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/"}]})")};
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  const auto document = scene::parseDocument("fuzz.glb", {data, size}, fuzz::kLimits);
  if (!document) {
    fuzz::require(!document.error().message.empty(), "a refusal says why");
    return 0;
  }
  const auto imported = scene::importScene(*document, fuzz::kLimits);
  if (!imported) {
    fuzz::require(!imported.error().message.empty(), "a refusal says why");
    return 0;
  }
  std::size_t triangles = 0;
  for (const auto& instance : imported->instances)
    triangles += imported->primitives.at(instance.primitive).indices.size() / 3;
  if (triangles > fuzz::kFewTriangles) return 0;
  scene::ChartOptions charts;
  charts.texel_budget = 64;
  charts.max_page_size = 256;
  (void)scene::buildPatchScene(*imported, charts);
  return 0;
}
