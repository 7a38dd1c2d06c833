// HTTP requests and responses as plain values, so that routes know no sockets.
#pragma once

#include <cstdint>
#include <map>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::net {

struct HttpRequest {
  std::string method;                        ///< "GET"; HEAD comes as GET
  std::string path;                          ///< "/scene.glb", percent-decoded; "*" with OPTIONS: the whole server
  std::string authority;                     ///< "host:port" of a target in absolute form, which goes before Host
  std::map<std::string, std::string> query;  ///< percent-decoded
  std::string content_type, name;            ///< name: header X-Name, or ?name=
  std::string client;                        ///< who: header X-Client, or ?client=, or else User-Agent
  std::string accept_encoding, if_none_match;
  Bytes body;
  std::string body_sha256;    ///< of one that is named by it (PUT /uploads): taken while it came
  std::uint64_t session = 0;  ///< of the connection, as Hub::nextSession()
  std::stop_token gone = {};  ///< stopped when the client no longer waits for the answer
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string text;  ///< the body, unless `bytes` is set
  SharedBytes bytes;
  std::vector<std::pair<std::string, std::string>> headers;
};

/// Of names and tokens, which are ASCII.
[[nodiscard]] bool sameIgnoringCase(std::string_view a, std::string_view b);
/// A header's value, or an element of its list, without the blanks around it.
[[nodiscard]] std::string_view trimmed(std::string_view text);

/// Authority, path and query of a request target in origin, absolute or asterisk form (RFC 9112, section 3.2);
/// kBadInput for another form, a bad escape, a NUL or too many members.
[[nodiscard]] Result<HttpRequest> parseTarget(std::string_view method, std::string_view target);

/// {"error": {"code", "message", "where"}} with the status that suits the code.
[[nodiscard]] HttpResponse errorResponse(const Error& error);
[[nodiscard]] HttpResponse errorResponse(int status, std::string_view code, std::string_view message);

}  // namespace radiosity::net
