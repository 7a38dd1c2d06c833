// Files of one folder that are written into a hidden folder inside it, and moved from there once all are on the disk: a
// full disk leaves those that were there before. They are moved one by one, in the order that the caller states, so
// that a crash between two moves leaves some of the old and some of the new. Owned by one thread.
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
  /// Makes the folder where it is missing; its parent must be there. Hidden folders in it of programs that were killed
  /// go. Errors name the folder: it is a file, or nothing can be made in it.
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

  /// Flushes all files of these names to the disk, then moves them in this order to their places over what is there.
  /// Returns the paths. Until all are flushed nothing has been moved.
  [[nodiscard]] Result<std::vector<std::string>> commit(const std::vector<std::string>& names);

 private:
  StagedFolder(std::string folder, std::string staging, int lock, bool is_new);

  std::string folder_, staging_;
  int lock_ = -1;  ///< of the hidden folder; tells others that it is in use
  bool is_new_ = false;
};

}  // namespace radiosity::cli
