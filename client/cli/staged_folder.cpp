#include "client/cli/staged_folder.h"

#include <fcntl.h>
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

}  // namespace

StagedFolder::StagedFolder(std::string folder, std::string staging, bool is_new)
    : folder_(std::move(folder)), staging_(std::move(staging)), is_new_(is_new) {}

StagedFolder::StagedFolder(StagedFolder&& other) noexcept
    : folder_(std::move(other.folder_)), staging_(std::exchange(other.staging_, {})), is_new_(other.is_new_) {}

StagedFolder::~StagedFolder() {
  if (staging_.empty()) return;
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  if (is_new_) fs::remove(folder_, ignored);  // only if it is empty
}

Result<StagedFolder> StagedFolder::open(const std::string& folder) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_directory(folder, error))
    return fail(ErrorCode::kBadUsage, "this is a file; the name of a folder is needed", folder);
  const bool is_new = fs::create_directory(folder, error);
  if (error) return failHere("the folder cannot be made", folder, error.value());
  auto staging = (fs::path(folder) / ".radiosity-XXXXXX").string();
  if (mkdtemp(staging.data()) == nullptr) {
    const int number = errno;
    if (is_new) fs::remove(folder, error);
    return failHere("nothing can be written into this folder", folder, number);
  }
  return StagedFolder(folder, std::move(staging), is_new);
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
