#include "client/lib/server_url.h"

#include <gtest/gtest.h>

namespace radiosity::client {
namespace {

TEST(ServerUrl, acceptsWhatPeopleType) {
  struct Case {
    const char* text;
    const char* host;
    int port;
    const char* prefix;
  };
  for (const Case& c :
       {Case{"127.0.0.1:8765", "127.0.0.1", 8765, ""}, Case{"localhost", "localhost", 8765, ""},
        Case{"http://rack.example:9000", "rack.example", 9000, ""},
        Case{"http://rack.example/", "rack.example", 80, ""}, Case{"ws://127.0.0.1:8765/ws", "127.0.0.1", 8765, ""},
        Case{"HTTP://h:1/gi/", "h", 1, "/gi"}, Case{"ws://h:1/gi/ws", "h", 1, "/gi"},
        Case{"[::1]:65535", "::1", 65535, ""}, Case{"http://[fe80::1]", "fe80::1", 80, ""}}) {
    const auto url = parseServerUrl(c.text);
    ASSERT_TRUE(url) << c.text << ": " << url.error().text();
    EXPECT_EQ(url->host, c.host) << c.text;
    EXPECT_EQ(url->port, c.port) << c.text;
    EXPECT_EQ(url->prefix, c.prefix) << c.text;
  }
}

TEST(ServerUrl, refusesWithTheReason) {
  struct Case {
    const char* text;
    const char* reason;
  };
  for (const Case& c :
       {Case{"", "empty"}, Case{":80", "host is missing"}, Case{"http://", "host is missing"},
        Case{"h:0", "1 to 65535"}, Case{"h:65536", "1 to 65535"}, Case{"h:", "1 to 65535"}, Case{"h:8x", "1 to 65535"},
        Case{"h:-1", "1 to 65535"}, Case{"::1", "brackets"}, Case{"[::1", "missing"}, Case{"[::1]x", "unexpected"},
        Case{"ftp://h", "unknown scheme"}, Case{"me:pw@h:1", "user name"}, Case{"h:1/?a=b", "query"},
        Case{"h 1", "blank"}, Case{"h\r\nX: y", "blank"}}) {
    const auto url = parseServerUrl(c.text);
    ASSERT_FALSE(url) << c.text;
    EXPECT_EQ(url.error().code, ErrorCode::kBadUsage) << c.text;
    EXPECT_NE(url.error().text().find(c.reason), std::string::npos) << c.text << " -> " << url.error().text();
  }
}

TEST(ServerUrl, knowsTlsByTheScheme) {
  struct Case {
    const char* text;
    bool tls;
    const char* written;
  };
  for (const Case& c : {Case{"https://h", true, "https://h:443"}, Case{"WSS://h:8765/ws", true, "https://h:8765"},
                        Case{"http://h", false, "http://h:80"}, Case{"h", false, "http://h:8765"}}) {
    const auto url = parseServerUrl(c.text);
    ASSERT_TRUE(url) << c.text << ": " << url.error().text();
    EXPECT_EQ(url->tls, c.tls) << c.text;
    EXPECT_EQ(url->text(), c.written) << c.text;
  }
}

TEST(ServerUrl, writesIpv6InBrackets) {
  const auto url = parseServerUrl("[::1]:80");
  ASSERT_TRUE(url);
  EXPECT_EQ(url->authority(), "[::1]:80");
  EXPECT_EQ(url->text(), "http://[::1]:80");
}

TEST(PercentEncode, keepsOnlyUnreservedCharacters) {
  EXPECT_EQ(percentEncode("Camera-1.a_b~"), "Camera-1.a_b~");
  EXPECT_EQ(percentEncode("my cam&x=1/#\xC3\xA9"), "my%20cam%26x%3D1%2F%23%C3%A9");
}

}  // namespace
}  // namespace radiosity::client
