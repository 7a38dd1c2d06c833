// The methods of radiosity.v1 for one session: text in, answers out through the peer. Knows no sockets. Lives and is
// called on its session's strand; engine callbacks come back through Peer::sendText, which any thread may call.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/codec.h"
#include "server/net/hub.h"
#include "server/net/tile_lane.h"

namespace radiosity::net {

/// The session as its calls see it.
class Peer : public Viewer {
 public:
  /// Runs `task` on the session's strand after a while, if the session still lives and the timer is not forgotten.
  using Timer = std::uint64_t;
  [[nodiscard]] virtual Timer later(std::chrono::milliseconds delay, std::function<void()> task) = 0;
  /// From any thread: the timer is of no use any more.
  virtual void forget(Timer timer) = 0;
  /// From any thread, in order with sendText(): what the client missed while it was away.
  virtual void sendMissed(std::vector<SharedText> texts) = 0;
  virtual void greeted() = 0;      ///< hello was accepted
  virtual void answered() = 0;     ///< from any thread: all that came in one frame is answered
  virtual void tilesWanted() = 0;  ///< there is more credit
  virtual void subscribed() = 0;   ///< TileLane::subscribe was called
  virtual void closeAfterWrites(protocol::CloseCode code, std::string reason) = 0;
};

class Calls {
 public:
  /// `authenticated`: the upgrade request brought the token. `peer` owns this.
  Calls(Hub& hub, std::weak_ptr<Peer> peer, TileLane& tiles, bool authenticated);

  /// One text frame.
  void handle(std::string_view text);
  /// Whether an answer is still to come; Peer::answered() says when to ask again.
  [[nodiscard]] bool answersAwaited() const { return awaited_.use_count() > 1; }
  /// Nobody reads answers any more: loads, pictures and files that were asked for are called off.
  void end() { gone_.request_stop(); }

 private:
  class Answers;
  struct Slot;  ///< where one answer goes

  void handleItem(const protocol::RpcItem& item, Slot slot);
  bool admit(const protocol::Call& call, Slot& slot);
  [[nodiscard]] static protocol::RpcError helloFirst();
  void turnAway(const Slot& slot, const protocol::RpcError& error);

  void run(const protocol::HelloCall& call, const Slot& slot);
  void run(const protocol::SceneGetCall& call, const Slot& slot);
  void run(const protocol::SceneLoadCall& call, const Slot& slot);
  void run(const protocol::ScenePatchCall& call, const Slot& slot);
  void run(const protocol::SceneUndoCall& call, const Slot& slot);
  void run(const protocol::SceneRedoCall& call, const Slot& slot);
  void run(const protocol::SceneHistoryCall& call, const Slot& slot);
  void run(const protocol::SolveConfigureCall& call, const Slot& slot);
  void run(const protocol::SolvePauseCall& call, const Slot& slot);
  void run(const protocol::SolveResumeCall& call, const Slot& slot);
  void run(const protocol::SolveRestartCall& call, const Slot& slot);
  void run(const protocol::SolveWaitCall& call, const Slot& slot);
  void run(const protocol::SolveHistoryCall& call, const Slot& slot);
  void run(const protocol::SolveMeasureCall& call, const Slot& slot);
  void run(const protocol::StatusCall& call, const Slot& slot);
  void run(const protocol::SubscribeCall& call, const Slot& slot);
  void run(const protocol::CreditCall& call, const Slot& slot);
  void run(const protocol::SnapshotCall& call, const Slot& slot);
  void run(const protocol::TexelCall& call, const Slot& slot);
  void run(const protocol::ViewersCall& call, const Slot& slot);
  void run(const protocol::CameraCall& call, const Slot& slot);
  bool takeCameraCall();

  Hub& hub_;
  std::weak_ptr<Peer> peer_;
  TileLane& tiles_;
  bool authenticated_;
  bool greeted_ = false;
  std::stop_source gone_;
  engine::Client client_;                                  ///< named by hello
  double camera_calls_ = protocol::kCameraCallsPerSecond;  ///< that may be made now; they come back with time
  std::chrono::steady_clock::time_point camera_calls_at_ = std::chrono::steady_clock::now();
  std::shared_ptr<const int> awaited_ = std::make_shared<const int>(0);  ///< shared by what collects answers
  std::shared_ptr<std::atomic<std::size_t>> in_flight_ = std::make_shared<std::atomic<std::size_t>>(0);
};

/// "file:room.glb" below `root` as a path; kNotFound when it is not there or leads outside.
[[nodiscard]] Result<std::string> fileBelow(const std::filesystem::path& root, std::string_view relative);

}  // namespace radiosity::net
