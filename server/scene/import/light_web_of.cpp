#include "server/scene/import/light_web_of.h"

#include <algorithm>
#include <span>
#include <string>

#include "common/task.h"
#include "server/scene/document/document_uri.h"
#include "server/scene/import/photometric_file.h"

namespace radiosity::scene {
namespace {

using Json = nlohmann::json;

/// The file's bytes, from the buffer view where there is one, as the import takes them; `decoded` holds those of a data
/// URI.
Result<std::span<const std::uint8_t>> bytesOf(const Document& document, const Json& light, const std::string& where,
                                              Bytes& decoded) {
  if (const auto uri = light.value("uri", std::string()); !light.contains("bufferView") && isDataUri(uri)) {
    auto data = decodeDataUri(uri, where);
    if (!data) return tl::unexpected(data.error());
    decoded = std::move(*data);
    return std::span<const std::uint8_t>(decoded);
  }
  const Json none = Json::array();
  const auto views = document.gltf.find("bufferViews");
  const auto& list = views != document.gltf.end() ? *views : none;
  const auto index = light.value("bufferView", list.size());
  if (index >= list.size()) return fail(ErrorCode::kInvalidScene, "has neither a bufferView nor a data URI", where);
  const auto buffer = list[index].value("buffer", document.buffers.size());
  const auto offset = list[index].value("byteOffset", std::size_t{0});
  const auto length = list[index].value("byteLength", std::size_t{0});
  if (buffer >= document.buffers.size() || offset > document.buffers[buffer]->size() ||
      length > document.buffers[buffer]->size() - offset)
    return fail(ErrorCode::kInvalidScene, "its buffer view goes beyond its buffer", where);
  return std::span<const std::uint8_t>(*document.buffers[buffer]).subspan(offset, length);
}

/// Which of `count` angles stay: `most` at most, the first and the last among them.
std::vector<std::size_t> kept(std::size_t count, std::size_t most) {
  std::vector<std::size_t> indices;
  const auto all = std::min(count, most);
  for (std::size_t i = 0; i < all; ++i) indices.push_back(all > 1 ? i * (count - 1) / (all - 1) : 0);
  return indices;
}

ShownWeb shown(const LightWeb& web, const WebAxes& axes) {
  const auto rows = static_cast<std::size_t>(web.table[0]), columns = static_cast<std::size_t>(web.table[1]);
  const auto angles = std::span(web.table).subspan(2);
  const auto candela = web.candela();
  ShownWeb out{web.lumens, static_cast<double>(std::ranges::max(candela)), axes.axis, axes.across, {}, {}, {}};
  const auto polar = kept(rows, kMostShownPolar), azimuths = kept(columns, kMostShownAzimuths);
  for (const auto p : polar) out.polar.push_back(angles[p]);
  for (const auto a : azimuths) out.azimuth.push_back(angles[rows + a]);
  out.candela.assign(polar.size() * azimuths.size(), 0.0F);
  // Each direction of the table counts for the kept one at or before it.
  for (std::size_t a = 0, to_a = 0; a < columns; ++a) {
    if (to_a + 1 < azimuths.size() && a >= azimuths[to_a + 1]) ++to_a;
    for (std::size_t p = 0, to_p = 0; p < rows; ++p) {
      if (to_p + 1 < polar.size() && p >= polar[to_p + 1]) ++to_p;
      auto& most = out.candela[to_a * polar.size() + to_p];
      most = std::max(most, candela[a * rows + p]);
    }
  }
  return out;
}

}  // namespace

Result<ShownWeb> lightWebOf(const Document& document, std::size_t light) {
  const Json::json_pointer lights("/extensions/EXT_lights_ies/lights");
  const Json none = Json::array();
  const auto& list = document.gltf.contains(lights) ? document.gltf[lights] : none;
  const auto where = lights.to_string() + "/" + std::to_string(light);
  if (light >= list.size()) return fail(ErrorCode::kNotFound, "there is no such light", where);
  Bytes decoded;
  const auto bytes = bytesOf(document, list[light], where, decoded);
  if (!bytes) return tl::unexpected(bytes.error());
  interruptionPoint();
  const auto file = parsePhotometricFile(*bytes, where);
  if (!file) return tl::unexpected(file.error());
  return shown(file->web, webAxes(file->frame));
}

}  // namespace radiosity::scene
