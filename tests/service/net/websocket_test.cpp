// The WebSocket side over real sockets against the fake engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "protocol/http_bodies.h"
#include "protocol/tile_frame.h"
#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using namespace protocol;  // NOLINT: the test speaks the protocol
using std::chrono::milliseconds;
using ::testing::HasSubstr;

TEST(Handshake, TheServerIntroducesItselfFirst) {
  RunningServer server;
  TestSocket socket(server.port());
  EXPECT_EQ(socket.status(), 101);
  const auto info = socket.waitFor("serverInfo");
  ASSERT_TRUE(info.has_value());
  const auto note = decodeNotification(*info);
  ASSERT_TRUE(note.has_value());
  const auto& read = std::get<ServerInfo>(*note);
  for (const auto* what : {"tiles.rgb9e5", "quantity.mipLevel", "scene.redo", "solve.configure", "camera", "resume"})
    EXPECT_THAT(read.capabilities, ::testing::Contains(what));
  EXPECT_EQ(read.limits, (std::map<std::string, std::uint64_t>{{"messageBytes", 1048576},
                                                               {"jsonDepth", 64},
                                                               {"patchOperations", 5000},
                                                               {"batchCalls", 64},
                                                               {"callsInFlight", 64},
                                                               {"uploadBytes", 1073741824},
                                                               {"clients", 256},
                                                               {"snapshotSide", 4096},
                                                               {"creditBytes", 67108864}}));
  EXPECT_FALSE(read.auth_required);
  const auto hello = replyOf<HelloReply>(socket.hello({}, {PixelFormat::kR32ui, PixelFormat::kRgb9e5}));
  EXPECT_EQ(hello.epoch, read.epoch);
  EXPECT_EQ(hello.tile_format, PixelFormat::kRgb9e5) << "the first that can be streamed";
  EXPECT_FALSE(hello.resumed);
}

TEST(Handshake, WithoutTheSubprotocolThereIsNoUpgrade) {
  RunningServer server;
  Upgraded how;
  how.subprotocol = "";
  EXPECT_EQ(TestSocket(server.port(), how).status(), 400);
  how.subprotocol = "radiosity.v2";
  EXPECT_EQ(TestSocket(server.port(), how).status(), 400);
  how.subprotocol = "radiosity.v2, radiosity.v1";
  EXPECT_EQ(TestSocket(server.port(), how).status(), 101);
}

TEST(Handshake, AForeignOriginIsRefused) {
  net::ServerOptions options;
  options.allow_origins = {"https://viewer.example.org"};
  RunningServer server(options);
  Upgraded how;
  how.origin = "https://elsewhere.example";
  EXPECT_EQ(TestSocket(server.port(), how).status(), 403);
  how.origin = "https://viewer.example.org";
  EXPECT_EQ(TestSocket(server.port(), how).status(), 101);
}

TEST(Handshake, WhoDoesNotSayHelloIsClosed) {
  net::ServerOptions options;
  options.hello_timeout = milliseconds(100);
  RunningServer server(options);
  TestSocket silent(server.port());
  EXPECT_EQ(closeCodeOf(silent), 1008);
}

TEST(Handshake, TheFirstRequestMustBeHello) {
  RunningServer server;
  TestSocket socket(server.port());
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), -32001);
  EXPECT_EQ(closeCodeOf(socket), 1008);
}

TEST(Handshake, TheTokenMayComeInHelloOrInTheHeader) {
  net::ServerOptions options;
  options.token = kSecret;
  RunningServer server(options);
  TestSocket none(server.port());
  EXPECT_EQ(codeOf(none.hello()), -32001);
  EXPECT_EQ(closeCodeOf(none), 1008);
  TestSocket wrong(server.port());
  EXPECT_EQ(codeOf(wrong.hello("0123456789abcdef0123456789abcdeX")), -32001);
  EXPECT_EQ(codeOf(TestSocket(server.port()).hello(kSecret)), 0);
  Upgraded how;
  how.authorization = std::string("Bearer ") + kSecret;
  EXPECT_EQ(codeOf(TestSocket(server.port(), how).hello()), 0);
  how.authorization = "Bearer wrong";
  EXPECT_EQ(TestSocket(server.port(), how).status(), 401);
}

