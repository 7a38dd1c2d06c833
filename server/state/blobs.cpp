#include "server/state/blobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "common/log.h"
#include "common/sha256.h"
#include "server/state/files.h"

namespace radiosity::state {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMostBlobBytes = std::uint64_t{1} << 32;

}  // namespace

bool isBlobId(std::string_view text) {
  constexpr std::size_t kDigits = 64;
  return text.size() == kDigits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

Result<void> Blobs::prepare() const {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) return fail(ErrorCode::kUnavailable, "cannot be made: " + error.message(), folder_.string());
  return {};
}

void Blobs::remember(const SharedBytes& bytes, const std::string& id, bool written) {
  const std::scoped_lock lock(mutex_);
  if (known_.size() >= looked_through_at_) {  // now and then: a scene may have tens of thousands
    std::erase_if(known_, [](const auto& entry) { return entry.second.bytes.expired(); });
    looked_through_at_ = 2 * known_.size() + 16;
  }
  known_[bytes.get()] = {bytes, id, written};
}

std::string Blobs::idOf(const SharedBytes& bytes) {
  {
    const std::scoped_lock lock(mutex_);
    const auto found = known_.find(bytes.get());
    if (found != known_.end() && found->second.bytes.lock() == bytes) return found->second.id;
  }
  auto id = sha256Hex(*bytes);
  remember(bytes, id, false);
  return id;
}

Result<std::string> Blobs::put(const SharedBytes& bytes) {
  const auto id = idOf(bytes);
  {
    const std::scoped_lock lock(mutex_);
    if (known_[bytes.get()].written) return id;
  }
  if (auto written = putAs(id, bytes); !written) return tl::unexpected(written.error());
  release(id);  // the solve thread sweeps, and it is this one
  return id;
}

Result<void> Blobs::putAs(const std::string& id, const SharedBytes& bytes) {
  {
    const std::scoped_lock lock(mutex_);
    held_.insert(id);
  }
  if (!isKept(folder_ / id, *bytes)) {  // also where the disk has damaged what was there
    const std::span<const std::uint8_t> whole(*bytes);
    if (auto written = writeWhole(folder_ / id, std::span(&whole, 1), fmt::format(".{}", ++writes_)); !written) {
      release(id);
      return written;
    }
  }
  remember(bytes, id, true);
  return {};
}

void Blobs::release(const std::string& id) {
  const std::scoped_lock lock(mutex_);
  if (const auto held = held_.find(id); held != held_.end()) held_.erase(held);
}

Result<SharedBytes> Blobs::get(const std::string& id) {
  {
    const std::scoped_lock lock(mutex_);
    for (const auto& [pointer, known] : known_) {
      if (known.id != id) continue;
      if (auto bytes = known.bytes.lock()) return bytes;
    }
  }
  const auto file = folder_ / id;
  auto bytes = readWhole(file, kMostBlobBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  if (sha256Hex(*bytes) != id)
    return fail(ErrorCode::kBadInput,
                "damaged: it does not hold what its name says; put a backup in its place, or move the folder away to "
                "start anew",
                file.string());
  auto shared = std::make_shared<const Bytes>(std::move(*bytes));
  remember(shared, id, true);
  return shared;
}

void Blobs::sweep(const std::set<std::string>& wanted) {
  const std::scoped_lock lock(mutex_);
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder_, error)) {
    const auto name = entry.path().filename().string();
    const bool ours = isBlobId(name) || (name.starts_with('.') && name.ends_with(".new"));
    const auto id = name.starts_with('.') ? name.substr(1, name.find('.', 1) - 1) : name;
    if (!ours || wanted.contains(name) || held_.contains(id)) continue;
    std::erase_if(known_, [&](const auto& known) { return known.second.id == name; });
    std::error_code ignored;
    fs::remove(entry.path(), ignored);
  }
}

}  // namespace radiosity::state
