// Uploads and snapshots that are fetched by URL: a bounded shelf; the oldest goes when it is full. Thread-safe.
#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/bytes.h"

namespace radiosity::net {

class BlobStore {
 public:
  BlobStore(std::size_t max_count, std::size_t max_bytes) : max_count_(max_count), max_bytes_(max_bytes) {}

  struct Blob {
    std::string id, name;
    SharedBytes bytes;
  };

  /// What lay there already counts as new.
  struct Put {
    std::string id;
    bool was_there = false;
    std::vector<Blob> dropped = {};  ///< those that had to go, oldest first
  };
  /// What lies there with this id makes way.
  Put put(std::string id, std::string name, SharedBytes bytes);
  /// As if put() had not been called: what lay there before lies there again.
  void takeBack(const Put& put);
  /// One that is kept elsewhere: find() gives it without bytes.
  void expect(std::string id, std::string name);
  void drop(std::string_view id);
  [[nodiscard]] std::optional<Blob> find(std::string_view id) const;

 private:
  bool forget(std::string_view id);  ///< false: it was not there

  std::size_t max_count_, max_bytes_;
  mutable std::mutex mutex_;
  std::deque<Blob> blobs_;
  std::size_t bytes_ = 0;
};

}  // namespace radiosity::net
