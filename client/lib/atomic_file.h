// A file that appears whole or not at all: written beside its place under a temporary name, renamed at commit(). Owned
// by one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "common/result.h"

namespace radiosity::client {

class AtomicFile {
 public:
  /// Creates the temporary file in `path`'s folder. Errors name the path: folder missing or not writable, `path` is a
  /// folder.
  [[nodiscard]] static Result<AtomicFile> create(const std::string& path);

  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&& other) noexcept;
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  /// Removes the temporary file if not committed.
  ~AtomicFile();

  /// Errors: a full disk says so, with the number of bytes that did fit.
  [[nodiscard]] Result<void> write(std::span<const std::uint8_t> bytes);
  [[nodiscard]] Result<void> write(std::string_view text);

  /// Flushes to the disk and renames over `path`. Nothing may be written after it.
  [[nodiscard]] Result<void> commit();

  /// At most so many of the first bytes that were written; before commit(). Errors name the path.
  [[nodiscard]] Result<std::string> start(std::size_t most) const;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::uint64_t sizeBytes() const { return size_bytes_; }

 private:
  AtomicFile(std::string path, std::string temporary, int descriptor);
  void discard() noexcept;

  std::string path_;
  std::string temporary_;
  int descriptor_ = -1;
  std::uint64_t size_bytes_ = 0;
};

}  // namespace radiosity::client
