#include "server/state/known_files.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace radiosity::state {
namespace {

FileIdentity identityIn(const struct stat& about) { return {about.st_dev, about.st_ino}; }

}  // namespace

Result<FileIdentity> identityOf(const std::filesystem::path& file) {
  struct stat about {};
  if (stat(file.c_str(), &about) == 0) return identityIn(about);
  const int number = errno;
  if (number == ENOENT || number == ENOTDIR)
    return fail(ErrorCode::kUnavailable, "was removed or moved away; put it back, or restart the server",
                file.string());
  return fail(ErrorCode::kUnavailable, std::string("cannot be looked at: ") + std::strerror(number), file.string());
}

std::optional<FileIdentity> identityOf(int descriptor) {
  struct stat about {};
  if (fstat(descriptor, &about) != 0) return std::nullopt;
  return identityIn(about);
}

Result<void> KnownFiles::add(const std::filesystem::path& file) {
  const auto identity = identityOf(file);
  if (!identity) return tl::unexpected(identity.error());
  add(file, *identity);
  return {};
}

Result<void> KnownFiles::check() const {
  for (const auto& [path, identity] : files_) {
    const auto now = identityOf(path);
    if (!now) return tl::unexpected(now.error());
    if (*now != identity)
      return fail(ErrorCode::kUnavailable,
                  "another file lies here than the one that this server has open; put that one back, or restart the "
                  "server",
                  path.string());
  }
  return {};
}

}  // namespace radiosity::state
