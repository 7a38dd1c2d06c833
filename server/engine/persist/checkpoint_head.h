// What a checkpoint of a solve is of, and documents as the store takes them. Private to this folder; solve thread only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/engine/engine.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/lit_sides.h"
#include "server/state/store.h"

namespace radiosity::engine {

[[nodiscard]] std::string textOf(const nlohmann::json& value);
[[nodiscard]] state::Document plainDocument(const scene::Document& document);

/// Settings that a running solve can change (target, time limit) are not among them.
struct CheckpointHead {
  std::string epoch;
  std::uint64_t revision = 0;
  std::uint64_t texels = 0, seed = 0, link_memory = 0;
  double texel_size_m = 0.0, target_error = 0.0, seconds = 0.0;
  Method method = Method::kGather;
  bool has_sky = false, double_sided = false, adaptive = false;
  SkySetting sky;
  std::string gltf, assets;   ///< JSON, and a digest of buffers and images
  scene::SideBits sides;      ///< LitScene::sides()
  scene::TexelLayout layout;  ///< LitScene::layout()
  double draft_error = 0.0;   ///< LitScene::draftError()
  double closer = 1.0;        ///< LitScene::closer()
  std::uint32_t layouts = 0;  ///< that were made after one another

  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.epoch, self.revision, self.texels, self.seed, self.link_memory, self.texel_size_m, self.target_error,
            self.seconds, self.method, self.has_sky, self.sky, self.double_sided, self.adaptive, self.gltf, self.assets,
            self.sides, self.layout.detail, self.layout.texel_m, self.layout.rough_texel_m, self.draft_error,
            self.closer, self.layouts);
  }
};

/// With all that comes from settings.
[[nodiscard]] CheckpointHead headOf(const SolveSettings& settings);
/// Whether the two solve alike, whatever they solve.
[[nodiscard]] bool sameSolve(const CheckpointHead& a, const CheckpointHead& b);

}  // namespace radiosity::engine
