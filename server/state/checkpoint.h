// What a solve has found so far, in one file of the state's folder: the newest replaces the one before, whole or not
// at all. Only the very program that wrote it reads it again: memory lies in it as it is.
#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::state {

/// SHA-256 of this program's file, read once. Empty where it cannot be read: no checkpoint is then written or read.
[[nodiscard]] const std::string& programId();

/// Nothing where there is none. Errors say why it is of no use: kBadInput (damaged), kUnsupported (another program's),
/// kUnavailable. Cost: about 2 s a GiB.
[[nodiscard]] Result<std::optional<Bytes>> readCheckpoint(const std::filesystem::path& file);
[[nodiscard]] Result<void> writeCheckpoint(const std::filesystem::path& file, const Bytes& body);

/// Writes checkpoints in a thread of its own. Called from one thread.
class CheckpointWriter {
 public:
  /// `check` is asked before each is written, in that thread: where it fails, so does the checkpoint.
  explicit CheckpointWriter(std::filesystem::path file, std::function<Result<void>()> check = {});
  /// Ends once what is being written is on the disk; what still waits is dropped.
  ~CheckpointWriter();
  CheckpointWriter(const CheckpointWriter&) = delete;
  CheckpointWriter& operator=(const CheckpointWriter&) = delete;

  /// Something is being written, or waits to be.
  [[nodiscard]] bool isBusy() const;
  /// Takes the place of what still waits.
  void write(Bytes body);
  /// True: all is on the disk, or failed, within the time.
  [[nodiscard]] bool flush(std::chrono::milliseconds patience);
  /// How many were written, and the bytes and seconds of the last.
  struct Counters {
    std::uint64_t written = 0, failed = 0, bytes = 0;
    double seconds = 0.0;
  };
  [[nodiscard]] Counters counters() const;

 private:
  void work();

  std::filesystem::path file_;
  std::function<Result<void>()> check_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::optional<Bytes> waiting_;
  bool writing_ = false, ends_ = false;
  Counters counters_;
  std::thread thread_;
};

}  // namespace radiosity::state
