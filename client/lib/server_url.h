// Where a server is. Accepts what people type: "127.0.0.1:8765", "http://host:port", "wss://host:port/ws". Plain
// values.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/result.h"

namespace radiosity::client {

struct ServerUrl {
  std::string host;           ///< name or address; IPv6 without its brackets
  std::uint16_t port = 8765;  ///< without a scheme 8765; with http:// 80, with https:// 443, as everywhere
  bool tls = false;           ///< https:// or wss://
  std::string prefix;         ///< path before the service's own paths, for a reverse proxy: "" or "/gi"

  /// "host:port" as in a Host header; IPv6 in brackets.
  [[nodiscard]] std::string authority() const;
  /// "http://host:port/gi"
  [[nodiscard]] std::string text() const { return (tls ? "https://" : "http://") + authority() + prefix; }
  /// Target of a request line: prefix + path.
  [[nodiscard]] std::string target(std::string_view path) const { return prefix + std::string(path); }
};

/// Errors (kBadUsage) say what part is wrong.
[[nodiscard]] Result<ServerUrl> parseServerUrl(std::string_view text);

/// Percent-encodes everything but unreserved characters (RFC 3986, 2.3), for a query value.
[[nodiscard]] std::string percentEncode(std::string_view text);

}  // namespace radiosity::client
