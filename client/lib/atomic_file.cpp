#include "client/lib/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>
#include <vector>

#include "common/check.h"

namespace radiosity::client {
namespace {

tl::unexpected<Error> failErrno(const std::string& what, const std::string& path, int number) {
  if (number == ENOSPC || number == EDQUOT)
    return fail(ErrorCode::kUnavailable, what + ": no space left on the disk; nothing was written under this name",
                path);
  const bool is_users_choice = number == ENOENT || number == EACCES || number == ENOTDIR || number == EROFS ||
                               number == EISDIR || number == ENAMETOOLONG || number == EPERM;
  return fail(is_users_choice ? ErrorCode::kBadUsage : ErrorCode::kUnavailable, what + ": " + std::strerror(number),
              path);
}

/// mkstemp makes files private; what the user asked for gets the permissions any new file gets.
mode_t newFileMode() {
  const mode_t mask = umask(0);
  umask(mask);
  return 0666U & ~mask;
}

}  // namespace

Result<AtomicFile> AtomicFile::create(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (path.empty() || path.back() == '/' || fs::is_directory(path, ignored))
    return fail(ErrorCode::kBadUsage, "this is a folder; a file name is needed", path);
  const fs::path folder = fs::path(path).parent_path();
  if (!folder.empty() && !fs::is_directory(folder, ignored))
    return fail(ErrorCode::kBadUsage, "the folder " + folder.string() + " does not exist", path);
  // A link is written through, as a plain write would: rename would replace the link itself.
  std::string target = path;
  if (fs::is_symlink(path, ignored)) {
    const fs::path real = fs::weakly_canonical(path, ignored);
    if (!ignored) target = real.string();
  }
  if (fs::exists(target, ignored) && !fs::is_regular_file(target, ignored))
    return fail(ErrorCode::kBadUsage, "this is not a regular file", path);

  const fs::path place(target);
  const std::string pattern = (place.parent_path() / ("." + place.filename().string() + ".XXXXXX")).string();
  std::vector<char> name(pattern.begin(), pattern.end());
  name.push_back('\0');
  const int descriptor = mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) return failErrno("cannot create a file here", path, errno);
  (void)fchmod(descriptor, newFileMode());
  return AtomicFile(std::move(target), name.data(), descriptor);
}

AtomicFile::AtomicFile(std::string path, std::string temporary, int descriptor)
    : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_bytes_(other.size_bytes_) {
  other.temporary_.clear();
}

AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept {
  if (this != &other) {
    discard();
    path_ = std::move(other.path_);
    temporary_ = std::move(other.temporary_);
    other.temporary_.clear();
    descriptor_ = std::exchange(other.descriptor_, -1);
    size_bytes_ = other.size_bytes_;
  }
  return *this;
}

AtomicFile::~AtomicFile() { discard(); }

void AtomicFile::discard() noexcept {
  if (descriptor_ >= 0) close(std::exchange(descriptor_, -1));
  if (!temporary_.empty()) unlink(temporary_.c_str());
  temporary_.clear();
}

Result<void> AtomicFile::write(std::span<const std::uint8_t> bytes) {
  RAD_CHECK(descriptor_ >= 0);
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      const int number = errno;
      return failErrno("writing failed after " + std::to_string(size_bytes_) + " bytes", path_, number);
    }
    size_bytes_ += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return {};
}

Result<std::string> AtomicFile::start(std::size_t most) const {
  RAD_CHECK(descriptor_ >= 0);
  std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(most, size_bytes_)), '\0');
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = pread(descriptor_, text.data() + done, text.size() - done, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return failErrno("what was written cannot be read", path_, count < 0 ? errno : EIO);
    done += static_cast<std::size_t>(count);
  }
  return text;
}

Result<void> AtomicFile::write(std::string_view text) {
  return write(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

Result<void> AtomicFile::commit() {
  RAD_CHECK(descriptor_ >= 0);
  if (fsync(descriptor_) != 0 && errno != EINVAL) return failErrno("writing to the disk failed", path_, errno);
  if (close(std::exchange(descriptor_, -1)) != 0) return failErrno("writing failed", path_, errno);
  if (rename(temporary_.c_str(), path_.c_str()) != 0) return failErrno("cannot be put in place", path_, errno);
  temporary_.clear();
  // So that the new name outlives a power failure too; some file systems cannot, and then it is as good as it gets.
  const auto folder = std::filesystem::path(path_).parent_path();
  const int opened = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened >= 0) {
    (void)fsync(opened);
    close(opened);
  }
  return {};
}

}  // namespace radiosity::client
