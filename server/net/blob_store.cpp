#include "server/net/blob_store.h"

#include <algorithm>
#include <utility>

#include "common/sha256.h"

namespace radiosity::net {

void BlobStore::forget(std::string_view id) {
  const auto known = std::find_if(blobs_.begin(), blobs_.end(), [&](const Blob& blob) { return blob.id == id; });
  if (known == blobs_.end()) return;
  if (known->bytes) bytes_ -= known->bytes->size();
  blobs_.erase(known);
}

BlobStore::Put BlobStore::put(std::string name, SharedBytes bytes) {
  Put put{naming_ == Naming::kByContent ? sha256Hex(*bytes) : randomHex(16), {}};
  const std::lock_guard lock(mutex_);
  forget(put.id);
  bytes_ += bytes->size();
  blobs_.push_back({put.id, std::move(name), std::move(bytes)});
  while (blobs_.size() > 1 && (blobs_.size() > max_count_ || bytes_ > max_bytes_)) {
    put.dropped.push_back(blobs_.front().id);
    forget(put.dropped.back());
  }
  return put;
}

void BlobStore::expect(std::string id, std::string name) {
  const std::lock_guard lock(mutex_);
  blobs_.push_back({std::move(id), std::move(name), nullptr});
}

void BlobStore::drop(std::string_view id) {
  const std::lock_guard lock(mutex_);
  forget(id);
}

std::optional<BlobStore::Blob> BlobStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  for (const auto& blob : blobs_)
    if (blob.id == id) return blob;
  return std::nullopt;
}

}  // namespace radiosity::net
