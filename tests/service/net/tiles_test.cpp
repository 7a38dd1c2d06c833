// Tiles over real sockets: order, credit, sharing, slow readers, coming back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
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

// ---- tiles ----

using TileKey = std::tuple<std::uint32_t, int, std::uint32_t, std::uint32_t>;
TileKey keyOf(const TileHeader& h) { return {h.page, h.mip, h.x, h.y}; }

TEST(Tiles, AllArriveCoarseFirstAndHoldWhatTheEngineMade) {
  RunningServer server;
  const auto version = server.engine.publish();
  for (const auto codec : {Codec::kNone, Codec::kDeflate}) {
    TestSocket socket(server.port());
    HelloCall hello;
    hello.client = "test";
    hello.codecs = {codec};
    socket.call(hello);
    EXPECT_EQ(codeOf(socket.call(SubscribeCall{})), 0);
    ASSERT_TRUE(socket.waitFor("lightmaps").has_value());
    EXPECT_TRUE(socket.tiles.empty()) << "lightmaps comes before the first tile";
    std::set<TileKey> seen;
    int last_mip = 100;
    for (int i = 0; i < 6 + 2 + 1; ++i) {  // 160x96, 80x48, 40x24 in tiles of 64
      const auto frame = socket.nextTile();
      ASSERT_TRUE(frame.has_value());
      const auto tile = decodeTile(*frame);
      ASSERT_TRUE(tile.has_value()) << tile.error().text();
      const auto& h = tile->header;
      EXPECT_LE(h.mip, last_mip);
      EXPECT_EQ((h.flags & kTileReset) != 0, i == 0);
      EXPECT_EQ(h.tile_version, version);
      last_mip = h.mip;
      seen.insert(keyOf(h));
      const auto image = tileImage(*tile);
      for (const auto& [x, y] : {std::pair{0, 0}, std::pair{7, 5}, std::pair{h.width - 1, h.height - 1}}) {
        const auto expected =
            FakeEngine::pattern(static_cast<int>(h.x) + x, static_cast<int>(h.y) + y, version, 100.0F);
        EXPECT_NEAR(image->at(x, y).x, expected.x, expected.x * 0x1p-11F);
      }
    }
    EXPECT_EQ(seen.size(), 9U);
    EXPECT_EQ(socket.waitFor("bookmark")->params->at("tileVersion"), version);
    EXPECT_TRUE(socket.tiles.empty());
  }
}

TEST(Tiles, OnlyWhatChangedIsSentAgain) {
  RunningServer server;
  server.engine.publish();
  TestSocket socket(server.port());
  socket.hello();
  socket.call(SubscribeCall{});
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  socket.tiles.clear();
  const auto version = server.engine.publishTile(0, 2);
  const auto tile = decodeTile(*socket.nextTile());
  EXPECT_EQ(tile->header.tile_version, version);
  EXPECT_EQ(tile->header.x, 128U);
  EXPECT_EQ(socket.waitFor("bookmark")->params->at("tileVersion"), version);
  EXPECT_TRUE(socket.tiles.empty());
}

TEST(Tiles, TheSubscriptionChoosesPagesAndMips) {
  RunningServer server({}, {2, 160, 96, 3});
  server.engine.publish();
  TestSocket socket(server.port());
  socket.hello();
  SubscribeCall call;
  call.lightmaps = {1};
  call.min_mip = call.max_mip = 1;
  socket.call(call);
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  ASSERT_EQ(socket.tiles.size(), 2U);
  for (const auto& frame : socket.tiles) {
    EXPECT_EQ(decodeTile(frame)->header.page, 1U);
    EXPECT_EQ(decodeTile(frame)->header.mip, 1U);
  }
}

TEST(Tiles, ANewLayoutIsAnnouncedBeforeItsTiles) {
  RunningServer server;
  server.engine.publish();
  TestSocket socket(server.port());
  socket.hello();
  socket.call(SubscribeCall{});
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  socket.tiles.clear();
  socket.notes.clear();
  server.engine.changeLayout({1, 64, 64, 1});
  server.engine.publish();
  const auto note = socket.waitFor("lightmaps");
  ASSERT_TRUE(note.has_value());
  EXPECT_EQ(note->params->at("pages").at(0).at("width"), 64);
  EXPECT_TRUE(socket.tiles.empty());
  EXPECT_NE(decodeTile(*socket.nextTile())->header.flags & kTileReset, 0);
}

TEST(Tiles, NoMoreIsSentThanTheClientGaveCreditFor) {
  RunningServer server;
  server.engine.publish();
  TestSocket socket(server.port());
  socket.hello({}, {}, 1);
  socket.call(SubscribeCall{});
  ASSERT_TRUE(socket.nextTile().has_value()) << "one byte of credit lets one frame through";
  EXPECT_FALSE(socket.nextTile(Seconds(0.3)).has_value());
  const auto owed = replyOf<CreditReply>(socket.call(CreditCall{0})).credit_bytes;
  EXPECT_LT(owed, 0);
  socket.call(CreditCall{1 - owed});
  EXPECT_TRUE(socket.nextTile().has_value());
  EXPECT_FALSE(socket.nextTile(Seconds(0.3)).has_value());
}