TEST(Messages, WhatIsNotUnderstoodIsAnsweredAndTheSessionLives) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto answer = [&](const std::string& text) {
    socket.sendText(text);
    while (const auto message = socket.read()) {
      if (message->binary) continue;
      const auto parsed = parseRpc(message->text(), kMaxMessageBytes);
      if (const auto* response = std::get_if<RpcResponse>(&parsed.items.at(0))) return *response;
    }
    return RpcResponse{};
  };
  EXPECT_EQ(codeOf(answer("{")), -32700);
  EXPECT_EQ(codeOf(answer(std::string(100'000, '['))), -32700);
  EXPECT_EQ(codeOf(answer("[]")), -32600);
  EXPECT_EQ(codeOf(answer(R"({"jsonrpc":"2.0","id":4,"method":"no.such"})")), -32601);
  const auto bad = answer(R"({"jsonrpc":"2.0","id":"x","method":"solve.configure","params":{"targetError":7}})");
  EXPECT_EQ(codeOf(bad), -32602);
  EXPECT_EQ(bad.id, "\"x\"");
  EXPECT_EQ(bad.error->pointer, "/params/targetError");
  EXPECT_EQ(codeOf(socket.hello()), -32600) << "hello once";
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0);
}

TEST(Messages, ABatchIsAnsweredInOneArray) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  socket.sendText(
      R"([{"jsonrpc":"2.0","id":1,"method":"viewers"},{"jsonrpc":"2.0","method":"credit","params":{"bytes":1}},
                      {"jsonrpc":"2.0","id":2,"method":"nope"},5])");
  while (const auto message = socket.read()) {
    const auto parsed = nlohmann::json::parse(message->text());
    if (!parsed.is_array()) continue;
    EXPECT_EQ(parsed.size(), 3U) << "a notification is not answered";
    return;
  }
  FAIL() << "no answer";
}

TEST(Messages, ABatchIsNotAnsweredWithMoreThanAMessageHolds) {
  RunningServer server;
  server.engine.setSceneText(R"({"asset":{"version":"2.0"},"extras":")" + std::string(200'000, 'x') + "\"}");
  TestSocket socket(server.port());
  socket.hello();
  std::string batch;
  for (int i = 0; i < 20; ++i)
    batch += (i == 0 ? "[" : ",") + fmt::format(R"({{"jsonrpc":"2.0","id":{},"method":"scene.get"}})", i);
  socket.sendText(batch + "]");
  while (const auto message = socket.read()) {
    const auto answers = nlohmann::json::parse(message->text());
    if (!answers.is_array()) continue;
    EXPECT_LE(message->bytes.size(), kMaxMessageBytes);
    ASSERT_EQ(answers.size(), 20U);
    EXPECT_TRUE(answers[0].contains("result"));
    EXPECT_EQ(answers[19]["error"]["code"], -32013);
    EXPECT_EQ(answers[19]["id"], 19);
    return;
  }
  FAIL() << "no answer";
}

TEST(Messages, APatchThatOthersCouldNotBeToldOfIsTooLarge) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  auto patch = somePatch();
  patch.patch = R"([{"op":"add","path":"/extras","value":")" + std::string(kMaxMessageBytes - 1500, 'x') + "\"}]";
  EXPECT_EQ(codeOf(socket.call(patch)), -32013);
  EXPECT_EQ(server.engine.patchesSeen(), 0U);
}

TEST(Messages, OneOverTheLimitClosesTheSession) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  socket.sendText("\"" + std::string(kMaxMessageBytes, 'x') + "\"");
  EXPECT_EQ(closeCodeOf(socket), 1009);
}

TEST(Messages, ABinaryFrameClosesTheSession) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  socket.sendBinary("RADT");
  EXPECT_EQ(closeCodeOf(socket), 1003);
}

TEST(Messages, TextThatIsNotUtf8OrAFrameThatIsNotMaskedClosesTheSession) {
  RunningServer server;
  TestSocket bad_text(server.port());
  bad_text.hello();
  bad_text.sendText("\"\xff\xfe\"");
  EXPECT_EQ(closeCodeOf(bad_text), 1007);
  TestSocket unmasked(server.port());
  unmasked.hello();
  unmasked.sendRaw(std::string("\x81\x02{}", 4));
  EXPECT_EQ(closeCodeOf(unmasked), 1002);
}

