// Subscriptions to other quantities than irradiance, over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "protocol/tile_frame.h"
#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using namespace protocol;  // NOLINT: the test speaks the protocol
using ::testing::Contains;
using ::testing::HasSubstr;
using Of = engine::Quantity;

constexpr std::size_t kTilesInAll = 9;  ///< of the fake engine's page with its mips

SubscribeCall to(Quantity quantity) {
  SubscribeCall call;
  call.quantity = quantity;
  return call;
}

TEST(Quantities, AreAnnouncedAsCapabilities) {
  RunningServer server;
  TestSocket socket(server.port());
  const auto note = decodeNotification(*socket.waitFor("serverInfo"));
  const auto& info = std::get<ServerInfo>(*note);
  for (const char* name : {"irradiance", "radiosity", "error", "patchId", "mipLevel", "unshot", "normal"})
    EXPECT_THAT(info.capabilities, Contains(std::string("quantity.") + name));
  EXPECT_EQ(info.lightmaps, 1U);
}

TEST(Quantities, EachComesWithItsKindAndTheLightmapsNoteNamesIt) {
  RunningServer server;
  server.engine.publish();
  server.engine.publish(3.0F, Of::kError);
  TestSocket socket(server.port());
  socket.hello();
  const auto reply = replyOf<SubscribeReply>(socket.call(to(Quantity::kError)));
  EXPECT_EQ(reply.quantity, Quantity::kError);
  EXPECT_EQ(socket.waitFor("lightmaps")->params->at("quantity"), "error");
  EXPECT_EQ(socket.waitFor("bookmark")->params->at("quantity"), "error");
  ASSERT_EQ(socket.tiles.size(), kTilesInAll);
  for (const auto& frame : socket.tiles) {
    const auto tile = decodeTile(frame);
    EXPECT_EQ(tile->header.kind, Quantity::kError);
    EXPECT_NEAR(tileImage(*tile)->at(0, 0).x, 3.0F, 3.0F * 0x1p-11F);
  }
}

TEST(Quantities, WholeNumbersComeAsTheyAreInEveryCodec) {
  RunningServer server;
  const auto version = server.engine.publish(1.0F, Of::kPatchId);
  for (const auto codec : {Codec::kNone, Codec::kDeflate}) {
    TestSocket socket(server.port());
    HelloCall hello;
    hello.client = "test";
    hello.codecs = {codec};
    socket.call(hello);
    socket.call(to(Quantity::kPatchId));
    ASSERT_TRUE(socket.waitFor("bookmark").has_value());
    ASSERT_EQ(socket.tiles.size(), kTilesInAll);
    for (const auto& frame : socket.tiles) {
      const auto tile = decodeTile(frame);
      ASSERT_TRUE(tile.has_value()) << tile.error().text();
      EXPECT_EQ(tile->header.format, PixelFormat::kR32ui);
      const auto ids = tileIds(*tile);
      const auto x = static_cast<int>(tile->header.x) + 5, y = static_cast<int>(tile->header.y) + 3;
      EXPECT_EQ((*ids)[3U * tile->header.width + 5], FakeEngine::idPattern(x, y, version));
    }
  }
}

TEST(Quantities, WhatHasASignKeepsItInEveryFormat) {
  RunningServer server;
  server.engine.publish(-2.0F, Of::kUnshot);
  for (const auto format : {PixelFormat::kRgb9e5, PixelFormat::kRgba16f, PixelFormat::kRgba32f}) {
    TestSocket socket(server.port());
    HelloCall hello;
    hello.client = "test";
    hello.tile_formats = {format};
    EXPECT_EQ(replyOf<HelloReply>(socket.call(hello)).tile_format, format);
    socket.call(to(Quantity::kUnshot));
    ASSERT_TRUE(socket.waitFor("bookmark").has_value());
    ASSERT_EQ(socket.tiles.size(), kTilesInAll);
    for (const auto& frame : socket.tiles) {
      const auto tile = decodeTile(frame);
      EXPECT_EQ(tile->header.format, format == PixelFormat::kRgb9e5 ? PixelFormat::kRgba16f : format);
      EXPECT_NEAR(tileImage(*tile)->at(0, 0).x, -2.0F, 2.0F * 0x1p-11F);
    }
  }
}

TEST(Quantities, ChangingItStartsAfreshAndTheOldOneIsNoLongerWatched) {
  RunningServer server;
  server.engine.publish();
  server.engine.publish(2.0F, Of::kUnshot);
  TestSocket socket(server.port());
  socket.hello();
  EXPECT_EQ(server.engine.watchers(Of::kIrradiance), 0) << "nobody subscribed, nothing is made";
  socket.call(to(Quantity::kIrradiance));
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  EXPECT_EQ(server.engine.watchers(Of::kIrradiance), 1);
  socket.tiles.clear();
  socket.call(to(Quantity::kUnshot));
  ASSERT_TRUE(socket.waitFor("bookmark").has_value());
  EXPECT_EQ(socket.tiles.size(), kTilesInAll);
  EXPECT_NE(decodeTile(socket.tiles.front())->header.flags & kTileReset, 0);
  EXPECT_EQ(server.engine.watchers(Of::kIrradiance), 0);
  EXPECT_EQ(server.engine.watchers(Of::kUnshot), 1);
  server.engine.publish();  // not ours any more
  const auto version = server.engine.publish(4.0F, Of::kUnshot);
  EXPECT_EQ(socket.waitFor("bookmark")->params->at("tileVersion"), version);
  for (const auto& frame : socket.tiles) EXPECT_EQ(decodeTile(frame)->header.kind, Quantity::kUnshot);
}

