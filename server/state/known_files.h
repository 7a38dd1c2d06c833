// Whether paths still name the files that were found there once: what is written to an open file whose path is gone, or
// names another file, is lost at the next start.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "common/result.h"

namespace radiosity::state {

/// A file or folder, whatever its name is: device and inode.
struct FileIdentity {
  dev_t device = 0;
  ino_t inode = 0;

  bool operator==(const FileIdentity&) const = default;
};

/// Of what the path names, links followed; kUnavailable, with the file's name, where there is nothing.
[[nodiscard]] Result<FileIdentity> identityOf(const std::filesystem::path& file);
/// Of an open file.
[[nodiscard]] std::optional<FileIdentity> identityOf(int descriptor);

/// A fixed set of paths and the files that they named when they were added. check() is thread-safe with itself.
class KnownFiles {
 public:
  /// The file that the path names now.
  [[nodiscard]] Result<void> add(const std::filesystem::path& file);
  void add(std::filesystem::path file, FileIdentity identity) { files_.push_back({std::move(file), identity}); }

  /// kUnavailable: the first that is gone, or another one, by its name. Cost: one stat() a file.
  [[nodiscard]] Result<void> check() const;

 private:
  struct Known {
    std::filesystem::path path;
    FileIdentity identity;
  };
  std::vector<Known> files_;
};

}  // namespace radiosity::state