TEST(Tiles, ALowRateIsARateHoweverLow) {
  RunningServer server;
  server.engine.publish();
  TestSocket socket(server.port());
  socket.hello();
  SubscribeCall call;
  call.max_hz = 1e-300;
  socket.call(call);
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  socket.tiles.clear();
  server.engine.publish();
  EXPECT_FALSE(socket.nextTile(Seconds(0.3)).has_value());
}

TEST(Tiles, TheFirstPictureDoesNotWaitForTheRate) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  SubscribeCall call;
  call.max_hz = 0.001;
  socket.call(call);  // nobody has watched so far: there is nothing yet
  EXPECT_FALSE(socket.nextTile(Seconds(0.2)).has_value());
  const auto first = server.engine.publish();
  const auto note = socket.waitFor("bookmark", Seconds(10));
  ASSERT_TRUE(note.has_value());
  EXPECT_EQ(note->params->at("tileVersion"), first);
  socket.tiles.clear();
  server.engine.publish();
  EXPECT_FALSE(socket.nextTile(Seconds(0.3)).has_value()) << "the second does";
}

TEST(Tiles, AHigherRateDoesNotWaitForTheTimeOfTheLowerOne) {
  RunningServer server;
  server.engine.publish();
  TestSocket socket(server.port());
  socket.hello();
  SubscribeCall call;
  call.max_hz = 0.001;
  socket.call(call);
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  const auto waits = server.engine.publish();  // a thousand seconds, at that rate
  socket.tiles.clear();
  EXPECT_FALSE(socket.nextTile(Seconds(0.2)).has_value());
  call.max_hz = 1.0;
  socket.call(call);
  EXPECT_EQ(socket.waitFor("bookmark")->params->at("tileVersion"), waits);
  const auto last = server.engine.publish();
  const auto note = socket.waitFor("bookmark");
  ASSERT_TRUE(note.has_value());
  EXPECT_EQ(note->params->at("tileVersion"), last);
}

TEST(Tiles, TheSameTileIsEncodedOnceForEveryone) {
  RunningServer server;
  server.engine.publish();
  for (int i = 0; i < 4; ++i) {
    TestSocket socket(server.port());
    socket.hello();
    socket.call(SubscribeCall{});
    ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  }
  const auto metrics = request(server.port(), "GET", "/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("radiosityd_tiles_encoded_total 9\n"));
  EXPECT_THAT(metrics, HasSubstr("radiosityd_tiles_sent_total 36\n"));
}

TEST(Tiles, AReaderThatStallsIsClosedAndHoldsNobodyUp) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  constexpr milliseconds kDeadline(
      5000);  // the reader does not read while it makes the next pages, which takes seconds
#else
  constexpr milliseconds kDeadline(500);
#endif
  net::ServerOptions options;
  options.write_deadline = kDeadline;
  options.close_patience = milliseconds(200);
  RunningServer server(options, {4, 512, 512, 1});
  server.engine.publish();
  Upgraded how;
  how.receive_buffer_bytes = 4096;
  TestSocket stalled(server.port(), how);
  stalled.hello({}, {PixelFormat::kRgba32f}, kMaxCreditBytes);
  stalled.sendText(encodeCall("1", SubscribeCall{}));  // and never reads again
  TestSocket reader(server.port());
  reader.hello({}, {}, kMaxCreditBytes);
  reader.call(SubscribeCall{});
  for (int i = 0; i < 3; ++i) {
    const auto version = server.engine.publish();
    nlohmann::json seen;
    while (seen != version) {
      const auto note = reader.waitFor("bookmark");
      ASSERT_TRUE(note.has_value());
      seen = note->params->at("tileVersion");
    }
  }
  ASSERT_TRUE(reader.waitFor("viewers").has_value());
  while (true) {  // the stalled one leaves
    const auto note = reader.waitFor("viewers");
    ASSERT_TRUE(note.has_value());
    if (note->params->at("count") == 1) break;
  }
  EXPECT_THAT(request(server.port(), "GET", "/metrics").body,
              HasSubstr("radiosityd_sessions_closed_total{reason=\"too_slow\"} 1\n"));
}

TEST(Tiles, AClientThatComesBackGetsOnlyWhatItMissed) {
  RunningServer server;
  server.engine.publish();
  HelloCall hello;
  hello.client = "test";
  {
    TestSocket socket(server.port());
    hello.resume = Resume{replyOf<HelloReply>(socket.hello()).epoch, 0, 0};
    socket.call(SubscribeCall{});
    hello.resume->tile_version = socket.waitFor("bookmark")->params->at("tileVersion");
  }
  TestSocket editor(server.port());
  editor.hello();
  editor.call(somePatch());
  server.engine.publishTile(0, 1);
  TestSocket back(server.port());
  EXPECT_TRUE(replyOf<HelloReply>(back.call(hello)).resumed);
  EXPECT_EQ(back.waitFor("scene.patched")->params->at("revision"), 1);
  back.call(SubscribeCall{});
  ASSERT_TRUE(back.waitFor("bookmark").has_value());
  ASSERT_EQ(back.tiles.size(), 1U);
  EXPECT_EQ(decodeTile(back.tiles[0])->header.flags & kTileReset, 0);
  hello.resume->epoch = "another";
  TestSocket fresh(server.port());
  EXPECT_FALSE(replyOf<HelloReply>(fresh.call(hello)).resumed);
}

}  // namespace
}  // namespace radiosity::testing
