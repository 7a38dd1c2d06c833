// Where requests end, and what they are asked of: RFC 9112 over real sockets, and its rules by themselves.
#include "server/net/http_framing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/net/http_message.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using ::testing::HasSubstr;

const std::string kSecond = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";

/// What the server answers to a request with such header lines and body, and that it then closes: the request that
/// follows is not taken for one.
int statusOfLast(RunningServer& server, const std::string& lines, const std::string& body,
                 const std::string& version = "1.1") {
  RawHttp http(server.port());
  http.send("PUT /uploads HTTP/" + version + "\r\nHost: localhost\r\n" + lines + "\r\n" + body + kSecond);
  const auto got = http.receive();
  EXPECT_EQ(got.header("Connection"), "close") << lines;
  EXPECT_TRUE(http.closed(Seconds(10))) << lines;
  return got.status;
}

// ---- Transfer-Encoding ----

TEST(Framing, ATransferEncodingThatIsNotJustChunkedEndsTheConnection) {
  RunningServer server;
  const std::string body = "4\r\nglTF\r\n0\r\n\r\n";
  const struct {
    const char* lines;
    int status;
  } cases[] = {{"Transfer-Encoding: gzip\r\n", 501},
               {"Transfer-Encoding: identity\r\n", 501},
               {"Transfer-Encoding: gzip, chunked\r\n", 501},
               {"Transfer-Encoding: identity\r\nTransfer-Encoding: chunked\r\n", 501},
               {"Transfer-Encoding: xchunked\r\n", 501},
               {"Transfer-Encoding: chunked, identity\r\n", 400},
               {"Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n", 400},
               {"Transfer-Encoding: chunked, chunked\r\n", 400},
               {"Transfer-Encoding: chunked;q=1\r\n", 400},
               {"Transfer-Encoding: \r\n", 400},
               {"Transfer-Encoding: ,\r\n", 400},
               {"Transfer-Encoding : chunked\r\n", 400},
               {"Transfer-Encoding: chunked\r\nContent-Length: 4\r\n", 400},
               {"Content-Length: 4\r\nTransfer-Encoding: chunked\r\n", 400},
               {"Content-Length: 4\r\nTransfer-Encoding: identity\r\n", 400}};
  for (const auto& wrong : cases) EXPECT_EQ(statusOfLast(server, wrong.lines, body), wrong.status) << wrong.lines;
  EXPECT_EQ(statusOfLast(server, "Connection: keep-alive\r\nTransfer-Encoding: chunked\r\n", body, "1.0"), 400);
}

TEST(Framing, ChunkedIsTakenHoweverItIsSpelt) {
  RunningServer server;
  for (const auto* coding : {"chunked", "CHUNKED", " \tchunked \t"}) {
    RawHttp http(server.port());
    http.send("PUT /uploads HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding:" + std::string(coding) +
              "\r\n\r\n4;a=\"b\"\r\nglTF\r\n000\r\nX-Trailer: 1\r\n\r\n" + kSecond);
    EXPECT_EQ(http.receive().status, 201) << coding;
    EXPECT_EQ(http.receive().status, 200) << coding;
  }
}

