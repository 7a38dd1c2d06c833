#include "client/cli/staged_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

#include "client/lib/atomic_file.h"

namespace radiosity::cli {
namespace {

namespace fs = std::filesystem;

tl::unexpected<Error> failHere(const std::string& what, const std::string& path, int number) {
  return fail(number == ENOENT || number == EACCES || number == ENOTDIR || number == EROFS ? ErrorCode::kBadUsage
                                                                                           : ErrorCode::kUnavailable,
              what + ": " + std::strerror(number), path);
}

Result<void> flush(const std::string& path, int flags, const std::string& named) {
  const int file = ::open(path.c_str(), flags | O_CLOEXEC);
  if (file < 0) return failHere("writing failed", named, errno);
  const bool failed = fsync(file) != 0 && errno != EINVAL;  // EINVAL: this file system has no such thing
  const int number = errno;
  close(file);
  if (failed) return failHere("writing to the disk failed", named, number);
  return {};
}

constexpr std::string_view kStagingName = ".radiosity-";

/// Held while a file or folder is open, by whatever process: closing releases it. Where a file system knows no locks
/// none is held, and isHeld() says so.
class Lock {
 public:
  Lock(const std::string& path, int how) : file_(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    is_held_ = file_ >= 0 && flock(file_, how) == 0;
  }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;
  ~Lock() {
    if (file_ >= 0) close(file_);
  }

  [[nodiscard]] bool isHeld() const { return is_held_; }
  /// The file, which stays open.
  [[nodiscard]] int release() { return std::exchange(file_, -1); }

 private:
  int file_;
  bool is_held_;
};

/// What programs left that were killed. Those that still run hold a lock of theirs. `folder` is locked by the caller.
void sweep(const std::string& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (!entry.path().filename().string().starts_with(kStagingName) || !entry.is_directory(ignored)) continue;
    if (const Lock lock(entry.path().string(), LOCK_EX | LOCK_NB); lock.isHeld()) fs::remove_all(entry.path(), ignored);
  }
}

}  // namespace

StagedFolder::StagedFolder(std::string folder, std::string staging, int lock, bool is_new)
    : folder_(std::move(folder)), staging_(std::move(staging)), lock_(lock), is_new_(is_new) {}

StagedFolder::StagedFolder(StagedFolder&& other) noexcept
    : folder_(std::move(other.folder_)),
      staging_(std::exchange(other.staging_, {})),
      lock_(std::exchange(other.lock_, -1)),
      is_new_(other.is_new_) {}

StagedFolder::~StagedFolder() {
  if (staging_.empty()) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  if (lock_ >= 0) close(lock_);
  if (is_new_) fs::remove(folder_, ignored);  // only if it is empty
}

Result<StagedFolder> StagedFolder::open(const std::string& folder) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_directory(folder, error))
    return fail(ErrorCode::kBadUsage, "this is a file; the name of a folder is needed", folder);
  const bool is_new = fs::create_directory(folder, error);
  if (error) return failHere("the folder cannot be made", folder, error.value());
  const Lock whole(folder, LOCK_EX);  // so that nobody sweeps what is made here before it has a lock of its own
  if (whole.isHeld()) sweep(folder);
  auto staging = (fs::path(folder) / (std::string(kStagingName) + "XXXXXX")).string();
  if (mkdtemp(staging.data()) == nullptr) {
    const int number = errno;
    if (is_new) fs::remove(folder, error);
    return failHere("nothing can be written into this folder", folder, number);
  }
  Lock own(staging, LOCK_EX | LOCK_NB);
  return StagedFolder(folder, std::move(staging), own.release(), is_new);
}

std::string StagedFolder::stagedPath(std::string_view name) const { return (fs::path(staging_) / name).string(); }

Result<void> StagedFolder::write(std::string_view name, std::span<const std::uint8_t> bytes) const {
  auto file = client::AtomicFile::create(stagedPath(name));
  if (!file) return tl::unexpected(placed(file.error()));
  if (auto done = file->write(bytes); !done) return tl::unexpected(placed(done.error()));
  if (auto done = file->commit(); !done) return tl::unexpected(placed(done.error()));
  return {};
}

Error StagedFolder::placed(Error error) const {
  if (error.where.starts_with(staging_)) error.where = folder_ + error.where.substr(staging_.size());
  return error;
}

Result<std::vector<std::string>> StagedFolder::commit(const std::vector<std::string>& names) {
  std::vector<std::string> paths;
  for (const auto& name : names) {
    paths.push_back((fs::path(folder_) / name).string());
    std::error_code error;
    if (fs::is_directory(paths.back(), error))
      return fail(ErrorCode::kBadUsage, "there is a folder where a file is to be", paths.back());
    if (auto done = flush(stagedPath(name), O_RDONLY, paths.back()); !done) return tl::unexpected(done.error());
  }
  for (std::size_t i = 0; i < names.size(); ++i)
    if (std::rename(stagedPath(names[i]).c_str(), paths[i].c_str()) != 0)
      return failHere("cannot be put in place", paths[i], errno);
  (void)flush(folder_, O_RDONLY | O_DIRECTORY, folder_);  // not all file systems can
  return paths;
}

}  // namespace radiosity::cli