TEST(Messages, TooManyCallsAtATimeAreRefused) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  server.engine.holdAnswers();
  for (std::size_t i = 0; i < kMaxCallsInFlight; ++i)
    socket.sendText(R"({"jsonrpc":"2.0","id":"held","method":"scene.get"})");
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), -32029);
  server.engine.release();
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0);
}

TEST(Messages, CreditIsTakenHoweverManyCallsWait) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello({}, {}, 0);
  (void)socket.call(SubscribeCall{});
  server.engine.publish();
  server.engine.holdAnswers();
  for (std::size_t i = 0; i < kMaxCallsInFlight; ++i)
    socket.sendText(R"({"jsonrpc":"2.0","id":"held","method":"scene.get"})");
  socket.sendText(R"({"jsonrpc":"2.0","method":"credit","params":{"bytes":100000}})");
  EXPECT_TRUE(socket.nextTile(Seconds(10)).has_value());
}

TEST(Scene, GetGivesTheDocument) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto reply = replyOf<SceneGetReply>(socket.call(SceneGetCall{}));
  EXPECT_THAT(reply.gltf, HasSubstr("2.0"));
}

TEST(Scene, AnUploadIsLoadedByItsUrl) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto put = request(server.port(), "PUT", "/uploads?name=hall.glb", {}, "12345");
  EXPECT_EQ(put.status, 201);
  const auto reply = replyOf<SceneLoadReply>(socket.call(SceneLoadCall{*decodeHttpUrl(put.body)}));
  EXPECT_EQ(reply.revision, 1U);
  EXPECT_EQ(server.engine.lastLoad(), "hall.glb: 5 bytes by test");
  EXPECT_TRUE(socket.waitFor("scene.loaded").has_value());
  EXPECT_EQ(codeOf(socket.call(SceneLoadCall{"/uploads/none"})), -32004);
  EXPECT_EQ(codeOf(socket.call(SceneLoadCall{"http://elsewhere.example/a.glb"})), -32602);
  EXPECT_EQ(codeOf(socket.call(SceneLoadCall{"file:hall.glb"})), -32003);
}

TEST(Scene, AFileIsLoadedOnlyFromBelowTheSceneRoot) {
  const auto folder = std::filesystem::temp_directory_path() / ("radiosity-net-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder / "root" / "sub");
  std::ofstream(folder / "outside.glb") << "x";
  std::ofstream(folder / "root" / "sub" / "a.glb") << "x";
  std::filesystem::create_symlink(folder / "outside.glb", folder / "root" / "link.glb");
  std::filesystem::create_symlink(folder, folder / "root" / "up");
  std::filesystem::create_directories(folder / "root-beside");
  std::ofstream(folder / "root-beside" / "b.glb") << "x";
  net::ServerOptions options;
  options.scene_root = folder / "root";
  {
    RunningServer server(options);
    TestSocket socket(server.port());
    socket.hello();
    EXPECT_EQ(codeOf(socket.call(SceneLoadCall{"file:sub/a.glb"})), 0);
    EXPECT_THAT(server.engine.lastLoad(), HasSubstr("root/sub/a.glb by test"));
    for (const auto* name : {"../outside.glb", "link.glb", "sub", "none.glb", "sub/../../outside.glb", "up/outside.glb",
                             "../root-beside/b.glb", "%2e%2e/outside.glb", "..%2foutside.glb",
                             "sub/%2e%2e/%2e%2e/outside.glb", "/etc/passwd", "//etc/passwd", "", ".", "sub/a.glb/"})
      EXPECT_EQ(codeOf(socket.call(SceneLoadCall{std::string("file:") + name})), -32004) << name;
    EXPECT_EQ(codeOf(socket.call(SceneLoadCall{"file:" + (folder / "outside.glb").string()})), -32004);
    for (const auto& name : {std::string("sub/a.glb\0.txt", 14), std::string("sub/a.glb%00.txt")})
      EXPECT_EQ(codeOf(socket.call(SceneLoadCall{"file:" + name})), -32602) << name;
  }
  std::filesystem::remove_all(folder);
}

TEST(Scene, APatchReachesEveryoneAndTheSecondOfTwoRacersLoses) {
  RunningServer server;
  TestSocket first(server.port());
  TestSocket second(server.port());
  first.hello();
  second.hello();
  EXPECT_EQ(replyOf<ScenePatchReply>(first.call(somePatch(0))).revision, 1U);
  const auto stale = second.call(somePatch(0));
  EXPECT_EQ(codeOf(stale), -32009);
  EXPECT_EQ(stale.error->revision, 1U);
  const auto note = second.waitFor("scene.patched");
  ASSERT_TRUE(note.has_value());
  EXPECT_EQ(note->params->at("by"), "test");
  EXPECT_EQ(note->params->at("patch").at(0).at("op"), "replace");
}

/// Makes edits of so many bytes each while nobody is there, then comes back.
void expectMissedPatchesToCome(std::size_t count, std::size_t bytes) {
  RunningServer server;
  HelloCall back;
  back.client = "test";
  back.resume.emplace();
  {
    TestSocket before(server.port());
    back.resume->epoch = replyOf<HelloReply>(before.hello()).epoch;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto patch = R"([{"op":"add","path":"/extras","value":")" + std::string(bytes, 'x') + "\"}]";
    server.engine.patch({.patch = patch, .by = "other"}, [](const auto&) {});
  }
  TestSocket socket(server.port());
  ASSERT_TRUE(replyOf<HelloReply>(socket.call(back)).resumed);
  for (std::size_t i = 0; i < count; ++i) {
    const auto note = socket.waitFor("scene.patched");
    ASSERT_TRUE(note.has_value()) << "after " << i << ", closed with " << socket.closeCode();
    EXPECT_EQ(note->params->at("revision"), i + 1);
  }
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0);
}

