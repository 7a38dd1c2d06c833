#include "server/net/http_message.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include "protocol/http_bodies.h"

namespace radiosity::net {
namespace {

constexpr std::size_t kMaxQueryMembers = 32;

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::optional<std::string> percentDecoded(std::string_view text, bool plus_is_space) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%') {
      const int high = i + 2 < text.size() ? hexDigit(text[i + 1]) : -1;
      const int low = i + 2 < text.size() ? hexDigit(text[i + 2]) : -1;
      if (high < 0 || low < 0 || high + low == 0) return std::nullopt;
      out += static_cast<char>(high * 16 + low);
      i += 2;
    } else if (text[i] == '\0') {
      return std::nullopt;
    } else {
      out += plus_is_space && text[i] == '+' ? ' ' : text[i];
    }
  }
  return out;
}

int statusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kBadUsage:
    case ErrorCode::kBadInput:
    case ErrorCode::kInvalidScene:
    case ErrorCode::kUnsupported:
      return 400;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kTooLarge:
      return 413;
    case ErrorCode::kStaleRevision:
    case ErrorCode::kTestFailed:
    case ErrorCode::kCancelled:
      return 409;
    case ErrorCode::kBusy:
    case ErrorCode::kUnavailable:
      return 503;
    case ErrorCode::kInternal:
      return 500;
  }
  return 500;
}

/// Takes "http://host:port" off the front of a target. False: it is no URI that a server is asked for.
bool takeAuthority(std::string_view& target, std::string& authority) {
  const auto colon = target.find("://");
  const auto scheme = target.substr(0, colon);
  if (!sameIgnoringCase(scheme, "http") && !sameIgnoringCase(scheme, "https")) return false;
  target.remove_prefix(colon + 3);
  authority = target.substr(0, target.find_first_of("/?#"));
  target.remove_prefix(authority.size());
  // A user before the host is how a link pretends to lead elsewhere (RFC 9110, section 4.2.4).
  return !authority.empty() && authority.front() != ':' && authority.find('@') == std::string::npos;
}

}  // namespace

bool sameIgnoringCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

Result<HttpRequest> parseTarget(std::string_view method, std::string_view target) {
  HttpRequest request;
  request.method = method == "HEAD" ? "GET" : method;
  const auto bad = [] { return fail(ErrorCode::kBadInput, "bad request target"); };
  if (!target.starts_with('/') && target.find("://") != std::string_view::npos) {
    if (!takeAuthority(target, request.authority)) return bad();
    // What a proxy makes of it that is asked for the server itself, and of a URI without a path.
    if (target.empty()) target = method == "OPTIONS" ? "*" : "/";
  }
  if (target == "*" && method == "OPTIONS") {
    request.path = target;
    return request;
  }
  const auto question = target.find('?');
  auto path = percentDecoded(target.substr(0, question), false);
  if (path && path->empty() && !request.authority.empty()) path = "/";
  if (!path || path->empty() || path->front() != '/') return bad();
  request.path = *path;
  auto rest = question == std::string_view::npos ? std::string_view() : target.substr(question + 1);
  while (!rest.empty()) {
    const auto part = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(part.size() + 1, rest.size()));
    const auto equals = std::min(part.find('='), part.size());
    const auto key = percentDecoded(part.substr(0, equals), true);
    const auto value = percentDecoded(part.substr(std::min(equals + 1, part.size())), true);
    if (!key || !value || request.query.size() == kMaxQueryMembers)
      return fail(ErrorCode::kBadInput, "bad query in the request target");
    request.query[*key] = *value;
  }
  return request;
}

HttpResponse errorResponse(int status, std::string_view code, std::string_view message) {
  HttpResponse response;
  response.status = status;
  response.content_type = "application/json";
  response.text = protocol::encodeHttpError({std::string(code), std::string(message), {}});
  return response;
}

HttpResponse errorResponse(const Error& error) {
  HttpResponse response;
  response.status = statusOf(error.code);
  response.content_type = "application/json";
  response.text = protocol::encodeHttpError({std::string(protocol::httpCode(error.code)), error.message, error.where});
  if (response.status == 503) response.headers.emplace_back("Retry-After", "1");
  return response;
}

}  // namespace radiosity::net
