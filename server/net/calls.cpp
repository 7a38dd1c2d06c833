#include "server/net/calls.h"

#include <fmt/format.h>
#include <algorithm>
#include <mutex>
#include <utility>

#include "common/sha256.h"
#include "server/net/access.h"
#include "server/net/convert.h"

namespace radiosity::net {

using protocol::RpcCode;
using protocol::RpcError;

/// Collects the answers of one frame: a single one is sent as it comes, those of a batch together when all are there.
/// Together they are no longer than a message may be: what does not fit is answered by an error in its place.
class Calls::Answers {
 public:
  Answers(std::weak_ptr<Peer> peer, std::shared_ptr<const int> awaited, bool batch, std::size_t expected)
      : peer_(std::move(peer)), awaited_(std::move(awaited)), batch_(batch), open_(expected) {}
  ~Answers() = default;
  Answers(const Answers&) = delete;
  Answers& operator=(const Answers&) = delete;

  void add(const protocol::RequestId& id, std::string text) {
    std::string whole;
    {
      const std::lock_guard lock(mutex_);
      if (batch_ && bytes_ + text.size() > kRoom)
        text = protocol::encodeError(
            id, {RpcCode::kTooLarge, "the answers of this batch are over 1 MiB together; ask one by one"});
      bytes_ += text.size();
      if (!text.empty()) texts_.push_back(std::move(text));
      if (--open_ > 0) return;
      awaited_.reset();
      if (!texts_.empty()) whole = batch_ ? protocol::encodeBatch(texts_) : std::move(texts_.front());
    }
    const auto peer = peer_.lock();
    if (!peer) return;
    if (!whole.empty()) peer->sendText(std::make_shared<const std::string>(std::move(whole)));
    peer->answered();
  }

 private:
  /// Leaves place for the errors of all others.
  static constexpr std::size_t kRoom = protocol::kMaxMessageBytes - protocol::kMaxBatch * 512;

  std::weak_ptr<Peer> peer_;
  std::shared_ptr<const int> awaited_;  ///< Calls counts those who have it
  bool batch_;
  std::mutex mutex_;
  std::size_t open_, bytes_ = 0;
  std::vector<std::string> texts_;
};

/// Copies go into engine callbacks; the first answer counts. A notification gives its place up without text.
struct Calls::Slot {
  protocol::RequestId id;
  std::shared_ptr<Answers> answers;
  std::shared_ptr<std::atomic<std::size_t>> in_flight;
  Counters* counters;

  template <typename Reply>
  void reply(const Reply& value) const {
    finish(id.empty() ? std::string() : encodeReply(id, value));
  }
  void error(const RpcError& error) const {
    ++counters->calls_failed;
    finish(id.empty() ? std::string() : encodeError(id, error));
  }
  void drop() const { finish({}); }
  template <typename T>
  void fail(const Result<T>& result) const {
    error(protocol::toRpcError(result.error()));
  }

