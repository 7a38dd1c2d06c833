// A JSON Patch on a small scene: applied whole or not at all, and what comes out is imported or refused.
#include <nlohmann/json.hpp>

#include "server/scene/document/document.h"
#include "tests/fuzz/target.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"

namespace radiosity::fuzz {

std::vector<Seed> seeds() {
  return {
      seedOf(R"([{"op":"replace","path":"/materials/0/emissiveFactor","value":[1,0.8,0.6]}])"),
      seedOf(
          R"([{"op":"add","path":"/nodes/-","value":{"name":"new"}},{"op":"test","path":"/asset/version","value":"2.0"}])"),
      seedOf(R"([{"op":"copy","from":"/materials/0","path":"/materials/-"}])"),
      seedOf(R"([{"op":"move","from":"/nodes/0/translation","path":"/nodes/0/scale"}])"),
      seedOf(R"([{"op":"remove","path":"/materials/0/pbrMetallicRoughness"}])")};
}

namespace {

const scene::Document& document() {
  static const auto kDocument = scene::parseDocument("cube.glb", test_scenes::encodeGlb(test_scenes::lumpedCube(0.5)));
  require(kDocument.has_value(), "the scene itself is sound");
  return *kDocument;
}

}  // namespace
}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  // The protocol bounds depth before it parses; so must this.
  const auto patch = nlohmann::json::parse(
      data, data + size, [](int depth, nlohmann::json::parse_event_t, nlohmann::json&) { return depth <= 60; }, false);
  if (patch.is_discarded()) return 0;
  const auto before = fuzz::document().gltf;
  const auto next = scene::applyPatch(fuzz::document(), patch);
  fuzz::require(fuzz::document().gltf == before, "the document itself is never changed");
  if (!next) {
    fuzz::require(!next.error().message.empty(), "a refusal says why");
    return 0;
  }
  const auto imported = scene::importScene(*next);
  fuzz::require(imported.has_value() || !imported.error().message.empty(), "a refusal says why");
  return 0;
}
