#include "client/engines/hubs.h"

#include <cstdint>
#include <numbers>
#include <utility>

namespace radiosity::engines {
namespace {

constexpr int kLinear = 9729, kClampToEdge = 33071;

/// The index of what was appended to a list at the top of the file.
std::size_t append(Json& gltf, const char* list, Json element) {
  auto& all = gltf[list];
  if (!all.is_array()) all = Json::array();
  all.push_back(std::move(element));
  return all.size() - 1;
}

void markUsed(Json& gltf, const char* name) {
  auto& used = gltf["extensionsUsed"];
  if (!used.is_array()) used = Json::array();
  for (const auto& one : used)
    if (one == name) return;
  used.push_back(name);
}

}  // namespace

void HubsPages::add(std::size_t page, const EncodedPage& encoded) {
  const auto texture = addTexture(encoded.bytes);
  // Hubs multiplies the base colour by intensity x texture: https://github.com/Hubs-Foundation/hubs,
  // gltf-model-plus.js.
  const double intensity = exposure_ * encoded.unit / std::numbers::pi;
  for (auto& material : gltf_["materials"]) {
    const auto extras = material.find("extras");
    if (extras == material.end() || !extras->is_object() || extras->value("lightmap", Json()) != page) continue;
    material["extensions"]["MOZ_lightmap"] = {{"index", texture}, {"texCoord", 1}, {"intensity", intensity}};
  }
  markUsed(gltf_, "MOZ_lightmap");
  markUsed(gltf_, "MOZ_texture_rgbe");
}

std::size_t HubsPages::addTexture(const Bytes& bytes) {
  constexpr std::size_t kAlignment = 4;
  bin_.resize((bin_.size() + kAlignment - 1) / kAlignment * kAlignment);
  const auto view =
      append(gltf_, "bufferViews", {{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", bytes.size()}});
  bin_.insert(bin_.end(), bytes.begin(), bytes.end());
  auto& buffers = gltf_["buffers"];
  if (!buffers.is_array() || buffers.empty()) buffers = Json::array({Json::object()});
  buffers[0]["byteLength"] = bin_.size();
  const auto image = append(gltf_, "images", {{"bufferView", view}, {"mimeType", "image/vnd.radiance"}});
  const auto sampler =
      append(gltf_, "samplers",
             {{"magFilter", kLinear}, {"minFilter", kLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}});
  return append(gltf_, "textures", {{"sampler", sampler}, {"extensions", {{"MOZ_texture_rgbe", {{"source", image}}}}}});
}

}  // namespace radiosity::engines