TEST(Resume, BringsAsManyPatchesAsAreRemembered) { expectMissedPatchesToCome(256, 10); }
TEST(Resume, BringsLongPatchesToo) { expectMissedPatchesToCome(6, 600'000); }

TEST(Solve, ConfigureKeepsWhatIsNotNamed) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  SolveConfigureCall call;
  call.time_limit_ms = 1500;
  auto settings = replyOf<Settings>(socket.call(call));
  EXPECT_EQ(settings.time_limit_ms, 1500U);
  EXPECT_EQ(settings.target_error, 0.02);
  call = {};
  call.target_error = 0.1;
  call.no_time_limit = true;
  settings = replyOf<Settings>(socket.call(call));
  EXPECT_EQ(settings.time_limit_ms, std::nullopt);
  EXPECT_EQ(settings.target_error, 0.1);
  EXPECT_EQ(replyOf<StateReply>(socket.call(SolvePauseCall{})).state, "paused");
  EXPECT_EQ(replyOf<StateReply>(socket.call(SolveResumeCall{})).state, "solving");
}

TEST(Solve, EveryoneIsToldOfNewSettingsAndOfNoOthers) {
  RunningServer server;
  TestSocket first(server.port()), second(server.port());
  first.hello();
  second.hello();
  EXPECT_EQ(replyOf<Settings>(second.call(SolveConfigureCall{})).target_error, 0.02);  // asks what they are
  SolveConfigureCall call;
  call.target_error = 0.1;
  EXPECT_EQ(replyOf<Settings>(second.call(call)).target_error, 0.1);
  const auto told = first.waitFor("solve.configured");
  ASSERT_TRUE(told.has_value());
  EXPECT_EQ(told->params->at("targetError"), 0.1);
}

TEST(Solve, ChangesOfSettingsThatFollowEachOtherAtOnceAllHold) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  server.engine.holdAnswers();
  SolveConfigureCall first, second;
  first.time_limit_ms = 100'001;
  second.target_error = 0.1;
  socket.sendText(encodeCall("\"first\"", first));
  socket.sendText(encodeCall("\"second\"", second));
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0) << "both have been read";
  server.engine.release();
  EXPECT_EQ(replyOf<Settings>(awaitAnswer(socket, "\"first\"")).target_error, 0.02);
  const auto settings = replyOf<Settings>(awaitAnswer(socket, "\"second\""));
  EXPECT_EQ(settings.time_limit_ms, 100'001U);
  EXPECT_EQ(settings.target_error, 0.1);
}

TEST(Solve, ATimeLimitThatNoClientCouldReadBackIsRefused) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  SolveConfigureCall call;
  call.time_limit_ms = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(codeOf(socket.call(call)), -32602);
  call.time_limit_ms = kMaxTimeLimitMs;
  EXPECT_EQ(replyOf<Settings>(socket.call(call)).time_limit_ms, kMaxTimeLimitMs);
  EXPECT_EQ(replyOf<StatusReply>(socket.call(StatusCall{})).settings.time_limit_ms, kMaxTimeLimitMs);
}

