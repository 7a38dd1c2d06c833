#include "server/state/checkpoint.h"

#include <array>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "common/log.h"
#include "common/sha256.h"
#include "server/state/files.h"

namespace radiosity::state {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "radiosity checkpoint 1\n";
constexpr std::size_t kIdBytes = 64;
constexpr std::size_t kHeaderBytes = kMagic.size() + 2 * (kIdBytes + 1);
constexpr std::uint64_t kMostCheckpointBytes = std::uint64_t{1} << 36;

/// Magic, program and digest of the body, each ended by a line feed.
std::string headerOf(const std::string& program, std::span<const std::uint8_t> body) {
  return std::string(kMagic) + program + "\n" + sha256Hex(body) + "\n";
}

}  // namespace

const std::string& programId() {
  static const std::string kId = [] {
    const auto program = readWhole("/proc/self/exe", kMostCheckpointBytes);
    if (program) return sha256Hex(std::span(*program));
    log::warn("no checkpoints: {}", program.error().text());
    return std::string();
  }();
  return kId;
}

Result<std::optional<Bytes>> readCheckpoint(const fs::path& file) {
  auto bytes = readWhole(file, kMostCheckpointBytes);
  if (!bytes && bytes.error().code == ErrorCode::kNotFound) return std::optional<Bytes>();
  if (!bytes) return tl::unexpected(bytes.error());
  const auto at = [&](std::size_t first, std::size_t count) {
    return std::string_view(reinterpret_cast<const char*>(bytes->data()) + first, count);
  };
  if (bytes->size() < kHeaderBytes || at(0, kMagic.size()) != kMagic)
    return fail(ErrorCode::kBadInput, "no checkpoint, or cut short", file.string());
  const auto body = std::span(*bytes).subspan(kHeaderBytes);
  const auto expected = headerOf(std::string(at(kMagic.size(), kIdBytes)), body);
  if (at(0, kHeaderBytes) != expected)
    return fail(ErrorCode::kBadInput, "damaged: its digest does not fit", file.string());
  if (at(kMagic.size(), kIdBytes) != programId())
    return fail(ErrorCode::kUnsupported, "written by another version of this program", file.string());
  bytes->erase(bytes->begin(), bytes->begin() + kHeaderBytes);
  return std::optional(std::move(*bytes));
}

Result<void> writeCheckpoint(const fs::path& file, const Bytes& body) {
  const auto header = headerOf(programId(), body);
  const auto* first = reinterpret_cast<const std::uint8_t*>(header.data());
  const std::array<std::span<const std::uint8_t>, 2> parts = {std::span(first, header.size()), body};
  return writeWhole(file, parts);
}

CheckpointWriter::CheckpointWriter(fs::path file, std::function<Result<void>()> check)
    : file_(std::move(file)), check_(std::move(check)), thread_([this] { work(); }) {}

CheckpointWriter::~CheckpointWriter() {
  {
    const std::scoped_lock lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool CheckpointWriter::isBusy() const {
  const std::scoped_lock lock(mutex_);
  return writing_ || waiting_.has_value();
}

void CheckpointWriter::write(Bytes body) {
  {
    const std::scoped_lock lock(mutex_);
    waiting_ = std::move(body);
  }
  changed_.notify_all();
}

bool CheckpointWriter::flush(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, patience, [&] { return !writing_ && !waiting_; });
}

CheckpointWriter::Counters CheckpointWriter::counters() const {
  const std::scoped_lock lock(mutex_);
  return counters_;
}

void CheckpointWriter::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return ends_ || waiting_; });
    if (ends_) return;
    const Bytes body = *std::exchange(waiting_, std::nullopt);
    writing_ = true;
    lock.unlock();
    const auto begin = std::chrono::steady_clock::now();
    auto written = check_ ? check_() : Result<void>();
    if (written) written = writeCheckpoint(file_, body);
    if (!written) log::warn("no checkpoint of the solve: {}", written.error().text());
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    lock.lock();
    writing_ = false;
    written ? ++counters_.written : ++counters_.failed;
    counters_.bytes = body.size();
    counters_.seconds = seconds;
    changed_.notify_all();
  }
}

}  // namespace radiosity::state
