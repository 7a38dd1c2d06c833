// Where the viewers who share their camera look from. Owned by Hub; any thread; holds at most protocol::kMaxCameras.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages.h"

namespace radiosity::net {

class Viewer;

class CameraBoard {
 public:
  /// Puts the owner's camera up, or moves it. Returns its number, which no other ever has; nothing when the board is
  /// full.
  [[nodiscard]] std::optional<std::uint64_t> put(const Viewer& owner, const std::string& name,
                                                 const protocol::CameraPose& pose);
  /// False: it was not up.
  bool remove(const Viewer& owner);
  /// The notification `cameras`, encoded once for all; null for who has none up.
  [[nodiscard]] std::shared_ptr<const std::string> noteFor(const Viewer& viewer);

 private:
  struct Entry {
    const Viewer* owner;
    protocol::SharedCamera camera;
  };
  [[nodiscard]] std::vector<Entry>::iterator find(const Viewer& owner);

  std::mutex mutex_;
  std::vector<Entry> entries_;
  std::uint64_t next_number_ = 1;
  std::shared_ptr<const std::string> note_;  ///< of the entries as they are; null: not made yet
};

}  // namespace radiosity::net