TEST(Solve, WaitAnswersWhenTheErrorIsReached) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  server.engine.progress(0.5);
  SolveWaitCall wait;
  wait.error = 0.1;
  socket.sendText(encodeCall("99", wait));
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0) << "waiting does not hold up other calls";
  server.engine.progress(0.2);
  server.engine.progress(0.09);
  while (const auto message = socket.read()) {
    const auto parsed = parseRpc(message->text(), kMaxMessageBytes);
    const auto* response = std::get_if<RpcResponse>(&parsed.items.at(0));
    if (response == nullptr || response->id != "99") continue;
    const auto status = replyOf<StatusReply>(*response);
    EXPECT_EQ(status.reached, true);
    EXPECT_EQ(status.progress.error.total, 0.09);
    return;
  }
  FAIL() << "no answer";
}

TEST(Solve, WaitGivesUpWhenTimeIsUpOrTheSolveHasStopped) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  server.engine.progress(0.5);
  SolveWaitCall wait;
  wait.timeout_ms = 20;
  EXPECT_EQ(replyOf<StatusReply>(socket.call(wait)).reached, false);
  wait.timeout_ms.reset();
  server.engine.progress(0.3, engine::SolveState::kTimeLimit);
  EXPECT_EQ(replyOf<StatusReply>(socket.call(wait)).reached, false);
  server.engine.progress(0.01, engine::SolveState::kConverged);
  EXPECT_EQ(replyOf<StatusReply>(socket.call(wait)).reached, true);
}

TEST(Solve, WhoBeginsToWaitDoesNotTellViewersOldProgress) {
  net::ServerOptions options;
  options.progress_interval = std::chrono::milliseconds(0);
  RunningServer server(options);
  TestSocket socket(server.port());
  socket.hello();
  server.engine.progress(0.5);
  ASSERT_TRUE(socket.waitFor("progress").has_value());
  server.engine.overtakeStatus([&] { server.engine.progress(0.2, engine::SolveState::kConverged); });
  SolveWaitCall wait;
  wait.error = 0.3;
  EXPECT_EQ(replyOf<StatusReply>(socket.call(wait)).reached, true);
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0);
  auto note = socket.waitFor("progress");
  ASSERT_TRUE(note.has_value());
  while (auto later = socket.waitFor("progress", Seconds(0.3))) note = std::move(later);
  EXPECT_EQ(note->params->at("state"), "converged");
}

TEST(Snapshot, IsTakenAtOnceAndFetchedByUrl) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto reply = replyOf<SnapshotReply>(socket.call(SnapshotCall{"desk", 64, 48, "lit"}));
  EXPECT_EQ(request(server.port(), "GET", reply.url).body, "png 64x48 lit desk 0.25");
  EXPECT_EQ(reply.exposure, 0.25);
  const auto exposed = replyOf<SnapshotReply>(socket.call(SnapshotCall{"desk", 64, 48, "lit", 2.5}));
  EXPECT_EQ(request(server.port(), "GET", exposed.url).body, "png 64x48 lit desk 2.5");
  EXPECT_EQ(exposed.exposure, 2.5);
  EXPECT_EQ(codeOf(socket.call(SnapshotCall{"nobody", 64, 48, "lit"})), -32004);
  const auto refused = socket.call(SnapshotCall{"desk", 64, 48, "colour"});
  EXPECT_EQ(codeOf(refused), -32602);
  EXPECT_EQ(refused.error->pointer, "/params/quantity");
  EXPECT_THAT(request(server.port(), "GET", "/snapshot.png?quantity=colour").body,
              HasSubstr(R"("where":"?quantity=")"));
}

TEST(Viewers, AreCountedForEveryone) {
  RunningServer server;
  TestSocket first(server.port());
  first.hello();
  EXPECT_EQ(first.waitFor("viewers")->params->at("count"), 1);
  {
    TestSocket second(server.port());
    second.hello();
    EXPECT_EQ(first.waitFor("viewers")->params->at("count"), 2);
  }
  EXPECT_EQ(first.waitFor("viewers")->params->at("count"), 1);
}

}  // namespace
}  // namespace radiosity::testing
