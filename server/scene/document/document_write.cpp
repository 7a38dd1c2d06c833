// writeGlb: one buffer, images embedded.
#include "common/check.h"
#include "common/task.h"
#include "server/scene/document/document.h"
#include "server/scene/document/glb.h"
#include "server/scene/document/image_decode.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {
namespace {

void padTo4(Bytes& bytes) { bytes.resize((bytes.size() + 3) / 4 * 4, 0); }

std::size_t dataBytes(const Document& document) {
  std::size_t sum = 0;
  for (const auto* files : {&document.buffers, &document.images}) {
    for (const auto& file : *files) sum += file->size();
  }
  return sum;
}

/// All buffers behind each other; views are moved along.
Bytes joinBuffers(const Document& document, Json& gltf) {
  Bytes bin;
  std::vector<std::size_t> first;
  for (const auto& buffer : document.buffers) {
    interruptionPoint();
    first.push_back(bin.size());
    bin.insert(bin.end(), buffer->begin(), buffer->end());
    padTo4(bin);
  }
  if (!gltf.contains("bufferViews")) return bin;
  for (auto& view : gltf["bufferViews"]) {
    const auto buffer = view["buffer"].get<std::size_t>();
    RAD_CHECK_LT(buffer, first.size());
    view["byteOffset"] = view.value("byteOffset", std::size_t{0}) + first[buffer];
    view["buffer"] = 0;
  }
  return bin;
}

/// Images that came as files or data URIs.
void embedImages(const Document& document, Json& gltf, Bytes& bin) {
  for (std::size_t i = 0; i < document.images.size(); ++i) {
    auto& image = gltf["images"][i];
    if (image.contains("bufferView")) continue;
    const auto& bytes = *document.images[i];
    if (!gltf.contains("bufferViews")) gltf["bufferViews"] = Json::array();
    image.erase("uri");
    image["bufferView"] = gltf["bufferViews"].size();
    const auto type = sniffImageType(bytes);
    if (!type.empty() || !image.contains("mimeType")) image["mimeType"] = type.empty() ? "image/png" : type;
    gltf["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}});
    bin.insert(bin.end(), bytes.begin(), bytes.end());
    padTo4(bin);
  }
}

}  // namespace

Result<Bytes> writeGlb(const Document& document) {
  const auto tooLarge = [&] { return fail(ErrorCode::kTooLarge, "a GLB holds no more than 4 GiB", document.name); };
  if (!fitsGlb(0, dataBytes(document))) return tooLarge();
  auto gltf = document.gltf;
  auto bin = joinBuffers(document, gltf);
  embedImages(document, gltf, bin);
  gltf.erase("buffers");
  if (!bin.empty()) gltf["buffers"] = Json::array({{{"byteLength", bin.size()}}});
  const auto json = gltf.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (!fitsGlb(json.size(), bin.size())) return tooLarge();
  return joinGlb(json, bin);
}

}  // namespace radiosity::scene
