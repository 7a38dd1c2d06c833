// The memory for responses that wait until their peers take them. All sessions share it; what several of them send is
// in memory once, and counted once. Thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <utility>

namespace radiosity::net {

class SendRoom {
 public:
  explicit SendRoom(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// A session's part; gives it back when it goes.
  class Part {
   public:
    explicit Part(SendRoom& room) : room_(room) {}
    ~Part() { release(); }
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;

    /// False: there is no room for so much. One body always fits, or what is larger than the room could not be sent.
    [[nodiscard]] bool hold(const void* bytes, std::size_t size) {
      release();
      if (room_.enter(bytes, size)) held_ = bytes;
      return held_ != nullptr;
    }
    void release() {
      if (held_ != nullptr) room_.leave(std::exchange(held_, nullptr));
    }

   private:
    SendRoom& room_;
    const void* held_ = nullptr;
  };

  [[nodiscard]] std::size_t heldBytes() const {
    const std::lock_guard lock(mutex_);
    return held_bytes_;
  }

 private:
  struct Body {
    std::size_t size = 0, senders = 0;
  };

  bool enter(const void* bytes, std::size_t size) {
    const std::lock_guard lock(mutex_);
    if (const auto known = bodies_.find(bytes); known != bodies_.end()) {
      ++known->second.senders;
      return true;
    }
    if (held_bytes_ > 0 && (size > most_bytes_ || held_bytes_ > most_bytes_ - size)) return false;
    held_bytes_ += size;
    bodies_[bytes] = {size, 1};
    return true;
  }
  void leave(const void* bytes) {
    const std::lock_guard lock(mutex_);
    const auto body = bodies_.find(bytes);
    if (--body->second.senders > 0) return;
    held_bytes_ -= body->second.size;
    bodies_.erase(body);
  }

  const std::size_t most_bytes_;
  mutable std::mutex mutex_;
  std::map<const void*, Body> bodies_;
  std::size_t held_bytes_ = 0;
};

}  // namespace radiosity::net
