// What a peer writes at the front of a connection, as far as this program reads it by itself: request targets, what
// says where a body ends, and the same bytes as a line of the log.
#include <algorithm>
#include <string_view>

#include "common/printable.h"
#include "server/net/http_framing.h"
#include "server/net/http_message.h"
#include "tests/fuzz/target.h"

namespace radiosity::fuzz {

std::vector<Seed> seeds() {
  return {seedOf("GET /snapshot.png?camera=my%20desk&width=320 HTTP/1.1\nTransfer-Encoding: chunked"),
          seedOf("OPTIONS * HTTP/1.1\nTransfer-Encoding: gzip, chunked\nTransfer-Encoding: chunked"),
          seedOf("GET http://localhost:8765/scene.glb?layout=1 HTTP/1.0\nTransfer-Encoding: chunked, identity"),
          seedOf("PUT https://[::1]?name=%c3%a9 HTTP/1.1\nContent-Length: 4\nTransfer-Encoding: chunked;q=1"),
          seedOf("HEAD /lightmaps/0.exr HTTP/1.1\nTransfer-Encoding: \xc2\x9b\xff")};
}

namespace {

std::string_view takeUntil(std::string_view& rest, char end) {
  const auto part = rest.substr(0, rest.find(end));
  rest.remove_prefix(std::min(part.size() + 1, rest.size()));
  return part;
}

void checkTarget(std::string_view method, std::string_view target) {
  const auto request = net::parseTarget(method, target);
  if (!request) return;
  const bool whole_server = request->path == "*" && method == "OPTIONS";
  require(whole_server || request->path.starts_with('/'), "a path begins at the root");
  require(request->authority.find_first_of("@/?#") == std::string::npos, "an authority is a host and a port");
}

void checkFraming(const net::FramingFields& fields) {
  const auto fault = net::framingFault(fields);
  if (fault) return require(fault->status == 400 || fault->status == 501, "a fault is the peer's");
  std::string all;
  for (const auto line : fields.transfer_encodings) all += line;
  for (auto& c : all) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  std::erase_if(all, [](char c) { return c == ' ' || c == '\t' || c == ','; });
  require(fields.transfer_encodings.empty() || all == "chunked", "no other coding is understood");
  require(fields.transfer_encodings.empty() || !fields.has_content_length, "there is one length");
}

void checkPrintable(std::string_view bytes) {
  const auto line = printable(bytes);
  require(printable(line) == line, "what is printable stays as it is");
  for (std::string_view rest = line; !rest.empty(); rest.remove_prefix(characterLength(rest)))
    require(characterLength(rest) > 0, "a line is UTF-8");
  require(std::none_of(line.begin(), line.end(), [](char c) { return c == '\n' || c == '\r' || c == '\x1b'; }),
          "a line is one line");
}

}  // namespace
}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  fuzz::checkPrintable(rest);
  auto first = fuzz::takeUntil(rest, '\n');
  const auto method = fuzz::takeUntil(first, ' ');
  fuzz::checkTarget(method, fuzz::takeUntil(first, ' '));
  net::FramingFields fields{first == "HTTP/1.0" ? 10U : 11U, false, {}, true};
  while (!rest.empty()) {
    auto line = fuzz::takeUntil(rest, '\n');
    const auto name = fuzz::takeUntil(line, ':');
    if (name == "Transfer-Encoding") fields.transfer_encodings.push_back(line);
    fields.has_content_length = fields.has_content_length || name == "Content-Length";
  }
  fuzz::checkFraming(fields);
  return 0;
}