 private:
  void finish(std::string text) const {
    in_flight->fetch_sub(1);
    answers->add(id, std::move(text));
  }
};

Calls::Calls(Hub& hub, std::weak_ptr<Peer> peer, TileLane& tiles, bool authenticated)
    : hub_(hub),
      peer_(std::move(peer)),
      tiles_(tiles),
      authenticated_(authenticated),
      client_({}, hub.nextSession(), gone_.get_token()) {}

void Calls::handle(std::string_view text) {
  const auto message = protocol::parseRpc(text, protocol::kMaxMessageBytes);
  const auto answers = std::make_shared<Answers>(peer_, awaited_, message.batch, message.items.size());
  for (const auto& item : message.items) {
    ++hub_.counters().calls;
    in_flight_->fetch_add(1);
    handleItem(item, Slot{{}, answers, in_flight_, &hub_.counters()});
  }
}

void Calls::handleItem(const protocol::RpcItem& item, Slot slot) {
  if (const auto* malformed = std::get_if<protocol::RpcMalformed>(&item)) {
    slot.id = malformed->id;
    return greeted_ ? slot.error(malformed->error) : turnAway(slot, malformed->error);
  }
  if (std::holds_alternative<protocol::RpcResponse>(item)) return slot.drop();  // this server asks nothing
  const auto& request = std::get<protocol::RpcRequest>(item);
  slot.id = request.id;
  const auto call = protocol::decodeCall(request);
  if (!call && greeted_) return slot.error(call.error());
  if (!call) return turnAway(slot, request.method == "hello" ? call.error() : helloFirst());
  if (!admit(*call, slot)) return;
  std::visit([&](const auto& typed) { run(typed, slot); }, *call);
}

/// Hello first, once; not while draining; not too many at a time.
bool Calls::admit(const protocol::Call& call, Slot& slot) {
  const bool hello = std::holds_alternative<protocol::HelloCall>(call);
  // Answered on the spot, whatever else waits, and without it a stream of tiles would stop for ever.
  const bool credit = std::holds_alternative<protocol::CreditCall>(call);
  if (!greeted_ && !hello)
    turnAway(slot, helloFirst());
  else if (greeted_ && hello)
    slot.error({RpcCode::kInvalidRequest, "hello was said before", "/method"});
  else if (hub_.draining())
    slot.error({RpcCode::kDraining, "the server is shutting down; connect again later"});
  else if (!credit && in_flight_->load() > protocol::kMaxCallsInFlight)
    slot.error(
        {RpcCode::kRateLimited, fmt::format("more than {} calls wait for their answer", protocol::kMaxCallsInFlight)});
  else
    return true;
  return false;
}

namespace {

/// Where a name ends before its end: at a NUL, as it is or percent-encoded.
bool hasNul(std::string_view name) {
  return name.find('\0') != std::string_view::npos || name.find("%00") != std::string_view::npos;
}

}  // namespace

RpcError Calls::helloFirst() { return {RpcCode::kUnauthenticated, "the first request must be hello", "/method"}; }

/// Answers, and closes: who cannot say hello has no business here.
void Calls::turnAway(const Slot& slot, const RpcError& error) {
  slot.error(error);
  if (const auto peer = peer_.lock())
    peer->closeAfterWrites(protocol::CloseCode::kPolicy,
                           error.code == RpcCode::kUnauthenticated ? error.message : "the first request was no hello");
}

void Calls::run(const protocol::HelloCall& call, const Slot& slot) {
  if (!authenticated_ && !hub_.options().token.empty() && !sameSecret(call.token, hub_.options().token))
    return turnAway(slot, {RpcCode::kUnauthenticated, "token is missing or wrong", "/params/token"});
  protocol::HelloReply reply;
  reply.epoch = hub_.epoch();
  const auto streamed = [](protocol::PixelFormat f) { return f != protocol::PixelFormat::kR32ui; };
  const auto format = std::find_if(call.tile_formats.begin(), call.tile_formats.end(), streamed);
  if (format != call.tile_formats.end()) reply.tile_format = *format;
  if (!call.codecs.empty()) reply.codec = call.codecs.front();
  reply.credit_bytes = call.credit_bytes;
  const auto peer = peer_.lock();
  if (peer == nullptr) return;
  tiles_.setFormat(reply.tile_format, reply.codec);
  tiles_.setCredit(reply.credit_bytes);
  greeted_ = true;
  client_.name = call.client;
  hub_.join(peer, call.resume, [&](std::uint64_t revision, std::optional<std::vector<SharedText>> missed) {
    reply.revision = revision;
    reply.resumed = missed.has_value();
    if (missed) tiles_.resumeFrom(*call.resume);
    slot.reply(reply);
    if (missed) peer->sendMissed(std::move(*missed));
  });
  peer->greeted();
}

void Calls::run(const protocol::SceneGetCall& /*call*/, const Slot& slot) {
  hub_.engine().sceneText(hub_.fromEngine<engine::Engine::SceneText>([slot](Result<engine::Engine::SceneText> text) {
    if (!text) return slot.fail(text);
    protocol::SceneGetReply reply{text->revision, {}, {}};
    if (text->gltf.size() <= protocol::kMaxInlineSceneBytes)
      reply.gltf = std::move(text->gltf);
    else
      reply.url = "/scene.gltf";
    slot.reply(reply);
  }));
}

void Calls::run(const protocol::SceneLoadCall& call, const Slot& slot) {
  auto done = hub_.fromEngine<engine::LoadOutcome>([slot, hub = &hub_](const Result<engine::LoadOutcome>& outcome) {
    if (!outcome) return slot.fail(outcome);
    hub->sawRevision(outcome->revision);
    slot.reply(protocol::SceneLoadReply{outcome->revision, firstWarnings(outcome->warnings)});
  });
  constexpr std::string_view kUpload = "/uploads/";
  constexpr std::string_view kFile = "file:";
  if (call.url.starts_with(kUpload)) {
    const auto blob = hub_.findUpload(std::string_view(call.url).substr(kUpload.size()));
    if (!blob)
      return slot.error({RpcCode::kNotFound, "there is no such upload (any more); PUT it to /uploads", "/params/url"});
    return hub_.engine().loadBytes(blob->name, blob->bytes, client_, std::move(done));
  }
  if (!call.url.starts_with(kFile))
    return slot.error({RpcCode::kInvalidParams, "/params/url must be /uploads/<id> or file:<name>", "/params/url"});
  if (hub_.options().scene_root.empty())
    return slot.error({RpcCode::kForbidden, "this server reads no files of its own (--scene-root)", "/params/url"});
  if (hasNul(call.url)) return slot.error({RpcCode::kInvalidParams, "a file's name has no NUL", "/params/url"});
  auto path = fileBelow(hub_.options().scene_root, std::string_view(call.url).substr(kFile.size()));
  if (!path) return slot.error({RpcCode::kNotFound, path.error().message, "/params/url"});
  hub_.engine().loadFile(std::move(*path), client_, std::move(done));
}

void Calls::run(const protocol::ScenePatchCall& call, const Slot& slot) {
  // Everyone is told of it, with who made it, in one message. Written out by us it may be longer than it came.
  constexpr std::size_t kRoomForTheRest = 4096;
  if (call.patch.size() > protocol::kMaxMessageBytes - kRoomForTheRest)
    return slot.error(
        {RpcCode::kTooLarge, "the patch is too long to be told to others; make it in parts", "/params/patch"});
  hub_.patch(call, client_, [slot](const Hub::EditResult& answer) {
    if (!answer) return slot.error(answer.error());
    slot.reply(protocol::ScenePatchReply{answer->revision, answer->affected_surfaces, answer->affected_shots});
  });
}

namespace {

template <typename Slot>
Hub::EditAnswer stepAnswer(Slot slot) {
  return [slot](const Hub::EditResult& answer) { answer ? slot.reply(*answer) : slot.error(answer.error()); };
}

}  // namespace

void Calls::run(const protocol::SceneUndoCall& call, const Slot& slot) {
  hub_.step(false, call.base_revision, call.request_id, client_, stepAnswer(slot));
}
void Calls::run(const protocol::SceneRedoCall& call, const Slot& slot) {
  hub_.step(true, call.base_revision, call.request_id, client_, stepAnswer(slot));
}

void Calls::run(const protocol::SceneHistoryCall& call, const Slot& slot) {
  hub_.engine().history(
      hub_.fromEngine<engine::HistoryReport>([slot, limit = call.limit](const Result<engine::HistoryReport>& report) {
        report ? slot.reply(toHistoryReply(*report, limit)) : slot.fail(report);
      }));
}

void Calls::run(const protocol::SolveConfigureCall& call, const Slot& slot) {
  const auto changed = std::make_shared<bool>(false);  // written before the engine answers
  auto answer = [hub = &hub_, slot, changed](const Result<engine::SolveSettings>& settings) {
    if (!settings) return slot.fail(settings);
    // A solve that is over tells of no progress, so others would not hear of what it aims at now.
    if (*changed) hub->broadcast(protocol::SolveConfigured{toSettings(*settings)});
    slot.reply(toSettings(*settings));
  };
  const auto change = [call, changed](const engine::SolveSettings& now) {
    auto settings = merged(now, call);
    *changed = settings != now;
    return settings;
  };
  hub_.engine().configure(change, hub_.fromEngine<engine::SolveSettings>(std::move(answer)));
}

namespace {

template <typename Slot>
engine::Engine::Callback<engine::SolveState> stateAnswer(Hub& hub, Slot slot) {
  return hub.fromEngine<engine::SolveState>([slot](const Result<engine::SolveState>& state) {
    if (!state) return slot.fail(state);
    slot.reply(protocol::StateReply{std::string(stateName(*state))});
  });
}

}  // namespace

void Calls::run(const protocol::SolvePauseCall& /*call*/, const Slot& slot) {
  hub_.engine().pause(stateAnswer(hub_, slot));
}
void Calls::run(const protocol::SolveResumeCall& /*call*/, const Slot& slot) {
  hub_.engine().resume(stateAnswer(hub_, slot));
}
void Calls::run(const protocol::SolveRestartCall& /*call*/, const Slot& slot) {
  hub_.engine().restart(stateAnswer(hub_, slot));
}

void Calls::run(const protocol::SolveWaitCall& call, const Slot& slot) {
  const auto peer = peer_.lock();
  if (peer == nullptr) return;
  // The timer comes first, so that an answer at once finds what it makes useless; it learns below whom to give up,
  // before this strand can come to its task.
  const auto waiter = std::make_shared<std::uint64_t>(0);
  std::optional<Peer::Timer> timer;
  if (call.timeout_ms)
    timer = peer->later(std::chrono::milliseconds(*call.timeout_ms),
                        [hub = hub_.shared_from_this(), waiter] { hub->giveUp(*waiter); });
  const auto answer = [slot, timer, weak = peer_](const std::optional<protocol::StatusReply>& status) {
    if (const auto waiting = timer ? weak.lock() : nullptr) waiting->forget(*timer);
    if (status) return slot.reply(*status);
    slot.error({RpcCode::kDraining, "the server is shutting down; connect again later"});
  };
  *waiter = hub_.wait(call, peer_, answer);
}

void Calls::run(const protocol::SolveHistoryCall& /*call*/, const Slot& slot) {
  slot.reply(toSolveHistoryReply(hub_.engine().solveHistory()));
}

void Calls::run(const protocol::SolveMeasureCall& call, const Slot& slot) {
  hub_.engine().measure({call.plane, call.daylight_factor}, client_,
                        hub_.fromEngine<engine::MeasureReport>([slot](const Result<engine::MeasureReport>& report) {
                          if (report) return slot.reply(withoutLongGrids(toPlanes(*report)));
                          auto error = protocol::toRpcError(report.error());
                          if (!error.pointer.empty()) error.pointer = "/params/" + error.pointer;
                          slot.error(error);
                        }));
}

void Calls::run(const protocol::StatusCall& /*call*/, const Slot& slot) {
  slot.reply(toStatusReply(hub_.engine().status()));
}

void Calls::run(const protocol::SubscribeCall& call, const Slot& slot) {
  tiles_.subscribe(call);
  slot.reply(protocol::SubscribeReply{call.lightmaps, call.min_mip, call.max_mip, call.max_hz, call.quantity});
  if (const auto peer = peer_.lock()) peer->subscribed();
}

void Calls::run(const protocol::CreditCall& call, const Slot& slot) {
  tiles_.addCredit(call.bytes);
  slot.reply(protocol::CreditReply{tiles_.credit()});
  if (const auto peer = peer_.lock()) peer->tilesWanted();
}

void Calls::run(const protocol::SnapshotCall& call, const Slot& slot) {
  engine::SnapshotRequest request{call.camera, call.width, call.height, call.quantity, call.exposure};
  hub_.engine().snapshot(std::move(request), client_,
                         hub_.fromEngine<engine::Snapshot>([slot, hub = &hub_](const Result<engine::Snapshot>& made) {
                           if (!made) {
                             auto error = protocol::toRpcError(made.error());
                             if (made.error().code == ErrorCode::kBadUsage) error.pointer = "/params/" + error.pointer;
                             return slot.error(error);
                           }
                           const auto id = hub->snapshots().put(randomHex(16), "snapshot.png", made->png).id;
                           slot.reply(protocol::SnapshotReply{fmt::format("/snapshots/{}.png", id), made->exposure});
                         }));
}

void Calls::run(const protocol::TexelCall& call, const Slot& slot) {
  hub_.engine().texel({call.page, call.x, call.y},
                      hub_.fromEngine<engine::Texel>([slot](const Result<engine::Texel>& texel) {
                        if (texel) return slot.reply(toTexelReply(*texel));
                        auto error = protocol::toRpcError(texel.error());
                        if (!error.pointer.empty()) error.pointer = "/params/" + error.pointer;
                        slot.error(error);
                      }));
}

void Calls::run(const protocol::ViewersCall& /*call*/, const Slot& slot) {
  slot.reply(protocol::ViewersReply{hub_.viewerCount()});
}

bool Calls::takeCameraCall() {
  constexpr double kMost = protocol::kCameraCallsPerSecond;
  const auto now = std::chrono::steady_clock::now();
  const double seconds = std::chrono::duration<double>(now - std::exchange(camera_calls_at_, now)).count();
  camera_calls_ = std::min(kMost, camera_calls_ + kMost * seconds);
  if (camera_calls_ < 1.0) return false;
  camera_calls_ -= 1.0;
  return true;
}

/// Everyone may hide at any rate: that costs others nothing.
void Calls::run(const protocol::CameraCall& call, const Slot& slot) {
  const auto peer = peer_.lock();
  if (peer == nullptr) return slot.drop();
  if (!call.pose) {
    hub_.hideCamera(*peer);
    return slot.reply(protocol::CameraReply{});
  }
  if (!takeCameraCall())
    return slot.error({RpcCode::kRateLimited,
                       fmt::format("a camera may be told {} times a second", protocol::kCameraCallsPerSecond)});
  const auto number = hub_.shareCamera(*peer, client_.name, *call.pose);
  if (!number)
    return slot.error({RpcCode::kTooLarge, fmt::format("{} cameras are shared already", protocol::kMaxCameras)});
  slot.reply(protocol::CameraReply{number});
}

Result<std::string> fileBelow(const std::filesystem::path& root, std::string_view relative) {
  std::error_code error;
  const auto base = std::filesystem::canonical(root, error);
  if (error) return fail(ErrorCode::kNotFound, "the server's scene root cannot be read");
  const std::filesystem::path asked{std::string(relative)};
  const auto full = std::filesystem::canonical(base / asked, error);
  const bool inside = !error && asked.is_relative() &&
                      std::mismatch(base.begin(), base.end(), full.begin(), full.end()).first == base.end();
  if (!inside || !std::filesystem::is_regular_file(full, error))
    return fail(ErrorCode::kNotFound, fmt::format("there is no file \"{}\" in the server's scene root", relative));
  return full.string();
}

}  // namespace radiosity::net
