// Files of one folder that appear together or not at all: written into a hidden folder inside it, and moved from there.
// Owned by one thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/result.h"

namespace radiosity::cli {

class StagedFolder {
 public:
  /// Makes the folder where it is missing; its parent must be there. Errors name the folder: it is a file, or nothing
  /// can be made in it.
  [[nodiscard]] static Result<StagedFolder> open(const std::string& folder);

  StagedFolder(StagedFolder&& other) noexcept;
  StagedFolder& operator=(StagedFolder&&) = delete;
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;
  /// Removes what was not committed, and the folder if open() made it and nothing is in it.
  ~StagedFolder();

  /// Where a file of this name is until commit(), for those who write it themselves.
  [[nodiscard]] std::string stagedPath(std::string_view name) const;
  /// Errors: a full disk says so, with the number of bytes that did fit, and names the file by its later place.
  [[nodiscard]] Result<void> write(std::string_view name, std::span<const std::uint8_t> bytes) const;
  /// Of an error that names a file by where it is now: the same by its later place.
  [[nodiscard]] Error placed(Error error) const;

  /// Flushes all files of these names to the disk, then moves them to their places over what is there. Returns the
  /// paths. Until all are flushed nothing has been moved.
  [[nodiscard]] Result<std::vector<std::string>> commit(const std::vector<std::string>& names);

 private:
  StagedFolder(std::string folder, std::string staging, bool is_new);

  std::string folder_, staging_;
  bool is_new_ = false;
};

}  // namespace radiosity::cli
