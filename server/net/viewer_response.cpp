#include <algorithm>
#include <string>

#include "server/net/viewer_files.h"

namespace radiosity::net {
namespace {

constexpr std::string_view kAssets = "/assets/";  ///< Vite puts a hash of the content into these names

/// Nothing from elsewhere, nothing inline. blob: and data: are how a GLB's own images reach the browser's decoder.
constexpr std::string_view kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; worker-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// The transcoder of KTX2 pictures makes its bindings from text, so that the worker that runs it, and nothing else,
/// may.
constexpr std::string_view kTranscoder = "/assets/transcode_worker";
constexpr std::string_view kTranscoderPolicy =
    "default-src 'none'; script-src 'self' 'unsafe-eval'; connect-src 'self'; base-uri 'none'";

/// Calls `visit` for each element of a comma-separated header until it returns true.
template <typename Visit>
bool anyElement(std::string_view list, const Visit& visit) {
  while (!list.empty()) {
    const auto element = list.substr(0, list.find(','));
    list.remove_prefix(std::min(element.size() + 1, list.size()));
    if (visit(trimmed(element))) return true;
  }
  return false;
}

/// RFC 9110 section 12.5.3, as far as gzip is concerned: "gzip;q=0" is a refusal.
bool takesGzip(std::string_view accept_encoding) {
  return anyElement(accept_encoding, [](std::string_view element) {
    const auto name = trimmed(element.substr(0, element.find(';')));
    if (name != "gzip" && name != "*") return false;
    const auto quality = element.find("q=");
    return quality == std::string_view::npos || element.find_first_of("123456789", quality) != std::string_view::npos;
  });
}

/// RFC 9110 section 13.1.2: weak comparison.
bool has(std::string_view if_none_match, std::string_view tag) {
  return anyElement(if_none_match, [&](std::string_view element) {
    if (element.starts_with("W/")) element.remove_prefix(2);
    return element == tag || element == "*";
  });
}

}  // namespace

HttpResponse viewerResponse(const HttpRequest& request) {
  const std::string_view path = request.path == "/" ? "/index.html" : std::string_view(request.path);
  const auto files = viewerFiles();
  const auto file = std::find_if(files.begin(), files.end(), [&](const ViewerFile& f) { return f.path == path; });
  if (file == files.end()) return errorResponse({ErrorCode::kNotFound, "there is nothing at this path", request.path});
  HttpResponse response;
  response.content_type = file->type;
  response.headers.emplace_back("ETag", file->tag);
  response.headers.emplace_back("Vary", "Accept-Encoding");
  const bool forever = path.starts_with(kAssets);
  response.headers.emplace_back("Cache-Control", forever ? "public, max-age=31536000, immutable" : "no-cache");
  response.headers.emplace_back("Content-Security-Policy", path.starts_with(kTranscoder) ? kTranscoderPolicy : kPolicy);
  response.headers.emplace_back("Referrer-Policy", "no-referrer");
  if (has(request.if_none_match, file->tag)) {
    response.status = 304;
    return response;
  }
  const bool packed = !file->packed.empty() && takesGzip(request.accept_encoding);
  if (packed) response.headers.emplace_back("Content-Encoding", "gzip");
  response.text = packed ? file->packed : file->bytes;
  return response;
}

}  // namespace radiosity::net