TEST(Quantities, ViewersShareAWatchAndTheLastOneEndsIt) {
  RunningServer server;
  server.engine.publish(2.0F, Of::kError);
  TestSocket first(server.port());
  first.hello();
  first.call(to(Quantity::kError));
  {
    TestSocket second(server.port());
    second.hello();
    second.call(to(Quantity::kError));
    ASSERT_TRUE(second.waitFor("bookmark").has_value());
    EXPECT_EQ(server.engine.watchers(Of::kError), 1);
  }
  while (first.waitFor("viewers")->params->at("count") != 1) {
  }
  while (first.waitFor("viewers")->params->at("count") != 2) {
  }
  while (first.waitFor("viewers")->params->at("count") != 1) {
  }
  EXPECT_EQ(server.engine.watchers(Of::kError), 1);
  first.close();
  TestSocket other(server.port());
  other.hello();
  for (int i = 0; i < 200 && server.engine.watchers(Of::kError) > 0; ++i) other.call(StatusCall{});
  EXPECT_EQ(server.engine.watchers(Of::kError), 0);
}

TEST(Quantities, WhatIsHeldOfOneSaysNothingOfAnother) {
  RunningServer server;
  server.engine.publish();
  server.engine.publish(2.0F, Of::kError);
  HelloCall hello;
  hello.client = "test";
  {
    TestSocket socket(server.port());
    hello.resume = Resume{replyOf<HelloReply>(socket.hello()).epoch, 0, 0, Quantity::kError};
    socket.call(to(Quantity::kError));
    hello.resume->tile_version = socket.waitFor("bookmark")->params->at("tileVersion");
  }
  TestSocket same(server.port());
  EXPECT_TRUE(replyOf<HelloReply>(same.call(hello)).resumed);
  same.call(to(Quantity::kError));
  ASSERT_TRUE(same.waitFor("bookmark").has_value());
  EXPECT_EQ(same.tiles.size(), 0U);
  TestSocket another(server.port());
  another.call(hello);
  another.call(to(Quantity::kIrradiance));
  ASSERT_TRUE(another.waitFor("bookmark").has_value());
  EXPECT_EQ(another.tiles.size(), kTilesInAll);
}

TEST(Quantities, ANameThatIsNotKnownIsRefusedByItsPointer) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  socket.sendText(R"({"jsonrpc":"2.0","id":"q","method":"subscribe","params":{"quantity":"colour"}})");
  while (const auto message = socket.read()) {
    const auto parsed = nlohmann::json::parse(message->text());
    if (parsed.value("id", "") != "q") continue;
    EXPECT_EQ(parsed["error"]["code"], -32602);
    EXPECT_EQ(parsed["error"]["data"]["pointer"], "/params/quantity");
    return;
  }
  FAIL() << "no answer";
}

TEST(Quantities, OfASingleTexelAreAnsweredAndWhatIsNotThereIsRefusedByItsPointer) {
  RunningServer server;
  const auto version = server.engine.publish();
  TestSocket socket(server.port());
  socket.hello();
  const auto texel = replyOf<TexelReply>(socket.call(TexelCall{0, 12, 7}));
  EXPECT_EQ(texel.tile_version, version);
  EXPECT_EQ(texel.irradiance, (std::array{12.0, 7.0, 0.5})) << "of the fake engine";
  EXPECT_EQ(texel.error, (std::array{0.125, 0.25, 19.0}));
  const auto refused = [&](const TexelCall& call) {
    const auto answer = socket.call(call);
    EXPECT_EQ(codeOf(answer), -32004);
    return answer.error->pointer;
  };
  EXPECT_EQ(refused({1, 0, 0}), "/params/page");
  EXPECT_EQ(refused({0, 160, 0}), "/params/x");
  EXPECT_EQ(refused({0, 0, 96}), "/params/y");
}

TEST(Quantities, AreDownloadedByName) {
  RunningServer server;
  EXPECT_EQ(request(server.port(), "GET", "/lightmaps/0.exr").body, "exr");
  EXPECT_EQ(request(server.port(), "GET", "/lightmaps/0.exr?quantity=error").body, "exr 2");
  const auto refused = request(server.port(), "GET", "/lightmaps/0.exr?quantity=colour");
  EXPECT_EQ(refused.status, 400);
  EXPECT_THAT(refused.body, HasSubstr("?quantity="));
}

}  // namespace
}  // namespace radiosity::testing
