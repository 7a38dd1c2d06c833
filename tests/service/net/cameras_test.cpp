// Viewers who share where they look from, over real sockets against the fake engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using namespace protocol;  // NOLINT: the test speaks the protocol
using ::testing::HasSubstr;

constexpr CameraPose kPose{{1.0, 2.0, 3.0}, {0.0, 1.0, 0.0}};

std::uint64_t numberOf(const RpcResponse& response) { return replyOf<CameraReply>(response).viewer.value_or(0); }

/// Reads until a `cameras` with so many has come; the newest state comes last, whatever was skipped before it.
std::vector<SharedCamera> camerasOf(TestSocket& socket, std::size_t count) {
  while (const auto note = socket.waitFor("cameras")) {
    const auto decoded = decodeNotification(*note);
    if (!decoded) break;
    auto cameras = std::get<CamerasNote>(*decoded).cameras;
    if (cameras.size() == count) return cameras;
  }
  ADD_FAILURE() << "no list of " << count << " cameras came";
  return {};
}

/// The answer to params given as JSON text.
RpcResponse answerTo(TestSocket& socket, const std::string& params) {
  socket.sendText(R"({"jsonrpc":"2.0","id":"raw","method":"camera","params":)" + params + "}");
  while (const auto message = socket.read()) {
    const auto parsed = parseRpc(message->text(), kMaxMessageBytes);
    if (const auto* response = std::get_if<RpcResponse>(&parsed.items.at(0))) return *response;
  }
  return {};
}

TEST(Cameras, AreToldToThoseWhoShareTheirsAndForgottenWithTheConnection) {
  RunningServer server;
  TestSocket first(server.port());
  first.hello();
  const auto mine = numberOf(first.call(CameraCall{kPose}));
  {
    TestSocket second(server.port());
    second.hello();
    constexpr CameraPose kOther{{-4.0, 0.5, 1e6}, {0.0, 0.0, 0.0}};
    const auto theirs = numberOf(second.call(CameraCall{kOther}));
    EXPECT_NE(mine, theirs);
    const auto seen = camerasOf(first, 2);
    ASSERT_EQ(seen.size(), 2U);
    EXPECT_EQ(seen[0].viewer, mine);
    EXPECT_EQ(seen[0].pose, kPose);
    EXPECT_EQ(seen[1].viewer, theirs);
    EXPECT_EQ(seen[1].pose, kOther);
    EXPECT_FALSE(seen[1].name.empty());
    EXPECT_EQ(camerasOf(second, 2).size(), 2U) << "who comes later hears of those before";
  }
  EXPECT_EQ(camerasOf(first, 1).at(0).viewer, mine);
}

TEST(Cameras, WhoHidesIsTakenOffAndHearsNoMore) {
  RunningServer server;
  TestSocket hiding(server.port());
  TestSocket other(server.port());
  hiding.hello();
  other.hello();
  numberOf(other.call(CameraCall{kPose}));
  numberOf(hiding.call(CameraCall{kPose}));
  camerasOf(other, 2);
  EXPECT_EQ(replyOf<CameraReply>(hiding.call(CameraCall{})).viewer, std::nullopt);
  camerasOf(other, 1);
  hiding.notes.clear();
  other.call(CameraCall{CameraPose{{9.0, 9.0, 9.0}, {0.0, 0.0, 0.0}}});
  EXPECT_EQ(camerasOf(other, 1).at(0).pose.position[0], 9.0);
  EXPECT_EQ(hiding.waitFor("cameras", Seconds(0.3)), std::nullopt);
}

TEST(Cameras, WhoNeverSharedHearsNothing) {
  RunningServer server;
  TestSocket silent(server.port());
  TestSocket other(server.port());
  silent.hello();
  other.hello();
  other.call(CameraCall{kPose});
  camerasOf(other, 1);
  EXPECT_EQ(silent.waitFor("cameras", Seconds(0.3)), std::nullopt);
}

TEST(Cameras, NumbersThatAreNoneAreRefusedByPlace) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto pointerOf = [&](const std::string& params) {
    const auto answer = answerTo(socket, params);
    EXPECT_EQ(codeOf(answer), -32602) << params;
    return answer.error ? answer.error->pointer : std::string();
  };
  EXPECT_EQ(pointerOf(R"({"position":[0,0,0]})"), "/params/target");
  EXPECT_EQ(pointerOf(R"({"position":[0,0],"target":[0,0,0]})"), "/params/position");
  EXPECT_EQ(pointerOf(R"({"position":[0,0,0,0],"target":[0,0,0]})"), "/params/position");
  EXPECT_EQ(pointerOf(R"({"position":[0,"1",0],"target":[0,0,0]})"), "/params/position/1");
  EXPECT_EQ(pointerOf(R"({"position":[0,0,0],"target":[0,0,2e12]})"), "/params/target/2");
  EXPECT_EQ(pointerOf(R"({"position":[0,0,0],"target":[null,0,0]})"), "/params/target/0");
  EXPECT_EQ(pointerOf("[1,2]"), "/params");
  EXPECT_EQ(codeOf(answerTo(socket, "{}")), 0);
}

TEST(Cameras, TooManyCallsAreRefusedAndTheNewestThatWasTakenIsTold) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  constexpr int kCalls = 60;
  std::string batch;
  for (int i = 1; i <= kCalls; ++i) {
    CameraCall call{kPose};
    call.pose->position[0] = i;
    batch += (i == 1 ? "[" : ",") + encodeCall(std::to_string(i), call);
  }
  socket.sendText(batch + "]");
  double last = 0.0;
  int taken = 0;
  while (last == 0.0) {
    const auto message = socket.read();
    ASSERT_TRUE(message.has_value());
    const auto answers = parseRpc(message->text(), kMaxMessageBytes);
    if (const auto* note = std::get_if<RpcRequest>(&answers.items.at(0))) socket.notes.push_back(*note);
    if (!answers.batch) continue;
    for (const auto& item : answers.items) {
      const auto& answer = std::get<RpcResponse>(item);
      if (codeOf(answer) == 0) {
        ++taken;
        last = std::stod(answer.id);
      } else {
        EXPECT_EQ(codeOf(answer), -32029);
      }
    }
  }
  EXPECT_GE(taken, static_cast<int>(kCameraCallsPerSecond));
  EXPECT_LT(taken, kCalls) << "reading one message does not take two seconds";
  for (double told = 0.0; told != last;) {
    const auto cameras = camerasOf(socket, 1);
    ASSERT_EQ(cameras.size(), 1U);
    told = cameras[0].pose.position[0];
  }
  EXPECT_EQ(codeOf(socket.call(CameraCall{})), 0) << "hiding is never refused";
}

TEST(Cameras, NoMoreThanTheLimitAreShared) {
  net::ServerOptions options;
  options.idle_timeout =
      std::chrono::minutes(10);  // none of them answers pings while others come, which takes its time
  RunningServer server(options);
  std::vector<TestSocket> sockets;
  for (std::size_t i = 0; i < kMaxCameras; ++i) {
    auto& socket = sockets.emplace_back(server.port());
    socket.hello();
    ASSERT_EQ(codeOf(socket.call(CameraCall{kPose})), 0) << i;
  }
  TestSocket late(server.port());
  late.hello();
  const auto refusal = late.call(CameraCall{kPose});
  ASSERT_EQ(codeOf(refusal), -32013);
  EXPECT_THAT(refusal.error->message, HasSubstr("64"));
  sockets.front().call(CameraCall{});
  EXPECT_EQ(codeOf(late.call(CameraCall{kPose})), 0);
}

}  // namespace
}  // namespace radiosity::testing
