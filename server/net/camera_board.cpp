#include "server/net/camera_board.h"

#include <algorithm>
#include <utility>

#include "protocol/codec.h"

namespace radiosity::net {

std::vector<CameraBoard::Entry>::iterator CameraBoard::find(const Viewer& owner) {
  return std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) { return entry.owner == &owner; });
}

std::optional<std::uint64_t> CameraBoard::put(const Viewer& owner, const std::string& name,
                                              const protocol::CameraPose& pose) {
  const std::lock_guard lock(mutex_);
  auto entry = find(owner);
  if (entry == entries_.end()) {
    if (entries_.size() >= protocol::kMaxCameras) return std::nullopt;
    entry = entries_.insert(entries_.end(), {&owner, {next_number_++, name, {}}});
  }
  entry->camera.pose = pose;
  note_.reset();
  return entry->camera.viewer;
}

bool CameraBoard::remove(const Viewer& owner) {
  const std::lock_guard lock(mutex_);
  const auto entry = find(owner);
  if (entry == entries_.end()) return false;
  entries_.erase(entry);
  note_.reset();
  return true;
}

std::shared_ptr<const std::string> CameraBoard::noteFor(const Viewer& viewer) {
  const std::lock_guard lock(mutex_);
  if (find(viewer) == entries_.end()) return nullptr;
  if (note_ == nullptr) {
    protocol::CamerasNote note;
    for (const auto& entry : entries_) note.cameras.push_back(entry.camera);
    note_ = std::make_shared<const std::string>(protocol::encodeNotification(note));
  }
  return note_;
}

}  // namespace radiosity::net
