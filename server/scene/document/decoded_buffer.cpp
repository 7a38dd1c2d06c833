#include "server/scene/document/decoded_buffer.h"

#include <algorithm>
#include <utility>

namespace radiosity::scene {
namespace {

/// Pieces are put together at the end, and each begins where any component may.
constexpr std::uint64_t kCopies = 2;
constexpr std::size_t kAlignment = 4;

}  // namespace

DecodedBuffer::DecodedBuffer(const Document& document, const ImportLimits& limits)
    : index_(document.buffers.size()), most_(limits.max_file_bytes) {
  std::uint64_t bytes_of_data = 0;
  for (const auto& buffer : document.buffers) bytes_of_data += buffer->size();
  bytes_ = std::min(bytes_of_data, most_);
  memory_ = std::min(sceneMemoryLimit(limits), likelySceneMemory(limits, bytes_of_data),
                     [](const SceneLimit& a, const SceneLimit& b) { return a.bytes < b.bytes; });
}

Result<void> DecodedBuffer::claim(std::uint64_t bytes, std::uint64_t working, const std::string& where) {
  if (bytes > most_ - bytes_) {
    return fail(ErrorCode::kTooLarge,
                "buffers would have more than " + std::to_string(most_) + " bytes once geometry is decoded", where);
  }
  bytes_ += bytes;
  const auto wanted = claimed_ + kCopies * (bytes + kAlignment) + working;
  if (wanted > memory_.bytes)
    return fail(ErrorCode::kTooLarge, sceneMemoryFault(wanted, memory_, "its decoded geometry"), where);
  claimed_ = wanted - working;
  return {};
}

void DecodedBuffer::put(Bytes bytes, Json& view) {
  view["buffer"] = index_;
  view["byteOffset"] = size_;
  view["byteLength"] = bytes.size();
  bytes.resize((bytes.size() + kAlignment - 1) / kAlignment * kAlignment, 0);
  size_ += bytes.size();
  pieces_.push_back(std::move(bytes));
}

Bytes DecodedBuffer::take() {
  Bytes all;
  all.reserve(size_);
  for (auto& piece : pieces_) {
    all.insert(all.end(), piece.begin(), piece.end());
    piece = {};
  }
  pieces_.clear();
  return all;
}

}  // namespace radiosity::scene
