#include "server/net/http_framing.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace radiosity::net {
namespace {

bool isChunked(std::string_view coding) {
  constexpr std::string_view kChunked = "chunked";
  return std::equal(coding.begin(), coding.end(), kChunked.begin(), kChunked.end(),
                    [](unsigned char a, unsigned char b) { return std::tolower(a) == b; });
}

/// Of all lines as one list; empty members of a list mean nothing (RFC 9110, section 5.6.1).
std::vector<std::string_view> codingsIn(const std::vector<std::string_view>& lines) {
  std::vector<std::string_view> codings;
  for (auto rest : lines) {
    while (!rest.empty()) {
      const auto member = rest.substr(0, rest.find(','));
      rest.remove_prefix(std::min(member.size() + 1, rest.size()));
      if (const auto coding = trimmed(member); !coding.empty()) codings.push_back(coding);
    }
  }
  return codings;
}

HttpResponse bad(std::string_view message) { return errorResponse(400, "badInput", message); }

}  // namespace

std::optional<HttpResponse> framingFault(const FramingFields& fields) {
  if (fields.transfer_encodings.empty()) return std::nullopt;
  if (fields.version < 11) return bad("HTTP/1.0 has no Transfer-Encoding");
  if (fields.has_content_length) return bad("a request has Content-Length or Transfer-Encoding, not both");
  const auto codings = codingsIn(fields.transfer_encodings);
  if (codings.empty()) return bad("Transfer-Encoding names no coding");
  const auto chunked = std::count_if(codings.begin(), codings.end(), isChunked);
  if (chunked > 1) return bad("Transfer-Encoding: chunked may be named once");
  if (chunked == 1 && !isChunked(codings.back())) return bad("Transfer-Encoding: chunked must be the last coding");
  for (const auto coding : codings) {
    if (isChunked(coding)) continue;
    if (isChunked(trimmed(coding.substr(0, coding.find(';'))))) return bad("chunked has no parameters");
    return errorResponse(501, "unsupported", "the only Transfer-Encoding that is understood is chunked");
  }
  if (!fields.read_as_chunked) return bad("Transfer-Encoding must be just chunked");
  return std::nullopt;
}

bool hasBareLineFeed(std::string_view bytes) {
  for (auto at = bytes.find('\n'); at != std::string_view::npos; at = bytes.find('\n', at + 1)) {
    if (at == 0 || bytes[at - 1] != '\r') return true;
  }
  return false;
}

}  // namespace radiosity::net