TEST(Framing, MalformedChunksAreAnsweredBeforeTheConnectionCloses) {
  RunningServer server;
  for (const auto* body :
       {"11111111111111111\r\nx", "fffffffffffffffff\r\nx", "x\r\n", "-4\r\nglTF\r\n", "0x4\r\nglTF\r\n0\r\n\r\n",
        " 4\r\nglTF\r\n", "4 glTF\r\n0\r\n\r\n", "4\r\nglTFx\r\n0\r\n\r\n", "4\r\nglTF0\r\n\r\n", "4\nglTF\n0\n\n",
        "4\r\nglTF\r\n0\n\n", "4\rglTF", "4;=\r\nglTF\r\n0\r\n\r\n", "0\r\nno trailer\r\n\r\n", "0\r\nX: 1\n\r\n",
        "0\r\nContent-Length: 4\r\n\r\n", "0\r\nTransfer-Encoding: chunked\r\n\r\n"})
    EXPECT_EQ(statusOfLast(server, "Transfer-Encoding: chunked\r\n", body), 400) << body;
  EXPECT_EQ(statusOfLast(server, "Transfer-Encoding: chunked\r\n", "4;" + std::string(100'000, 'x')), 400);
  EXPECT_EQ(statusOfLast(server, "Transfer-Encoding: chunked\r\n", "ffffffffffffffff\r\nx"), 413);
  EXPECT_EQ(request(server.port(), "GET", "/healthz").status, 200);
}

// Nothing follows that a parser could take for the rest of the line.
TEST(Framing, LinesOfChunksThatEndWithABareLineFeedAreNotWaitedFor) {
  RunningServer server;
  for (const auto* body : {"4\nglTF\n0\n\n", "4\r\nglTF\r\n0\n\n", "4\r\nglTF\r\n0\r\nX: 1\n"}) {
    RawHttp http(server.port());
    http.send("PUT /uploads HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n" + std::string(body));
    EXPECT_EQ(http.receive().status, 400) << body;
  }
}

TEST(Framing, WhatTheParserDoesNotReadAsChunkedIsRefused) {
  net::FramingFields fields{11, false, {", chunked"}, false};
  ASSERT_TRUE(net::framingFault(fields));
  EXPECT_EQ(net::framingFault(fields)->status, 400);
  fields.read_as_chunked = true;
  EXPECT_FALSE(net::framingFault(fields));
}

TEST(Framing, AnUpgradeWithABodyIsRefused) {
  RunningServer server;
  RawHttp http(server.port());
  http.send(
      "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nContent-Length: 5\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Protocol: radiosity.v1\r\n\r\nabcde");
  EXPECT_EQ(http.receive().status, 400);
  EXPECT_TRUE(http.closed(Seconds(10)));
}

TEST(Framing, FramesRightBehindAnUpgradeAreRefusedAndNotLost) {
  RunningServer server;
  const std::string upgrade =
      "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Protocol: radiosity.v1\r\n\r\n";
  const std::string masked_text("\x81\x82\0\0\0\0{}", 8), close("\x88\x80\0\0\0\0", 6);
  for (const auto& early : {masked_text, close, masked_text.substr(0, 1), std::string(40'000, '\xff'), upgrade}) {
    RawHttp http(server.port());
    http.send(upgrade + early);
    const auto response = http.receive();
    EXPECT_EQ(response.status, 400);
    EXPECT_NE(response.body.find("badInput"), std::string::npos) << response.body;
    EXPECT_TRUE(http.closed(Seconds(10)));
  }
  RawHttp http(server.port());
  http.send(upgrade);
  EXPECT_EQ(http.receive(true).status, 101);
}

TEST(Framing, ABareLineFeedIsSeenWhereverItIs) {
  EXPECT_FALSE(net::hasBareLineFeed(""));
  EXPECT_FALSE(net::hasBareLineFeed("0\r\nX: 1\r\n\r"));
  EXPECT_TRUE(net::hasBareLineFeed("\n"));
  EXPECT_TRUE(net::hasBareLineFeed("4\n"));
  EXPECT_TRUE(net::hasBareLineFeed("0\r\nX: 1\n"));
}

// ---- request targets ----

TEST(Target, InAbsoluteFormIsServedByItsOwnHost) {
  RunningServer server;
  const auto statusOf = [&](const std::string& target, const std::string& host) {
    RawHttp http(server.port());
    http.send("GET " + target + " HTTP/1.1\r\nHost: " + host + "\r\n\r\n");
    return http.receive().status;
  };
  EXPECT_EQ(statusOf("http://localhost:8765/healthz", "localhost"), 200);
  EXPECT_EQ(statusOf("HTTPS://127.0.0.1/snapshot.png?width=0", "localhost"), 400);
  EXPECT_EQ(statusOf("http://localhost", "localhost"), 200) << "the viewer";
  EXPECT_EQ(statusOf("http://localhost?x=1", "localhost"), 200);
  EXPECT_EQ(statusOf("http://localhost/healthz", "rebound.example"), 200) << "Host does not count";
  EXPECT_EQ(statusOf("http://rebound.example/healthz", "localhost"), 403);
  EXPECT_EQ(statusOf("http://rebound.example@localhost/healthz", "localhost"), 400);
  for (const auto* bad :
       {"http:///healthz", "http://:80/healthz", "ftp://localhost/healthz", "localhost:80", "*", "healthz"})
    EXPECT_EQ(statusOf(bad, "localhost"), 400) << bad;
}

TEST(Target, InAsteriskFormAsksForTheWholeServer) {
  RunningServer server;
  for (const auto* target : {"*", "http://localhost"}) {
    const auto got = request(server.port(), "OPTIONS", target);
    EXPECT_EQ(got.status, 204) << target;
    EXPECT_EQ(got.header("Allow"), "GET, HEAD, PUT, OPTIONS") << target;
  }
  EXPECT_EQ(request(server.port(), "OPTIONS", "http://localhost/").header("Allow"), "GET, HEAD, OPTIONS");
}

TEST(Target, ANulIsRefusedWhereverItStands) {
  for (const auto* target : {"/lightmaps/0.exr%00", "/scene?name=a%00b", "/%00"})
    EXPECT_FALSE(net::parseTarget("GET", target)) << target;
  EXPECT_FALSE(net::parseTarget("GET", std::string_view("/a\0b", 4)));
}

}  // namespace
}  // namespace radiosity::testing
