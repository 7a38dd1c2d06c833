#include "client/lib/server_url.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

namespace radiosity::client {
namespace {

constexpr std::size_t kMaxUrlBytes = 2048;
constexpr std::uint16_t kHttpPort = 80;
constexpr std::uint16_t kHttpsPort = 443;

tl::unexpected<Error> bad(std::string_view url, const std::string& why) {
  return fail(ErrorCode::kBadUsage, why + "; expected HOST:PORT, http://HOST:PORT or https://HOST:PORT",
              "\"" + std::string(url) + "\"");
}

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return std::tolower(c); });
  return out;
}

std::optional<std::uint16_t> parsePort(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port == 0) return std::nullopt;
  return port;
}

bool isUnreserved(unsigned char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.' ||
         c == '_' || c == '~';
}

/// Path of a URL to the prefix before the service's own paths: "/" -> "", "/ws" -> "", "/gi/ws" -> "/gi".
std::string prefixOf(std::string_view path) {
  while (!path.empty() && path.back() == '/') path.remove_suffix(1);
  if (path.ends_with("/ws")) path.remove_suffix(3);
  return std::string(path);
}

}  // namespace

std::string ServerUrl::authority() const {
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

Result<ServerUrl> parseServerUrl(std::string_view text) {
  if (text.empty()) return bad(text, "the server's address is empty");
  if (text.size() > kMaxUrlBytes) return bad(text.substr(0, 40), "the server's address is too long");
  if (std::any_of(text.begin(), text.end(), [](unsigned char c) { return c <= ' ' || c == 0x7f; }))
    return bad(text, "the server's address contains a blank or a control character");

  ServerUrl url;
  std::string_view rest = text;
  if (const auto scheme_end = text.find("://"); scheme_end != std::string_view::npos) {
    const std::string scheme = lower(text.substr(0, scheme_end));
    url.tls = scheme == "https" || scheme == "wss";
    if (!url.tls && scheme != "http" && scheme != "ws") return bad(text, "unknown scheme \"" + scheme + "\"");
    rest.remove_prefix(scheme_end + 3);
    url.port = url.tls ? kHttpsPort : kHttpPort;
  }
  const auto authority_end = std::min(rest.find_first_of("/?#"), rest.size());
  std::string_view authority = rest.substr(0, authority_end);
  const std::string_view path = rest.substr(authority_end);
  if (path.find_first_of("?#") != std::string_view::npos) return bad(text, "a query or fragment has no place here");
  if (authority.find('@') != std::string_view::npos)
    return bad(text, "a user name has no place here (a token is given with --token-file)");
  url.prefix = prefixOf(path);

  std::string_view port_text;
  bool has_port = false;
  if (authority.starts_with('[')) {
    const auto bracket = authority.find(']');
    if (bracket == std::string_view::npos) return bad(text, "the \"]\" after the IPv6 address is missing");
    url.host = authority.substr(1, bracket - 1);
    authority.remove_prefix(bracket + 1);
    has_port = authority.starts_with(':');
    if (!authority.empty() && !has_port) return bad(text, "unexpected text after \"]\"");
    port_text = has_port ? authority.substr(1) : std::string_view();
  } else {
    const auto colon = authority.find(':');
    if (colon != authority.rfind(':')) return bad(text, "an IPv6 address needs brackets, as in [::1]:8765");
    has_port = colon != std::string_view::npos;
    url.host = authority.substr(0, colon);
    if (has_port) port_text = authority.substr(colon + 1);
  }
  if (url.host.empty()) return bad(text, "the host is missing");
  if (has_port) {
    const auto port = parsePort(port_text);
    if (!port) return bad(text, "the port must be a number from 1 to 65535");
    url.port = *port;
  }
  return url;
}

std::string percentEncode(std::string_view text) {
  static constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (isUnreserved(byte)) {
      out += c;
    } else {
      out += {'%', kDigits[byte >> 4U], kDigits[byte & 15U]};
    }
  }
  return out;
}

}  // namespace radiosity::client
