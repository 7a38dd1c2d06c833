// Bodies over real sockets.
#include <gtest/gtest.h>

#include <string>

#include "common/sha256.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

TEST(Bodies, AnUploadIsNamedByAllOfItsBytesHoweverTheyCome) {
  RunningServer server;
  std::string body;
  for (int i = 0; i < 200'000; ++i) body += static_cast<char>(i * i % 251);
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

}  // namespace
}  // namespace radiosity::testing
