// Where a request ends, as RFC 9112 has it: whoever disagrees about that with a proxy in front takes a part of one
// request for another. Pure functions; any thread.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "server/net/http_message.h"

namespace radiosity::net {

/// What the header says of the body's length.
struct FramingFields {
  unsigned version = 11;  ///< 10: HTTP/1.0
  bool has_content_length = false;
  std::vector<std::string_view> transfer_encodings;  ///< values of all Transfer-Encoding lines, in order
  bool read_as_chunked = true;                       ///< by the parser, with which this must agree
};

/// The refusal of a request whose end is not known for certain, after which the connection must be closed: 501 for a
/// transfer coding other than chunked, 400 for chunked that is not the last or comes twice, that has parameters, beside
/// Content-Length or in HTTP/1.0 (sections 6.1, 6.3 and 7.1). Nothing: no Transfer-Encoding, or just `chunked`.
[[nodiscard]] std::optional<HttpResponse> framingFault(const FramingFields& fields);

/// A line of a chunked body that ends without a carriage return, which a parser would wait for.
[[nodiscard]] bool hasBareLineFeed(std::string_view bytes);

}  // namespace radiosity::net
