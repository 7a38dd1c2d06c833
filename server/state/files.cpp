#include "server/state/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <string>
#include <thread>
#include <utility>

#include "common/log.h"

namespace radiosity::state {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kLockPatience = 1s;
constexpr std::size_t kNoteBytes = 24;
constexpr std::size_t kCompareBytes = std::size_t{256} << 10;

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return number_; }

 private:
  int number_;
};

tl::unexpected<Error> failErrno(const std::string& what, const fs::path& file, int number) {
  return fail(ErrorCode::kUnavailable, what + ": " + std::strerror(number), file.string());
}

Result<void> writeAll(int descriptor, std::span<const std::uint8_t> bytes, const fs::path& file) {
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return failErrno("cannot be written", file, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return {};
}

Result<void> syncFolder(const fs::path& folder) {
  const Descriptor opened(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.get() < 0 || fsync(opened.get()) != 0) return failErrno("cannot be brought to the disk", folder, errno);
  return {};
}

}  // namespace

Result<Bytes> readWhole(const fs::path& file, std::uint64_t most) {
  const Descriptor opened(open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (opened.get() < 0 && errno == ENOENT) return fail(ErrorCode::kNotFound, "does not exist", file.string());
  struct stat about {};
  if (opened.get() < 0 || fstat(opened.get(), &about) != 0) return failErrno("cannot be read", file, errno);
  if (static_cast<std::uint64_t>(about.st_size) > most)
    return fail(ErrorCode::kTooLarge, "larger than " + std::to_string(most) + " bytes", file.string());
  Bytes bytes(static_cast<std::size_t>(about.st_size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = read(opened.get(), bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return failErrno("cannot be read", file, errno);
    if (count == 0) return fail(ErrorCode::kUnavailable, "ended while it was read", file.string());
    done += static_cast<std::size_t>(count);
  }
  return bytes;
}

Result<void> writeWhole(const fs::path& file, std::span<const std::uint8_t> bytes) {
  return writeWhole(file, std::span(&bytes, 1));
}

Result<void> writeWhole(const fs::path& file, std::span<const std::span<const std::uint8_t>> parts,
                        const std::string& mark) {
  const fs::path beside = file.parent_path() / ("." + file.filename().string() + mark + ".new");
  auto written = [&]() -> Result<void> {
    const Descriptor opened(open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (opened.get() < 0) return failErrno("cannot be made", beside, errno);
    for (const auto part : parts) {
      if (auto done = writeAll(opened.get(), part, file); !done) return done;
    }
    if (fsync(opened.get()) != 0) return failErrno("cannot be brought to the disk", file, errno);
    if (rename(beside.c_str(), file.c_str()) != 0) return failErrno("cannot be put in place", file, errno);
    return {};
  }();
  if (!written) {
    unlink(beside.c_str());
    return written;
  }
  return syncFolder(file.parent_path());
}

bool isKept(const fs::path& file, std::span<const std::uint8_t> bytes) {
  const Descriptor opened(open(file.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat about {};
  if (opened.get() < 0 || fstat(opened.get(), &about) != 0 || static_cast<std::uint64_t>(about.st_size) != bytes.size())
    return false;
  Bytes part(std::min(bytes.size(), kCompareBytes));
  while (!bytes.empty()) {
    const ssize_t count = read(opened.get(), part.data(), std::min(part.size(), bytes.size()));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0 || std::memcmp(part.data(), bytes.data(), static_cast<std::size_t>(count)) != 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  // Whoever wrote it may have been killed just before it did this.
  return fsync(opened.get()) == 0 && syncFolder(file.parent_path()).has_value();
}

Result<FolderLock> FolderLock::take(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return fail(ErrorCode::kUnavailable, "cannot be made: " + error.message(), folder.string());
  const auto file = folder / "lock";
  const auto deadline = std::chrono::steady_clock::now() + kLockPatience;
  for (;;) {
    FolderLock lock(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
    if (lock.descriptor_ < 0) return failErrno("cannot be opened for writing", file, errno);
    if (flock(lock.descriptor_, LOCK_EX | LOCK_NB) == 0) {
      if (lock.isAt(file)) return lock;
    } else if (errno != EWOULDBLOCK && errno != EINTR) {
      return failErrno("cannot be locked", file, errno);
    }
    if (std::chrono::steady_clock::now() > deadline)
      return fail(ErrorCode::kUnavailable,
                  "another radiosityd uses this folder; end it, or give this one another --state", file.string());
    std::this_thread::sleep_for(10ms);
  }
}

bool FolderLock::isAt(const fs::path& file) {
  const auto locked = identityOf(descriptor_);
  const auto there = identityOf(file);
  if (!locked || !there || *there != *locked) return false;
  identity_ = *locked;
  return true;
}

FolderLock::FolderLock(FolderLock&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), identity_(other.identity_) {}

FolderLock::~FolderLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

std::uint64_t FolderLock::notedRevision() const {
  std::array<char, kNoteBytes> text{};
  const ssize_t count = pread(descriptor_, text.data(), text.size(), 0);
  std::uint64_t revision = 0;
  if (count > 0) (void)std::from_chars(text.data(), text.data() + count, revision);
  return revision;
}

void FolderLock::noteRevision(std::uint64_t revision) const {
  std::array<char, kNoteBytes> text{};
  text.fill(' ');
  (void)std::to_chars(text.data(), text.data() + text.size() - 1, revision);
  text.back() = '\n';
  if (pwrite(descriptor_, text.data(), text.size(), 0) < 0)
    log::warn("the state's lock file cannot be written: {}", std::strerror(errno));
}

}  // namespace radiosity::state
