// Uploads that outlive the server, written in a thread of their own so that no event loop waits for a disk.
// Thread-safe.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::state {

class Store;

class Uploads {
 public:
  /// The store must outlive this.
  explicit Uploads(Store& store);
  ~Uploads();
  Uploads(const Uploads&) = delete;
  Uploads& operator=(const Uploads&) = delete;

  struct Entry {
    std::string id, name;
  };
  /// Does what was asked for, and takes nothing more. Whoever hears of an upload may own this in turn, so it must not
  /// be left to the last of them, which would end it in its own thread. Once; before the store goes.
  void finish();

  /// What was there at the start, oldest first.
  [[nodiscard]] std::vector<Entry> list() const;

  /// `done` is called by the writing thread, once the upload is on the disk and those dropped are forgotten, or with
  /// why not.
  void keep(Entry entry, SharedBytes bytes, std::vector<std::string> dropped, std::function<void(Result<void>)> done);

  /// Reads one from the disk; blocks.
  [[nodiscard]] Result<SharedBytes> read(const std::string& id);

 private:
  void work();

  Store& store_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> jobs_;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace radiosity::state
