#include "server/net/access.h"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <string>

#include "server/net/http_message.h"

namespace radiosity::net {
namespace {

/// "https://host:port" -> "host:port".
std::string_view authorityOf(std::string_view origin) {
  const auto scheme = origin.find("://");
  return scheme == std::string_view::npos ? std::string_view() : origin.substr(scheme + 3);
}

/// As browsers send it: scheme and authority, no path; or "null", of pages from files. "*" is our own word for all.
bool isOrigin(std::string_view text) {
  const auto authority = authorityOf(text);
  return text == "*" || text == "null" || (!authority.empty() && authority.find_first_of("/?#@ ") == authority.npos);
}

/// "host:port" or "[::1]:port" -> host without brackets.
std::string_view nameOf(std::string_view authority) {
  if (authority.starts_with('[')) return authority.substr(1, authority.find(']') - 1);
  return authority.substr(0, authority.find(':'));
}

}  // namespace

bool sameSecret(std::string_view given, std::string_view expected) {
  // The length may be learned, the content not.
  volatile unsigned char difference = given.size() == expected.size() ? 0 : 1;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const auto g = given.empty() ? '\0' : given[i % given.size()];
    difference = static_cast<unsigned char>(difference | (g ^ expected[i]));
  }
  return difference == 0;
}

bool hasToken(std::string_view authorization, const ServerOptions& options) {
  if (options.token.empty()) return true;
  constexpr std::string_view kScheme = "Bearer ";
  if (authorization.size() < kScheme.size() || !sameIgnoringCase(authorization.substr(0, kScheme.size()), kScheme))
    return false;
  return sameSecret(authorization.substr(kScheme.size()), options.token);
}

bool originListed(std::string_view origin, const ServerOptions& options) {
  return std::any_of(options.allow_origins.begin(), options.allow_origins.end(),
                     [&](const std::string& allowed) { return allowed == "*" || sameIgnoringCase(origin, allowed); });
}

bool originAllowed(std::string_view origin, std::string_view host, const ServerOptions& options) {
  if (origin.empty()) return true;
  const auto authority = authorityOf(origin);
  return (!authority.empty() && sameIgnoringCase(authority, host)) || originListed(origin, options);
}

bool hostAllowed(std::string_view host, const ServerOptions& options) {
  if (!options.token.empty() || options.insecure || host.empty()) return true;
  const auto name = nameOf(host);
  if (sameIgnoringCase(name, "localhost") || name.ends_with(".localhost")) return true;
  boost::system::error_code not_an_address;
  boost::asio::ip::make_address(std::string(name), not_an_address);
  if (!not_an_address) return true;
  return std::any_of(options.allow_origins.begin(), options.allow_origins.end(), [&](const std::string& allowed) {
    return allowed == "*" || sameIgnoringCase(nameOf(authorityOf(allowed)), name);
  });
}

Result<void> checkExposure(const ServerOptions& options) {
  boost::system::error_code error;
  const auto address = boost::asio::ip::make_address(options.address, error);
  if (error)
    return fail(ErrorCode::kBadUsage, "not an IP address; use for example 127.0.0.1:8765 or [::]:8765",
                "--listen " + options.address);
  for (const auto& allowed : options.allow_origins)
    if (!isOrigin(allowed))
      return fail(ErrorCode::kBadUsage, "not an origin, and would match none; write it as https://viewer.example.org",
                  "--allow-origin " + allowed);
  if (address.is_loopback() || !options.token.empty() || options.insecure) return {};
  return fail(ErrorCode::kBadUsage,
              "anyone who reaches this address could use the server; give --token-file FILE (and --tls-cert, "
              "--tls-key, or a TLS proxy in front), or --insecure if the network is trusted",
              "--listen " + options.address);
}

}  // namespace radiosity::net
