#include "server/scene/document/glb.h"

#include <cstring>

#include "common/check.h"

namespace radiosity::scene {
namespace {

constexpr std::uint32_t kMagic = 0x46546C67;  // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinChunk = 0x004E4942;
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
/// The header has 32 bits for the length.
constexpr std::size_t kMaxGlbBytes = 0xFFFFFFFF;

std::uint32_t u32(std::span<const std::uint8_t> bytes, std::size_t offset) {
  return static_cast<std::uint32_t>(bytes[offset]) | static_cast<std::uint32_t>(bytes[offset + 1]) << 8 |
         static_cast<std::uint32_t>(bytes[offset + 2]) << 16 | static_cast<std::uint32_t>(bytes[offset + 3]) << 24;
}

void put(Bytes& out, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<std::uint8_t>(value >> shift));
}

std::size_t padded(std::size_t size) { return (size + 3) / 4 * 4; }

std::size_t glbBytes(std::size_t json, std::size_t bin) {
  return kHeaderBytes + kChunkHeaderBytes + padded(json) + (bin == 0 ? 0 : kChunkHeaderBytes + padded(bin));
}

tl::unexpected<Error> bad(const std::string& name, std::size_t offset, std::string what) {
  return fail(ErrorCode::kBadInput, std::move(what), name + ": byte " + std::to_string(offset));
}

Result<void> checkHeader(const std::string& name, std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kHeaderBytes + kChunkHeaderBytes) return bad(name, bytes.size(), "GLB ends within its header");
  if (u32(bytes, 4) != 2) return bad(name, 4, "GLB version " + std::to_string(u32(bytes, 4)) + "; only 2 is read");
  if (u32(bytes, 8) != bytes.size()) {
    return bad(name, 8,
               "GLB says it has " + std::to_string(u32(bytes, 8)) + " bytes, but has " + std::to_string(bytes.size()) +
                   ": cut off, or more than one file");
  }
  return {};
}

}  // namespace

bool isGlb(std::span<const std::uint8_t> bytes) { return bytes.size() >= 4 && u32(bytes, 0) == kMagic; }

Result<GlbChunks> splitGlb(const std::string& name, std::span<const std::uint8_t> bytes) {
  if (auto ok = checkHeader(name, bytes); !ok) return tl::unexpected(ok.error());
  GlbChunks chunks;
  std::size_t offset = kHeaderBytes;
  for (int index = 0; offset < bytes.size(); ++index) {
    if (bytes.size() - offset < kChunkHeaderBytes) return bad(name, offset, "GLB ends within a chunk header");
    const std::size_t length = u32(bytes, offset);
    const auto type = u32(bytes, offset + 4);
    const auto data = offset + kChunkHeaderBytes;
    if (length > bytes.size() - data) return bad(name, offset, "GLB chunk is longer than the file");
    if (length % 4 != 0) return bad(name, offset, "GLB chunk length is not a multiple of 4");
    if ((index == 0) != (type == kJsonChunk)) return bad(name, offset, "GLB must have one JSON chunk, and it first");
    if (type == kJsonChunk) {
      chunks.json = {reinterpret_cast<const char*>(bytes.data()) + data, length};
      // Some exporters pad with zeros where the specification asks for spaces.
      chunks.json = chunks.json.substr(0, chunks.json.find_last_not_of('\0') + 1);
    }
    if (type == kBinChunk) {
      if (chunks.has_bin) return bad(name, offset, "GLB has two BIN chunks");
      chunks.bin = bytes.subspan(data, length);
      chunks.has_bin = true;
    }
    offset = data + length;
  }
  return chunks;
}

bool fitsGlb(std::size_t json, std::size_t bin) { return glbBytes(json, bin) <= kMaxGlbBytes; }

Bytes joinGlb(std::string_view json, std::span<const std::uint8_t> bin) {
  const auto total = glbBytes(json.size(), bin.size());
  RAD_CHECK_LE(total, kMaxGlbBytes);  // the caller asked fitsGlb()
  Bytes out;
  out.reserve(total);
  put(out, kMagic);
  put(out, 2);
  put(out, static_cast<std::uint32_t>(total));
  put(out, static_cast<std::uint32_t>(padded(json.size())));
  put(out, kJsonChunk);
  out.insert(out.end(), json.begin(), json.end());
  out.resize(out.size() + padded(json.size()) - json.size(), ' ');
  if (!bin.empty()) {
    put(out, static_cast<std::uint32_t>(padded(bin.size())));
    put(out, kBinChunk);
    out.insert(out.end(), bin.begin(), bin.end());
    out.resize(total, 0);
  }
  return out;
}

}  // namespace radiosity::scene
