#include "client/engines/lit_scene.h"

#include <ImathBox.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <utility>

namespace radiosity::engines {
namespace {

constexpr std::uint32_t kMagic = 0x46546C67, kVersion = 2, kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;
constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

Result<Bytes> readFile(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) return fail(ErrorCode::kUnavailable, "cannot be read", path);
  Bytes bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(file.gcount()) != size) return fail(ErrorCode::kUnavailable, "cannot be read", path);
  return bytes;
}

std::uint32_t wordAt(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + at, sizeof word);
  return word;
}

/// The chunk of this kind at the head of `rest`, which then begins behind it. Empty: there is none.
std::span<const std::uint8_t> takeChunk(std::span<const std::uint8_t>& rest, std::uint32_t kind) {
  if (rest.size() < kChunkHeaderBytes || wordAt(rest, 4) != kind) return {};
  const std::size_t size = wordAt(rest, 0);
  if (size > rest.size() - kChunkHeaderBytes) return {};
  const auto chunk = rest.subspan(kChunkHeaderBytes, size);
  rest = rest.subspan(kChunkHeaderBytes + size);
  return chunk;
}

Result<void> readGlb(const std::string& path, LitScene& scene) {
  const auto bytes = readFile(path);
  if (!bytes) return tl::unexpected(bytes.error());
  const auto broken = fail(ErrorCode::kBadInput, "the scene that the server sent is no GLB with one buffer", path);
  if (bytes->size() < kHeaderBytes || wordAt(*bytes, 0) != kMagic || wordAt(*bytes, 4) != kVersion) return broken;
  auto rest = std::span<const std::uint8_t>(*bytes).subspan(kHeaderBytes);
  const auto json = takeChunk(rest, kJsonChunk), bin = takeChunk(rest, kBinChunk);
  scene.gltf = Json::parse(json.begin(), json.end(), nullptr, false);
  if (!scene.gltf.is_object()) return broken;
  const auto buffers = scene.gltf.find("buffers");
  if (buffers != scene.gltf.end() && (!buffers->is_array() || buffers->size() > 1)) return broken;
  scene.bin.assign(bin.begin(), bin.end());
  return {};
}

Result<Image> readPage(const std::string& path) {
  try {
    Imf::InputFile file(path.c_str(), 1);
    const auto& window = file.header().dataWindow();
    const auto width = std::int64_t{window.max.x} - window.min.x + 1,
               height = std::int64_t{window.max.y} - window.min.y + 1;
    if (width < 1 || height < 1 || width > kMostSide || height > kMostSide)
      return fail(ErrorCode::kTooLarge, "the page has no pixels, or more than 16384 along a side", path);
    Image page(static_cast<int>(width), static_cast<int>(height));
    constexpr std::size_t kStride = sizeof(glm::vec3);
    auto* origin = reinterpret_cast<char*>(page.pixels.data()) -
                   (window.min.x + std::int64_t{window.min.y} * width) * static_cast<std::int64_t>(kStride);
    Imf::FrameBuffer frame;
    for (const auto& [name, place] : {std::pair("R", 0), std::pair("G", 1), std::pair("B", 2)}) {
      if (file.header().channels().findChannel(name) == nullptr)
        return fail(ErrorCode::kBadInput, "the page lacks the channel " + std::string(name), path);
      frame.insert(name, Imf::Slice(Imf::FLOAT, origin + place * static_cast<std::ptrdiff_t>(sizeof(float)), kStride,
                                    kStride * static_cast<std::size_t>(width)));
    }
    file.setFrameBuffer(frame);
    file.readPixels(window.min.y, window.max.y);
    return page;
  } catch (const std::exception& error) {
    return fail(ErrorCode::kBadInput, std::string("the page is no EXR: ") + error.what(), path);
  }
}

void appendWord(Bytes& bytes, std::size_t word) {
  const auto value = static_cast<std::uint32_t>(word);
  std::array<std::uint8_t, sizeof value> parts{};
  std::memcpy(parts.data(), &value, sizeof value);
  bytes.insert(bytes.end(), parts.begin(), parts.end());
}

constexpr std::size_t padded(std::size_t size) { return (size + 3) / 4 * 4; }

}  // namespace

Result<LitScene> readLitScene(const std::string& glb_path, const std::vector<std::string>& page_paths) {
  LitScene scene;
  if (auto done = readGlb(glb_path, scene); !done) return tl::unexpected(done.error());
  for (const auto& path : page_paths) {
    auto page = readPage(path);
    if (!page) return tl::unexpected(page.error());
    scene.pages.push_back(std::move(*page));
  }
  return scene;
}

Result<Bytes> writeGlb(const Json& gltf, std::span<const std::uint8_t> bin) {
  const std::string json = gltf.dump(-1, ' ', false, Json::error_handler_t::replace);
  const std::size_t bin_bytes = bin.empty() ? 0 : kChunkHeaderBytes + padded(bin.size());
  const std::size_t size = kHeaderBytes + kChunkHeaderBytes + padded(json.size()) + bin_bytes;
  if (size > UINT32_MAX) return fail(ErrorCode::kTooLarge, "the scene does not fit into a GLB, which ends at 4 GiB");
  Bytes bytes;
  bytes.reserve(size);
  for (const std::size_t word : {std::size_t{kMagic}, std::size_t{kVersion}, size}) appendWord(bytes, word);
  appendWord(bytes, padded(json.size()));
  appendWord(bytes, kJsonChunk);
  bytes.insert(bytes.end(), json.begin(), json.end());
  bytes.resize(kHeaderBytes + kChunkHeaderBytes + padded(json.size()), ' ');
  if (bin.empty()) return bytes;
  appendWord(bytes, padded(bin.size()));
  appendWord(bytes, kBinChunk);
  bytes.insert(bytes.end(), bin.begin(), bin.end());
  bytes.resize(size);
  return bytes;
}

}  // namespace radiosity::engines
