#include "tests/oracle/gltf_file.h"

#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace radiosity::oracle {
namespace {

using nlohmann::json;

std::size_t componentSize(int type) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      throw std::runtime_error("unknown componentType " + std::to_string(type));
  }
}

/// What stands for 1 in a normalized accessor.
double one(int type) {
  switch (type) {
    case 5120:
      return 127.0;
    case 5121:
      return 255.0;
    case 5122:
      return 32767.0;
    case 5123:
      return 65535.0;
    default:
      return 1.0;
  }
}

std::uint32_t word(const std::vector<char>& bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, 4);
  return value;
}

std::vector<char> readFile(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<char> fromBase64(std::string_view text) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<char> bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const auto digit = kDigits.find(c);
    if (digit == std::string_view::npos) break;  // padding
    bits = (bits << 6U) | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<char>((bits >> static_cast<unsigned>(count)) & 0xFFU));
  }
  return bytes;
}

std::string percentDecoded(const std::string& uri) {
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size()) {
      out += static_cast<char>(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

}  // namespace

glm::dvec3 vector3(const json& array) {
  return {array.at(0).get<double>(), array.at(1).get<double>(), array.at(2).get<double>()};
}

GltfFile::GltfFile(const std::filesystem::path& file) : folder_(file.parent_path()) {
  const auto bytes = readFile(file);
  if (bytes.size() >= 20 && std::memcmp(bytes.data(), "glTF", 4) == 0) {
    readGlb(bytes);
  } else {
    if (file.extension() != ".gltf") throw std::runtime_error("not a GLB file");
    json_ = json::parse(bytes.begin(), bytes.end());
    readBuffers({});
  }
}

void GltfFile::readGlb(const std::vector<char>& bytes) {
  const auto json_length = word(bytes, 12);
  if (json_length > bytes.size() - 20) throw std::runtime_error("JSON chunk passes the end of the file");
  const auto bin_at = 20 + static_cast<std::size_t>(json_length);
  json_ = json::parse(bytes.begin() + 20, bytes.begin() + static_cast<std::ptrdiff_t>(bin_at));
  std::vector<char> bin;
  if (bin_at + 8 <= bytes.size()) bin.assign(bytes.begin() + static_cast<std::ptrdiff_t>(bin_at) + 8, bytes.end());
  readBuffers(std::move(bin));
}

void GltfFile::readBuffers(std::vector<char> bin) {
  for (const auto& buffer : member("buffers"))
    buffers_.push_back(buffer.contains("uri") ? bytesOfUri(buffer["uri"].get<std::string>()) : std::move(bin));
}

const json& GltfFile::member(const char* name) const {
  static const auto kEmpty = nlohmann::json::array();
  const auto found = json_.find(name);
  return found == json_.end() ? kEmpty : *found;
}

std::vector<char> GltfFile::bytesOfUri(const std::string& uri) const {
  if (uri.rfind("data:", 0) != 0) return readFile(folder_ / percentDecoded(uri));
  const auto comma = uri.find(',');
  if (comma == std::string::npos) throw std::runtime_error("a data: URI without data");
  return fromBase64(std::string_view(uri).substr(comma + 1));
}

std::span<const char> GltfFile::bytesOfView(std::size_t index) const {
  const auto& view = member("bufferViews").at(index);
  const auto& buffer = buffers_.at(view.value("buffer", std::size_t{0}));
  const auto start = view.value("byteOffset", std::size_t{0});
  const auto length = view.at("byteLength").get<std::size_t>();
  if (start > buffer.size() || length > buffer.size() - start)
    throw std::runtime_error("a buffer view passes the end of its buffer");
  return std::span(buffer).subspan(start, length);
}

std::size_t GltfFile::count(std::size_t accessor) const {
  return member("accessors").at(accessor).at("count").get<std::size_t>();
}

void GltfFile::visitAccessor(std::size_t index, std::size_t components, const Visit& visit) const {
  const auto& accessor = member("accessors").at(index);
  if (accessor.contains("sparse")) throw std::runtime_error("sparse accessors are not read");
  const auto view_index = accessor.at("bufferView").get<std::size_t>();
  const auto view = bytesOfView(view_index);
  const int type = accessor.at("componentType").get<int>();
  const auto size = componentSize(type);
  const auto elements = accessor.at("count").get<std::size_t>();
  const auto stride = member("bufferViews").at(view_index).value("byteStride", size * components);
  const auto start = accessor.value("byteOffset", std::size_t{0});
  if (elements > 0 && start + (elements - 1) * stride + size * components > view.size())
    throw std::runtime_error("accessor passes the end of its buffer");
  const double unit = accessor.value("normalized", false) ? one(type) : 1.0;
  for (std::size_t i = 0; i < elements; ++i) {
    for (std::size_t c = 0; c < components; ++c) visit(i, c, number(view, start + i * stride + c * size, type) / unit);
  }
}

double GltfFile::number(std::span<const char> view, std::size_t at, int type) {
  const auto load = [&](auto value) {
    std::memcpy(&value, view.data() + at, sizeof value);
    return static_cast<double>(value);
  };
  switch (type) {
    case 5120:
      return load(std::int8_t{});
    case 5121:
      return load(std::uint8_t{});
    case 5122:
      return load(std::int16_t{});
    case 5123:
      return load(std::uint16_t{});
    case 5125:
      return load(std::uint32_t{});
    default:
      return load(float{});
  }
}

}  // namespace radiosity::oracle
