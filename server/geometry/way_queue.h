// Ways that are asked for one by one, and answered a packet at a time. One thread.
#pragma once

#include "server/geometry/ray_scene.h"

namespace radiosity::geometry {

/// `Tag`: what the asker knows a way by.
template <typename Tag>
class WayQueue {
 public:
  /// `rays` is to outlive it.
  explicit WayQueue(const RayScene& rays) : rays_(rays) {}

  /// A way from `origin` to origin + direction. Of those that are open it calls tell(tag), in the order in which they
  /// were added, here or in flush().
  template <typename Tell>
  void add(const glm::vec3& origin, const glm::vec3& direction, std::uint64_t key, const Tag& tag, const Tell& tell) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ways_.origin[axis][count_] = origin[static_cast<int>(axis)];
      ways_.direction[axis][count_] = direction[static_cast<int>(axis)];
    }
    ways_.key[count_] = key;
    tags_[count_] = tag;
    if (++count_ == kPacket) flush(tell);
  }

  /// Nothing waits for its answer.
  [[nodiscard]] bool isEmpty() const { return count_ == 0; }

  /// To be called after the last.
  template <typename Tell>
  void flush(const Tell& tell) {
    if (count_ == 0) return;
    const auto open = rays_.open(ways_, count_);
    for (std::size_t i = 0; i < count_; ++i)
      if ((open >> i & 1U) != 0) tell(tags_[i]);
    count_ = 0;
  }

 private:
  const RayScene& rays_;
  Ways ways_{};
  std::array<Tag, kPacket> tags_{};
  std::size_t count_ = 0;
};

}  // namespace radiosity::geometry
