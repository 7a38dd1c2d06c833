// Uploads and snapshots that are fetched by URL: a bounded shelf; the oldest goes when it is full. Thread-safe.
#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "common/bytes.h"

namespace radiosity::net {

class BlobStore {
 public:
  BlobStore(std::size_t max_count, std::size_t max_bytes) : max_count_(max_count), max_bytes_(max_bytes) {}

  struct Blob {
    std::string id, name;
    SharedBytes bytes;
  };

  /// Returns an id that cannot be guessed.
  std::string put(std::string name, SharedBytes bytes);
  [[nodiscard]] std::optional<Blob> find(std::string_view id) const;

 private:
  std::size_t max_count_, max_bytes_;
  mutable std::mutex mutex_;
  std::deque<Blob> blobs_;
  std::size_t bytes_ = 0;
};

/// `bytes` random bytes from the system, as hexadecimal.
[[nodiscard]] std::string randomHex(std::size_t bytes);

}  // namespace radiosity::net
