// What all sessions share: the engine, the viewers, the history of patches for those who come back, answers of patches
// that may be asked twice, uploads and encoded tiles. Owned by Server, outlives every session. Thread-safe: engine
// callbacks enter on the solve thread, hold the lock for a copy and hand over to each session's strand.
#pragma once

#include <array>
#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "protocol/codec.h"
#include "server/engine/engine.h"
#include "server/net/blob_store.h"
#include "server/net/camera_board.h"
#include "server/net/counters.h"
#include "server/net/send_room.h"
#include "server/net/server_options.h"
#include "server/net/tile_cache.h"

namespace radiosity::net {

using SharedText = std::shared_ptr<const std::string>;

/// A TCP connection of any kind, as the server's shutdown sees it. Any thread.
class Connection {
 public:
  virtual ~Connection() = default;
  /// Finish what was begun, then close.
  virtual void drain() = 0;
};

/// A WebSocket session that has said hello, as the hub sees it. Any thread.
class Viewer {
 public:
  virtual ~Viewer() = default;
  virtual void sendText(SharedText text) = 0;      ///< in order, none lost
  virtual void sendProgress(SharedText text) = 0;  ///< only the newest counts
  virtual void lightmapsChanged() = 0;
  virtual void camerasChanged() = 0;
};

class Hub : public engine::Listener, public std::enable_shared_from_this<Hub> {
 public:
  Hub(const ServerOptions& options, engine::Engine& engine);
  void start();  ///< listens to the engine

  [[nodiscard]] const ServerOptions& options() const { return options_; }
  [[nodiscard]] engine::Engine& engine() { return engine_; }
  [[nodiscard]] const std::string& epoch() const { return epoch_; }
  [[nodiscard]] std::uint64_t revision() const;  ///< the highest anyone has told us of
  void sawRevision(std::uint64_t revision);
  /// The newest of a quantity that is being watched; nothing until it has come.
  [[nodiscard]] std::shared_ptr<const engine::Lightmaps> lightmaps(engine::Quantity quantity);
  /// Until it is let go, lightmaps of the quantity come and viewers are told.
  [[nodiscard]] std::shared_ptr<void> watch(engine::Quantity quantity);
  [[nodiscard]] protocol::ServerInfo serverInfo();

  void add(const std::weak_ptr<Connection>& connection);
  /// Tells everyone the new count. `welcome` is called first, with the present revision and what a viewer who has seen
  /// `resume` has missed: notifications in order; nothing when it must start afresh. It is called under the lock: all
  /// that is told to viewers from then on comes behind what it sends, and nothing falls between.
  using Welcome = std::function<void(std::uint64_t revision, std::optional<std::vector<SharedText>> missed)>;
  void join(const std::weak_ptr<Viewer>& viewer, const std::optional<protocol::Resume>& resume, const Welcome& welcome);
  void leave(const Viewer& viewer);
  [[nodiscard]] std::size_t viewerCount() const;
  /// Of a connection, among those that the engine serves in turn; never 0.
  [[nodiscard]] std::uint64_t nextSession() { return ++sessions_; }

  /// Tells those who share theirs. Returns the camera's number; nothing when kMaxCameras are shared.
  [[nodiscard]] std::optional<std::uint64_t> shareCamera(const Viewer& viewer, const std::string& name,
                                                         const protocol::CameraPose& pose);
  void hideCamera(const Viewer& viewer);
  void broadcast(const protocol::Notification& notification);  ///< to all viewers

  /// From now on calls are refused; tells viewers and connections.
  void drain();
  /// A connection that waits for the engine lives here, so that no engine callback owns it: those may outlive the
  /// server, sockets must not. Until it is let go, or shut().
  void hold(std::shared_ptr<Connection> connection);
  void letGo(const std::shared_ptr<Connection>& connection);
  [[nodiscard]] bool draining() const { return draining_.load(); }

  using EditResult = tl::expected<protocol::SceneStepReply, protocol::RpcError>;  ///< of a patch: `edit` is 0
  using EditAnswer = std::function<void(const EditResult&)>;
  /// The same requestId gets the same answer; the engine sees it once.
  void patch(const protocol::ScenePatchCall& call, const engine::Client& by, EditAnswer done);
  /// Undo or redo; the same holds.
  void step(bool redo, std::optional<std::uint64_t> base_revision, const std::string& request_id,
            const engine::Client& by, EditAnswer done);

  /// `done` is called once: with reached = true or false (solve stopped), or nothing while draining. Forgotten when
  /// `owner` is gone.
  using WaitAnswer = std::function<void(std::optional<protocol::StatusReply>)>;
  std::uint64_t wait(const protocol::SolveWaitCall& call, std::weak_ptr<void> owner, WaitAnswer done);
  /// The waiter's time is up: answers it as not reached.
  void giveUp(std::uint64_t waiter);

