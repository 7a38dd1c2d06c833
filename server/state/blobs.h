// Buffers, images and uploads as files named by the SHA-256 of what they hold: the same bytes lie there once, and
// damage is noticed when they are read. Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::state {

class Blobs {
 public:
  explicit Blobs(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Makes the folder.
  [[nodiscard]] Result<void> prepare() const;

  /// Cost: hashing the first time.
  [[nodiscard]] std::string idOf(const SharedBytes& bytes);
  /// Returns the id; the bytes are on the disk. Cost: hashing and writing the first time, nothing for bytes that are
  /// known.
  [[nodiscard]] Result<std::string> put(const SharedBytes& bytes);
  /// The same where the id is known already. Until release() it is not swept.
  [[nodiscard]] Result<void> putAs(const std::string& id, const SharedBytes& bytes);
  void release(const std::string& id);

  /// kBadInput where the file is not what its name says, or is not there.
  [[nodiscard]] Result<SharedBytes> get(const std::string& id);

  /// Removes all but these, and what an interrupted write left.
  void sweep(const std::set<std::string>& wanted);

 private:
  void remember(const SharedBytes& bytes, const std::string& id, bool written);

  std::filesystem::path folder_;
  std::atomic<std::uint64_t> writes_{0};  ///< an upload and a scene may bring the same bytes at a time
  std::mutex mutex_;                      ///< everything below
  struct Known {
    std::weak_ptr<const Bytes> bytes;
    std::string id;
    bool written = false;
  };
  std::map<const Bytes*, Known> known_;  ///< those that are gone, too, until it has so many entries
  std::size_t looked_through_at_ = 0;
  std::multiset<std::string> held_;  ///< written, not yet named by anything
};

/// Whether it could be the name of a blob: 64 hexadecimal digits.
[[nodiscard]] bool isBlobId(std::string_view text);

}  // namespace radiosity::state
