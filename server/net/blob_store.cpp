#include "server/net/blob_store.h"

#include <random>
#include <utility>

namespace radiosity::net {

std::string randomHex(std::size_t bytes) {
  static constexpr std::string_view kDigits = "0123456789abcdef";
  std::random_device source;
  std::string text;
  for (std::size_t i = 0; i < bytes; ++i) {
    const auto byte = source();
    text += kDigits[byte & 15U];
    text += kDigits[(byte >> 4) & 15U];
  }
  return text;
}

std::string BlobStore::put(std::string name, SharedBytes bytes) {
  auto id = randomHex(16);
  const std::lock_guard lock(mutex_);
  bytes_ += bytes->size();
  blobs_.push_back({id, std::move(name), std::move(bytes)});
  while (blobs_.size() > 1 && (blobs_.size() > max_count_ || bytes_ > max_bytes_)) {
    bytes_ -= blobs_.front().bytes->size();
    blobs_.pop_front();
  }
  return id;
}

std::optional<BlobStore::Blob> BlobStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  for (const auto& blob : blobs_)
    if (blob.id == id) return blob;
  return std::nullopt;
}

}  // namespace radiosity::net
