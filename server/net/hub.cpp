#include "server/net/hub.h"

#include <algorithm>
#include <utility>

#include "common/sha256.h"
#include "server/net/convert.h"

namespace radiosity::net {
namespace {

constexpr std::size_t kHistoryPatches = 256;
constexpr std::size_t kHistoryBytes = std::size_t{4} << 20;
constexpr std::size_t kSnapshotsKept = 32;
constexpr std::size_t kSnapshotBytes = std::size_t{64} << 20;
constexpr std::size_t kUploadsKept = 16;
constexpr std::size_t kNoteRoomBytes = 4096;  // of a notification, around the patch

SharedText shared(std::string text) { return std::make_shared<const std::string>(std::move(text)); }

}  // namespace

Hub::Hub(const ServerOptions& options, engine::Engine& engine)
    : options_(options),
      engine_(engine),
      epoch_(engine.past().epoch.empty() ? randomHex(8) : engine.past().epoch),
      uploads_(kUploadsKept, options.max_upload_bytes),
      snapshots_(kSnapshotsKept, kSnapshotBytes),
      send_room_(kBodiesAtATime * options.max_upload_bytes) {}

void Hub::start() {
  const auto status = engine_.status();
  {
    const std::lock_guard lock(mutex_);
    revision_ = history_from_ = status.revision;
    last_state_ = status.state;
    bringBack(engine_.past());
  }
  if (options_.uploads) {
    for (auto& upload : options_.uploads->list()) uploads_.expect(std::move(upload.id), std::move(upload.name));
  }
  engine_.addListener(weak_from_this());
}

/// What an earlier process was told and has answered.
void Hub::bringBack(const engine::Past& past) {
  if (past.epoch.empty()) return;
  first_tile_version_ = past.first_tile_version;
  if (revision_ > 0) history_from_ = past.patches_from;
  for (const auto& [revision, patch, by] : past.patches) {
    if (patch.size() > protocol::kMaxMessageBytes - kNoteRoomBytes) {  // no message could tell it: fetch the scene
      history_.clear();
      history_bytes_ = 0;
      history_from_ = revision;
      continue;
    }
    addToHistory(revision, shared(protocol::encodeNotification(protocol::ScenePatched{revision, patch, by})));
  }
  for (const auto& [receipt, outcome] : past.answers) {
    remembered_[receipt.request_id] = {
        receipt.fingerprint,
        protocol::SceneStepReply{outcome.revision, outcome.affected_surfaces, outcome.affected_shots, outcome.stepped},
        {}};
    remembered_order_.push_back(receipt.request_id);
  }
}

std::uint64_t Hub::revision() const {
  const std::lock_guard lock(mutex_);
  return revision_;
}

void Hub::sawRevision(std::uint64_t revision) {
  const std::lock_guard lock(mutex_);
  revision_ = std::max(revision_, revision);
}

std::shared_ptr<const engine::Lightmaps> Hub::lightmaps(engine::Quantity quantity) {
  const std::lock_guard lock(mutex_);
  return lightmaps_[static_cast<std::size_t>(quantity)];
}

std::shared_ptr<void> Hub::watch(engine::Quantity quantity) {
  const auto i = static_cast<std::size_t>(quantity);
  {
    const std::lock_guard lock(mutex_);
    if (auto shared = watches_[i].lock()) return shared;
    lightmaps_[i].reset();  // from before, when someone else watched: the engine may have gone on since
  }
  auto watching = engine_.watch(quantity);
  const std::lock_guard lock(mutex_);
  watches_[i] = watching;
  return watching;
}

protocol::ServerInfo Hub::serverInfo() {
  protocol::ServerInfo info;
  info.server = "radiosityd/" + options_.version;
  info.epoch = epoch_;
  info.revision = revision();
  info.capabilities = protocol::methodNames();
  for (const auto* more : {"cameras", "resume", "batch", "tiles.rgba16f", "tiles.rgb9e5", "tiles.rgba32f",
                           "tiles.r32ui", "codec.none", "codec.deflate"})
    info.capabilities.emplace_back(more);
  for (std::size_t i = 0; i < engine::kQuantityCount; ++i)
    info.capabilities.push_back("quantity." + std::string(name(static_cast<protocol::Quantity>(i))));
  if (!options_.scene_root.empty()) info.capabilities.emplace_back("scene.load.file");
  info.limits = {{"messageBytes", protocol::kMaxMessageBytes},
                 {"jsonDepth", protocol::kMaxJsonDepth},
                 {"patchOperations", protocol::kMaxPatchOperations},
                 {"batchCalls", protocol::kMaxBatch},
                 {"callsInFlight", protocol::kMaxCallsInFlight},
                 {"uploadBytes", options_.max_upload_bytes},
                 {"clients", options_.max_clients},
                 {"snapshotSide", protocol::kMaxSnapshotSide},
                 {"creditBytes", static_cast<std::uint64_t>(protocol::kMaxCreditBytes)}};
  const auto status = engine_.status();
  info.lightmaps = status.pages;
  info.gl_renderer = status.gl_renderer;
  info.auth_required = !options_.token.empty();
  return info;
}

// ---- who is there ----

void Hub::add(const std::weak_ptr<Connection>& connection) {
  const std::lock_guard lock(mutex_);
  std::erase_if(connections_, [](const auto& c) { return c.expired(); });
  connections_.push_back(connection);
}

void Hub::join(const std::weak_ptr<Viewer>& viewer, const std::optional<protocol::Resume>& resume,
               const Welcome& welcome) {
  {
    const std::lock_guard lock(mutex_);
    viewers_.push_back(viewer);
    welcome(revision_, resume ? missedSince(*resume) : std::nullopt);
  }
  broadcast(protocol::ViewersNote{viewerCount()});
}

void Hub::leave(const Viewer& viewer) {
  std::size_t before = 0;
  std::size_t after = 0;
  {
    const std::lock_guard lock(mutex_);
    before = viewers_.size();
    std::erase_if(viewers_, [&](const std::weak_ptr<Viewer>& v) {
      const auto alive = v.lock();
      return alive == nullptr || alive.get() == &viewer;
    });
    after = viewers_.size();
  }
  if (before != after) broadcast(protocol::ViewersNote{after});
  hideCamera(viewer);
}

std::optional<std::uint64_t> Hub::shareCamera(const Viewer& viewer, const std::string& name,
                                              const protocol::CameraPose& pose) {
  const auto number = cameras_.put(viewer, name, pose);
  if (number)
    for (const auto& other : viewers()) other->camerasChanged();
  return number;
}

void Hub::hideCamera(const Viewer& viewer) {
  if (!cameras_.remove(viewer)) return;
  for (const auto& other : viewers()) other->camerasChanged();
}

std::size_t Hub::viewerCount() const { return viewers().size(); }

std::vector<std::shared_ptr<Viewer>> Hub::viewers() const {
  const std::lock_guard lock(mutex_);
  return presentViewers();
}

std::vector<std::shared_ptr<Viewer>> Hub::presentViewers() const {
  std::vector<std::shared_ptr<Viewer>> alive;
  for (const auto& weak : viewers_)
    if (auto viewer = weak.lock()) alive.push_back(std::move(viewer));
  return alive;
}

void Hub::broadcast(const protocol::Notification& notification) {
  const auto text = shared(protocol::encodeNotification(notification));
  for (const auto& viewer : viewers()) viewer->sendText(text);
}

void Hub::drain() {
  if (draining_.exchange(true)) return;
  engine_.callOff();
  broadcast(protocol::Draining{static_cast<std::uint64_t>(options_.drain_grace.count())});
  std::vector<Waiter> waiters;
  std::vector<std::weak_ptr<Connection>> connections;
  {
    const std::lock_guard lock(mutex_);
    waiters.swap(waiters_);
    connections = connections_;
  }
  for (const auto& waiter : waiters) waiter.done(std::nullopt);
  for (const auto& weak : connections)
    if (const auto connection = weak.lock()) connection->drain();
}

// ---- patches ----

std::optional<std::vector<SharedText>> Hub::missedSince(const protocol::Resume& resume) const {
  const auto layout_since = engine_.status().layout_since;
  // Tiles of an earlier process are all sent anew, in a layout of another number.
  const bool old_layout = resume.tile_version > first_tile_version_ && resume.tile_version < layout_since;
  if (resume.epoch != epoch_ || resume.revision > revision_ || resume.revision < history_from_) return std::nullopt;
  if (old_layout) return std::nullopt;
  std::vector<SharedText> missed;
  for (const auto& past : history_)
    if (past.revision > resume.revision) missed.push_back(past.text);
  return missed;
}

// ---- waiting for the solve ----

std::optional<bool> Hub::reached(const Waiter& waiter, const engine::Status& status) {
  if (status.revision < waiter.revision || status.state == engine::SolveState::kLoading) return std::nullopt;
  const double wanted = waiter.error.value_or(status.settings.target_error);
  const bool solved = status.state != engine::SolveState::kEmpty && status.state != engine::SolveState::kFailed;
  // Where the program chooses texels what was asked for is what people see, which is measured.
  const bool chooses = status.settings.choosesTexels();
  const bool good =
      chooses ? waiter.error && status.surface_error && status.error.total <= wanted : status.error.texels <= wanted;
  if (solved && good) return true;
  if (chooses && waiter.error && status.probes_surface) return std::nullopt;  // it is being measured
  if (hasStopped(status.state)) return solved && !waiter.error && status.state == engine::SolveState::kConverged;
  return std::nullopt;
}

std::uint64_t Hub::wait(const protocol::SolveWaitCall& call, std::weak_ptr<void> owner, WaitAnswer done) {
  std::uint64_t id = 0;
  {
    const std::lock_guard lock(mutex_);
    id = next_waiter_++;
    std::erase_if(waiters_, [](const Waiter& waiter) { return waiter.owner.expired(); });
    waiters_.push_back({id, call.revision.value_or(revision_), call.error, std::move(owner), std::move(done)});
  }
  judge(id);
  return id;
}

/// The state may be right already, and then nothing more need happen. Asked after the waiter is in the list, so that no
/// change falls between. Only this waiter hears of it: the solve thread may be telling a newer one at this moment, and
/// what viewers are told must not run backwards.
void Hub::judge(std::uint64_t waiter) {
  const auto status = engine_.status();
  std::optional<Waiter> found;
  auto reply = toStatusReply(status);
  {
    const std::lock_guard lock(mutex_);
    const auto place = std::find_if(waiters_.begin(), waiters_.end(), [&](const auto& w) { return w.id == waiter; });
    if (place == waiters_.end()) return;
    reply.reached = reached(*place, status);
    if (!reply.reached) return;
    found = std::move(*place);
    waiters_.erase(place);
  }
  found->done(std::move(reply));
}

void Hub::giveUp(std::uint64_t waiter) {
  std::optional<Waiter> found;
  {
    const std::lock_guard lock(mutex_);
    const auto place = std::find_if(waiters_.begin(), waiters_.end(), [&](const auto& w) { return w.id == waiter; });
    if (place == waiters_.end()) return;
    found = std::move(*place);
    waiters_.erase(place);
  }
  auto reply = toStatusReply(engine_.status());
  reply.reached = false;
  found->done(std::move(reply));
}

// ---- from the engine ----

void Hub::shut() {
  {
    const std::lock_guard lock(gate_);
    shut_ = true;
  }
  std::set<std::shared_ptr<Connection>> ending;
  const std::lock_guard lock(mutex_);
  ending.swap(held_);
}

void Hub::hold(std::shared_ptr<Connection> connection) {
  const std::lock_guard lock(mutex_);
  held_.insert(std::move(connection));
}

void Hub::letGo(const std::shared_ptr<Connection>& connection) {
  const std::lock_guard lock(mutex_);
  held_.erase(connection);
}

void Hub::onProgress(const engine::Status& status) {
  enter([&] { announceProgress(status); });
}

void Hub::announceProgress(const engine::Status& status) {
  std::vector<std::pair<Waiter, bool>> ready;
  bool due = false;
  {
    const std::lock_guard lock(mutex_);
    revision_ = std::max(revision_, status.revision);
    std::erase_if(waiters_, [&](Waiter& waiter) {
      const auto outcome = reached(waiter, status);
      if (outcome) ready.emplace_back(std::move(waiter), *outcome);
      return outcome.has_value();
    });
    const auto now = std::chrono::steady_clock::now();
    due = now - last_progress_ >= options_.progress_interval || status.state != last_state_ ||
          status.revision != last_progress_revision_;
    if (due) last_progress_ = now;
    last_state_ = status.state;
    last_progress_revision_ = status.revision;
  }
  for (auto& [waiter, outcome] : ready) {
    auto reply = toStatusReply(status);
    reply.reached = outcome;
    waiter.done(std::move(reply));
  }
  if (!due) return;
  const auto everyone = viewers();
  if (everyone.empty()) return;
  const auto text = shared(protocol::encodeNotification(protocol::ProgressNote{toProgress(status)}));
  for (const auto& viewer : everyone) viewer->sendProgress(text);
}

void Hub::onScenePatched(std::uint64_t revision, const std::string& patch, const std::string& by) {
  // An undo may bring back more than a message can hold.
  if (patch.size() > protocol::kMaxMessageBytes - kNoteRoomBytes) return onSceneLoaded(revision);
  const auto text = shared(protocol::encodeNotification(protocol::ScenePatched{revision, patch, by}));
  enter([&] {
    std::vector<std::shared_ptr<Viewer>> present;
    {  // who joins later finds it in the history
      const std::lock_guard lock(mutex_);
      revision_ = std::max(revision_, revision);
      addToHistory(revision, text);
      present = presentViewers();
    }
    for (const auto& viewer : present) viewer->sendText(text);
  });
}

void Hub::addToHistory(std::uint64_t revision, const SharedText& text) {
  history_.push_back({revision, text});
  history_bytes_ += text->size();
  while (history_.size() > kHistoryPatches || history_bytes_ > kHistoryBytes) {
    history_from_ = history_.front().revision;
    history_bytes_ -= history_.front().text->size();
    history_.pop_front();
  }
}

void Hub::onSceneLoaded(std::uint64_t revision) {
  {
    const std::lock_guard lock(mutex_);
    revision_ = std::max(revision_, revision);
    history_.clear();  // patches of another scene
    history_bytes_ = 0;
    history_from_ = revision;
  }
  enter([&] { broadcast(protocol::SceneLoaded{revision}); });
}

void Hub::onNotice(const engine::Notice& notice) {
  const bool replaced = notice.kind == engine::Notice::Kind::kRendererReplaced;
  enter([&] { broadcast(protocol::ServerNote{replaced ? "rendererReplaced" : "solveRestarted", notice.text}); });
}

void Hub::onLightmaps(const std::shared_ptr<const engine::Lightmaps>& lightmaps) {
  {
    const std::lock_guard lock(mutex_);
    lightmaps_[static_cast<std::size_t>(lightmaps->quantity)] = lightmaps;
  }
  enter([&] {
    for (const auto& viewer : viewers()) viewer->lightmapsChanged();
  });
}

}  // namespace radiosity::net