  /// `done` is called once the upload is kept (on the disk, where the server has state) with its id, or why not.
  /// `id`: the SHA-256 of the bytes, so that the same lie there once and a client can tell the id beforehand.
  void keepUpload(const std::string& id, const std::string& name, const SharedBytes& bytes,
                  std::function<void(const Result<std::string>&)> done);
  /// With its bytes; blocks while they come from the disk, the first time after a restart.
  [[nodiscard]] std::optional<BlobStore::Blob> findUpload(std::string_view id);
  BlobStore& snapshots() { return snapshots_; }
  SendRoom& sendRoom() { return send_room_; }
  TileCache& tiles() { return tiles_; }
  CameraBoard& cameras() { return cameras_; }
  Counters& counters() { return counters_; }

  /// Everything that comes from the engine passes here, so that nothing reaches for a socket once shut() has returned
  /// (the engine may still be at work when the server goes). Does nothing after shut().
  template <typename F>
  void enter(F&& visit) {
    const std::lock_guard lock(gate_);
    if (!shut_) visit();
  }
  /// An engine callback that enters before it does anything. `visit` must not own a session.
  template <typename T, typename F>
  [[nodiscard]] engine::Engine::Callback<T> fromEngine(F visit) {
    return [self = shared_from_this(), visit = std::move(visit)](Result<T> result) {
      self->enter([&] { visit(std::move(result)); });
    };
  }
  /// The same; `make` is done before that, on the engine's thread: what takes long must not hold up others.
  template <typename T, typename Make, typename F>
  [[nodiscard]] engine::Engine::Callback<T> fromEngineMade(Make make, F visit) {
    return [self = shared_from_this(), make = std::move(make), visit = std::move(visit)](Result<T> result) {
      auto made = make(std::move(result));
      self->enter([&] { visit(std::move(made)); });
    };
  }
  void shut();

  void onProgress(const engine::Status& status) override;
  void onScenePatched(std::uint64_t revision, const std::string& patch, const std::string& by) override;
  void onSceneLoaded(std::uint64_t revision) override;
  void onLightmaps(const std::shared_ptr<const engine::Lightmaps>& lightmaps) override;
  void onNotice(const engine::Notice& notice) override;

 private:
  struct Waiter {
    std::uint64_t id, revision;
    std::optional<double> error;
    std::weak_ptr<void> owner;
    WaitAnswer done;
  };
  struct Remembered {
    std::uint64_t fingerprint = 0;
    std::optional<EditResult> answer;
    std::vector<EditAnswer> waiting;
  };
  struct PastPatch {
    std::uint64_t revision;
    SharedText text;
  };

  void announceProgress(const engine::Status& status);
  void judge(std::uint64_t waiter);
  [[nodiscard]] std::vector<std::shared_ptr<Viewer>> viewers() const;
  // Both under the lock.
  [[nodiscard]] std::vector<std::shared_ptr<Viewer>> presentViewers() const;
  [[nodiscard]] std::optional<std::vector<SharedText>> missedSince(const protocol::Resume& resume) const;
  /// Calls `ask` with what is to hear the engine's outcome, unless the request was made before.
  void askOnce(const engine::Receipt& receipt, const std::string& by, EditAnswer done,
               const std::function<void(engine::Engine::Callback<engine::PatchOutcome>)>& ask);
  void remember(const std::string& request_id, const EditResult& answer);
  void bringBack(const engine::Past& past);
  void addToHistory(std::uint64_t revision, const SharedText& text);
  [[nodiscard]] SharedBytes upload(const std::string& uri);
  [[nodiscard]] static std::optional<bool> reached(const Waiter& waiter, const engine::Status& status);

  ServerOptions options_;
  engine::Engine& engine_;
  std::string epoch_;
  std::atomic<bool> draining_{false};
  std::atomic<std::uint64_t> sessions_{0};
  BlobStore uploads_, snapshots_;
  SendRoom send_room_;
  TileCache tiles_;
  CameraBoard cameras_;
  Counters counters_;
  std::recursive_mutex gate_;  ///< recursive: an engine may call back before its method returns
  bool shut_ = false;

  mutable std::mutex mutex_;  ///< everything below
  std::vector<std::weak_ptr<Connection>> connections_;
  std::set<std::shared_ptr<Connection>> held_;
  std::vector<std::weak_ptr<Viewer>> viewers_;
  std::array<std::shared_ptr<const engine::Lightmaps>, engine::kQuantityCount> lightmaps_;
  std::array<std::weak_ptr<void>, engine::kQuantityCount> watches_;  ///< one of the engine's serves all viewers
  std::uint64_t revision_ = 0;
  std::deque<PastPatch> history_;
  std::size_t history_bytes_ = 0;
  std::uint64_t history_from_ = 0;        ///< a client at this revision or later can resume
  std::uint64_t first_tile_version_ = 0;  ///< older ones are an earlier process's
  std::map<std::string, Remembered> remembered_;
  std::deque<std::string> remembered_order_;
  std::vector<Waiter> waiters_;
  std::uint64_t next_waiter_ = 1;
  std::chrono::steady_clock::time_point last_progress_;
  engine::SolveState last_state_ = engine::SolveState::kEmpty;
  std::uint64_t last_progress_revision_ = 0;
};

}  // namespace radiosity::net
