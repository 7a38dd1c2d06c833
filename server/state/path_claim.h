// Tells servers of each other that were given the same path for their state, one after the folder of the other was
// removed or moved away: the lock that the first one holds went away with its folder. Advice only: what keeps edits
// apart is that each server writes to the files that it opened (known_files.h).
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>

namespace radiosity::state {

/// An abstract socket whose name is made of the folder's name and the identity of the folder above; the system takes it
/// back when the process ends. Servers in the same network namespace see it. Any thread.
class PathClaim {
 public:
  /// Waits up to a second for a server that is about to end. Costs nothing where nobody else claims the path.
  [[nodiscard]] static PathClaim take(const std::filesystem::path& folder);
  PathClaim(PathClaim&& other) noexcept;
  PathClaim& operator=(PathClaim&&) = delete;
  PathClaim(const PathClaim&) = delete;
  PathClaim& operator=(const PathClaim&) = delete;
  ~PathClaim();

  /// The process that was there first, -1 where the system does not tell its number; nothing: the claim is ours, or no
  /// claims can be made here.
  [[nodiscard]] std::optional<pid_t> other() const { return other_; }

 private:
  explicit PathClaim(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
  std::optional<pid_t> other_;
};

}  // namespace radiosity::state
