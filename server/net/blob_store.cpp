#include "server/net/blob_store.h"

#include <algorithm>
#include <utility>

namespace radiosity::net {

bool BlobStore::forget(std::string_view id) {
  const auto known = std::find_if(blobs_.begin(), blobs_.end(), [&](const Blob& blob) { return blob.id == id; });
  if (known == blobs_.end()) return false;
  if (known->bytes) bytes_ -= known->bytes->size();
  blobs_.erase(known);
  return true;
}

BlobStore::Put BlobStore::put(std::string id, std::string name, SharedBytes bytes) {
  Put put{std::move(id)};
  const std::lock_guard lock(mutex_);
  put.was_there = forget(put.id);
  bytes_ += bytes->size();
  blobs_.push_back({put.id, std::move(name), std::move(bytes)});
  while (blobs_.size() > 1 && (blobs_.size() > max_count_ || bytes_ > max_bytes_)) {
    put.dropped.push_back(blobs_.front());
    (void)forget(put.dropped.back().id);
  }
  return put;
}

void BlobStore::takeBack(const Put& put) {
  const std::lock_guard lock(mutex_);
  if (!put.was_there) (void)forget(put.id);
  for (auto blob = put.dropped.rbegin(); blob != put.dropped.rend(); ++blob) {
    (void)forget(blob->id);  // it may have come again meanwhile
    if (blob->bytes) bytes_ += blob->bytes->size();
    blobs_.push_front(*blob);
  }
}

void BlobStore::expect(std::string id, std::string name) {
  const std::lock_guard lock(mutex_);
  blobs_.push_back({std::move(id), std::move(name), nullptr});
}

void BlobStore::drop(std::string_view id) {
  const std::lock_guard lock(mutex_);
  (void)forget(id);
}

std::optional<BlobStore::Blob> BlobStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  for (const auto& blob : blobs_)
    if (blob.id == id) return blob;
  return std::nullopt;
}

}  // namespace radiosity::net
