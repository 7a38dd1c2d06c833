#include "client/cli/editor.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <random>
#include <thread>

#include "client/cli/interrupt.h"

namespace radiosity::cli {
namespace {

constexpr int kAttempts = 3;  ///< to send an edit over connections that are lost
/// For a server that is started again.
constexpr std::chrono::seconds kPatience{15}, kLongestWait{2};
constexpr int kRaces = 20;

using Clock = std::chrono::steady_clock;

std::string newRequestId() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
}

client::CallFailure failureOf(Error error) { return {std::move(error), {}}; }

void pause(std::chrono::milliseconds wait) {
  const auto until = Clock::now() + wait;
  while (!interrupted() && Clock::now() < until) std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

/// Who may be there again in a while: nobody answers, or a server that is stopping.
bool mayComeBack(const client::CallFailure& failure) {
  if (failure.rpc) return failure.rpc->code == protocol::RpcCode::kDraining;
  return failure.error.code == ErrorCode::kUnavailable || failure.error.code == ErrorCode::kBusy;
}

/// Once a connection was lost: tries until `deadline`.
client::CallResult<client::Connection> connectAgain(const Remote& remote, Clock::time_point deadline) {
  client::BackOff back_off;
  for (;;) {
    pause(std::min<std::chrono::milliseconds>(back_off.next(), kLongestWait));
    auto connection = remote.connect();
    if (connection || interrupted() || Clock::now() > deadline || !mayComeBack(connection.error())) return connection;
  }
}

}  // namespace

client::CallResult<FetchedScene> fetchScene(const Remote& remote) {
  auto connection = remote.connect();
  if (!connection) return tl::unexpected(connection.error());
  const auto reply = connection->call(protocol::SceneGetCall{});
  if (!reply) return tl::unexpected(reply.error());
  FetchedScene scene{reply->revision, Json::parse(reply->gltf, nullptr, false)};
  if (!reply->url.empty()) {
    // Somebody may edit between the two answers; the edit then fails as stale and is made again.
    const auto file = client::httpGet(remote.http(), reply->url);
    if (!file) return tl::unexpected(failureOf(file.error()));
    if (!file->ok()) return tl::unexpected(failureOf(httpError(*file, remote.url.text())));
    scene.gltf = Json::parse(file->body, nullptr, false);
  }
  if (!scene.gltf.is_object())
    return tl::unexpected(failureOf({ErrorCode::kUnavailable, "the server's scene is no JSON", remote.url.text()}));
  return scene;
}

template <typename CallType>
client::CallResult<typename CallType::Reply> sendEdit(const Remote& remote, CallType call) {
  call.request_id = newRequestId();
  auto connection = remote.connect();
  std::string epoch;
  for (int attempt = 1;; ++attempt) {
    if (!connection) return tl::unexpected(connection.error());
    // Request ids and revisions hold within an epoch: in another one the edit would be made again, and perhaps to
    // another scene.
    if (attempt > 1 && connection->hello().epoch != epoch)
      return tl::unexpected(failureOf({ErrorCode::kUnavailable,
                                       "the server began anew while the edit was under way; it may have been made or "
                                       "not, and is not sent again",
                                       remote.url.text()}));
    epoch = connection->hello().epoch;
    auto reply = connection->call(call);
    if (reply || reply.error().rpc || interrupted() || attempt == kAttempts) return reply;
    warn(reply.error().error.text() + "; sending the edit again");
    connection = connectAgain(remote, Clock::now() + kPatience);
  }
}

template client::CallResult<protocol::ScenePatchReply> sendEdit(const Remote&, protocol::ScenePatchCall);
template client::CallResult<protocol::SceneStepReply> sendEdit(const Remote&, protocol::SceneUndoCall);
template client::CallResult<protocol::SceneStepReply> sendEdit(const Remote&, protocol::SceneRedoCall);

client::CallResult<protocol::ScenePatchReply> editScene(const Remote& remote, const MakePatch& make) {
  for (int race = 1;; ++race) {
    const auto scene = fetchScene(remote);
    if (!scene) return tl::unexpected(scene.error());
    auto patch = make(scene->gltf);
    if (!patch) return tl::unexpected(failureOf(patch.error()));
    auto text = patch->dump();
    if (text.size() + 1024 > protocol::kMaxMessageBytes || patch->size() > protocol::kMaxPatchOperations)
      return tl::unexpected(failureOf(
          {ErrorCode::kTooLarge,
           fmt::format("the edit is too long for one message: {} operations of {}, {} bytes of {}", patch->size(),
                       protocol::kMaxPatchOperations, text.size() + 1024, protocol::kMaxMessageBytes),
           {}}));
    auto reply = sendEdit(remote, protocol::ScenePatchCall{.patch = std::move(text), .base_revision = scene->revision});
    const bool stale = !reply && reply.error().rpc && reply.error().rpc->code == protocol::RpcCode::kStaleRevision;
    if (!stale || race == kRaces || interrupted()) return reply;
  }
}

void printEdit(std::uint64_t revision, std::uint64_t surfaces, std::uint64_t shots) {
  fmt::print("revision {}, affected: {} surfaces, {} shots\n", revision, surfaces, shots);
}

}  // namespace radiosity::cli
