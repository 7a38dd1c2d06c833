// Files that are there whole or not at all, also after the power has failed. Errors name the file. Any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "common/bytes.h"
#include "common/result.h"
#include "server/state/known_files.h"

namespace radiosity::state {

/// kNotFound where there is none, kTooLarge above `most` bytes, else kUnavailable.
[[nodiscard]] Result<Bytes> readWhole(const std::filesystem::path& file, std::uint64_t most);

/// Written beside, on the disk, then renamed; the folder's entry is on the disk too. What was there stays on an error.
[[nodiscard]] Result<void> writeWhole(const std::filesystem::path& file, std::span<const std::uint8_t> bytes);
/// The same, one part after the other. What is written beside it bears `mark`: threads that may write the same file at
/// a time have one each.
[[nodiscard]] Result<void> writeWhole(const std::filesystem::path& file,
                                      std::span<const std::span<const std::uint8_t>> parts,
                                      const std::string& mark = {});
/// Whether the file is there, holds just these bytes, and will after the power has failed. Cost: reading it.
[[nodiscard]] bool isKept(const std::filesystem::path& file, std::span<const std::uint8_t> bytes);

/// A folder that exists and is ours alone until this is destroyed: a lock on its file `lock`. The file also holds the
/// last revision that was acknowledged, so that a log cut short is noticed.
class FolderLock {
 public:
  /// Waits a second for a server that is about to end. kUnavailable: another one lives there.
  [[nodiscard]] static Result<FolderLock> take(const std::filesystem::path& folder);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  ~FolderLock();

  /// Of the file `lock` that is locked.
  [[nodiscard]] FileIdentity identity() const { return identity_; }
  /// 0 where none was noted.
  [[nodiscard]] std::uint64_t notedRevision() const;
  /// Outlives this process, not a power failure: it is not waited for.
  void noteRevision(std::uint64_t revision) const;

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}
  /// Whether the file that was locked still is the one at its path: whoever removes a folder may do so between opening
  /// and locking.
  [[nodiscard]] bool isAt(const std::filesystem::path& file);
  int descriptor_ = -1;
  FileIdentity identity_;
};

}  // namespace radiosity::state
