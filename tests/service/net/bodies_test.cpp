// Bodies over real sockets: what they hold of the server's memory, and for how long.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <string>
#include <thread>

#include "common/sha256.h"
#include "server/net/pace.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

TEST(Pace, WhatMovesEarnsTimeButNoMoreThanTheSlack) {
  using std::chrono::seconds;
  net::Pace pace(1000);
  const net::Pace::Clock::time_point start;
  pace.start(seconds(30), start);
  EXPECT_EQ(pace.moved(0, start), seconds(30));
  EXPECT_EQ(pace.moved(5000, start), seconds(30));
  EXPECT_EQ(pace.moved(1, start + seconds(29)), seconds(1) + milliseconds(1));
  EXPECT_EQ(pace.moved(10'000, start + seconds(30)), seconds(10) + milliseconds(1));
  EXPECT_EQ(pace.moved(1'000'000, start + seconds(31)), seconds(30));
  EXPECT_EQ(pace.moved(0, start + seconds(100)), seconds(0));
}

TEST(Bodies, AnUploadIsNamedByAllOfItsBytesHoweverTheyCome) {
  RunningServer server;
  std::string body;
  for (int i = 0; i < 200'000; ++i) body += static_cast<char>(i % 1009 * (i % 1009) % 251);
  const auto expected = "/uploads/" + sha256Hex(body);
  EXPECT_EQ(request(server.port(), "PUT", "/uploads", {}, body).header("Location"), expected);
  RawHttp chunked(server.port());
  chunked.send("PUT /uploads HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
  for (std::size_t at = 0; at < body.size(); at += 0x4e20) chunked.send("4e20\r\n" + body.substr(at, 0x4e20) + "\r\n");
  chunked.send("0\r\n\r\n");
  EXPECT_EQ(chunked.receive().header("Location"), expected);
  chunked.send("PUT /uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n");
  EXPECT_EQ(chunked.receive().header("Location"), "/uploads/" + sha256Hex(std::string_view()));
}

TEST(Bodies, ABodyThatDripsInIsCutOffAndItsRoomGivenBack) {
  net::ServerOptions options;
  options.idle_timeout = milliseconds(1000);
  options.max_upload_bytes = 1000;
  RunningServer server(options);
  const std::string header = "PUT /uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\n";
  std::array<RawHttp, 2> drips{RawHttp(server.port()), RawHttp(server.port())};
  for (auto& drip : drips) drip.send(header + std::string(900, 'x'));
  const auto held = [&] { return request(server.port(), "GET", "/metrics").body; };
  for (int i = 0; i < 1000 && held().find("radiosityd_uploads_held_bytes 1800\n") == std::string::npos; ++i) {
  }
  EXPECT_EQ(request(server.port(), "PUT", "/uploads", {}, std::string(300, 'x')).status, 503);
  const auto start = std::chrono::steady_clock::now();
  bool ended = false;
  while (!ended && std::chrono::steady_clock::now() - start < std::chrono::seconds(9)) {  // before 100 bytes have come
    for (auto& drip : drips) drip.send("x");
    ended = drips[0].closed(Seconds(0.1)) && drips[1].closed(Seconds(0.1));
  }
  EXPECT_TRUE(ended);
  EXPECT_EQ(request(server.port(), "PUT", "/uploads", {}, std::string(300, 'x')).status, 201);
}

TEST(Bodies, ABodyThatComesAtALowRateComesAllTheSame) {
  net::ServerOptions options;
  options.idle_timeout = milliseconds(2000);
  RunningServer server(options);
  RawHttp http(server.port());
  constexpr int kParts = 60;
  const std::string part(std::size_t{40'000}, 'x');
  http.send("PUT /uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + std::to_string(kParts * part.size()) +
            "\r\n\r\n");
  for (int i = 0; i < kParts; ++i) {  // 3 s in all, which the time for pauses alone would not cover
    std::this_thread::sleep_for(milliseconds(50));
    http.send(part);
  }
  EXPECT_EQ(http.receive().status, 201);
}

/// Asks for /scene.glb and takes nothing of it, until the server holds so much.
void leaveWaiting(RawHttp& http, std::uint16_t port, std::size_t held) {
  http.send("GET /scene.glb HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const auto wanted = fmt::format("radiosityd_downloads_held_bytes {}\n", held);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::string metrics;
  do {
    metrics = request(port, "GET", "/metrics").body;
  } while (metrics.find(wanted) == std::string::npos && std::chrono::steady_clock::now() < end);
  EXPECT_THAT(metrics, HasSubstr(wanted));
}

TEST(Bodies, WhatWaitsToBeTakenHasItsRoom) {
  constexpr std::size_t kBytes = std::size_t{24} << 20;  // more than the system takes of it
  net::ServerOptions options;
  options.max_upload_bytes = kBytes;
  RunningServer server(options);
  const auto first = std::make_shared<const Bytes>(kBytes);
  server.engine.setGlb(first);
  {
    std::array<RawHttp, 4> waiting{RawHttp(server.port()), RawHttp(server.port()), RawHttp(server.port()),
                                   RawHttp(server.port())};
    leaveWaiting(waiting[0], server.port(), kBytes);
    leaveWaiting(waiting[1], server.port(), kBytes);  // the same: it is in memory once
    server.engine.setGlb(std::make_shared<const Bytes>(kBytes));
    leaveWaiting(waiting[2], server.port(), 2 * kBytes);
    server.engine.setGlb(std::make_shared<const Bytes>(kBytes));
    waiting[3].send("GET /scene.glb HTTP/1.1\r\nHost: localhost\r\n\r\n");
    const auto refused = waiting[3].receive();
    EXPECT_EQ(refused.status, 503);
    EXPECT_FALSE(refused.header("Retry-After").empty());
    server.engine.setGlb(first);
    leaveWaiting(waiting[3], server.port(), 2 * kBytes);
    EXPECT_EQ(request(server.port(), "GET", "/healthz").status, 200);
    EXPECT_EQ(request(server.port(), "HEAD", "/scene.glb").status, 200);
  }
  RawHttp after(server.port());
  leaveWaiting(after, server.port(), kBytes);
  EXPECT_EQ(after.receive().body.size(), kBytes);
}

TEST(Bodies, AResponseThatDripsOutIsCutOff) {
  constexpr std::size_t kBytes = std::size_t{24} << 20;
  net::ServerOptions options;
  options.idle_timeout = milliseconds(1000);
  options.least_bytes_per_second = std::size_t{1} << 30;
  RunningServer server(options);
  server.engine.setGlb(std::make_shared<const Bytes>(kBytes));
  RawHttp http(server.port());
  leaveWaiting(http, server.port(), kBytes);
  std::size_t taken = 0;
  while (const auto some = http.readSome(Seconds(3))) {
    taken += some;
    std::this_thread::sleep_for(milliseconds(20));  // 3 MiB/s at most
  }
  EXPECT_LT(taken, kBytes);
}

}  // namespace
}  // namespace radiosity::testing
