#include "server/engine/persist/checkpoint_head.h"

#include <tuple>

namespace radiosity::engine {

std::string textOf(const nlohmann::json& value) {
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

state::Document plainDocument(const scene::Document& document) {
  return {document.name, textOf(document.gltf), document.buffers, document.images};
}

CheckpointHead headOf(const SolveSettings& settings) {
  CheckpointHead head;
  head.texels = settings.texels;
  head.seed = settings.seed;
  head.link_memory = settings.link_memory_bytes;
  head.texel_size_m = settings.texel_size_m;
  head.target_error = settings.target_error;
  head.method = settings.method;
  head.double_sided = settings.double_sided;
  head.adaptive = settings.choosesTexels();
  head.has_sky = settings.sky.has_value();
  head.sky = settings.sky.value_or(SkySetting{});
  return head;
}

bool sameSolve(const CheckpointHead& a, const CheckpointHead& b) {
  const auto key = [](const CheckpointHead& h) {
    return std::tuple(h.texel_size_m, h.texel_size_m > 0.0 ? 0 : h.texels, h.seed, h.link_memory, h.method, h.has_sky,
                      h.double_sided, h.adaptive);
  };
  return key(a) == key(b) && a.sky == b.sky;
}

}  // namespace radiosity::engine
