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
  /// kByContent: the id is the SHA-256 of the bytes, so the same bytes lie there once and a client can tell the id
  /// beforehand. kAtRandom: it cannot be guessed.
  enum class Naming { kByContent, kAtRandom };

  BlobStore(std::size_t max_count, std::size_t max_bytes, Naming naming)
      : max_count_(max_count), max_bytes_(max_bytes), naming_(naming) {}

  struct Blob {
    std::string id, name;
    SharedBytes bytes;
  };

  /// Returns the id. What lay there already counts as new.
  std::string put(std::string name, SharedBytes bytes);
  [[nodiscard]] std::optional<Blob> find(std::string_view id) const;

 private:
  std::size_t max_count_, max_bytes_;
  Naming naming_;
  mutable std::mutex mutex_;
  std::deque<Blob> blobs_;
  std::size_t bytes_ = 0;
};

/// SHA-256 as 64 hexadecimal digits. About 1 s a GiB.
[[nodiscard]] std::string sha256Hex(const Bytes& bytes);

/// `bytes` random bytes from the system, as hexadecimal.
[[nodiscard]] std::string randomHex(std::size_t bytes);

}  // namespace radiosity::net
