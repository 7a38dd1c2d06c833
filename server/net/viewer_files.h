// The live viewer's files (client/web), which the build puts into the program. Constant; any thread.
#pragma once

#include <span>
#include <string_view>

#include "server/net/http_message.h"

namespace radiosity::net {

struct ViewerFile {
  std::string_view path;    ///< "/index.html", "/assets/index-1f2e3d.js"
  std::string_view type;    ///< Content-Type
  std::string_view bytes;   ///< lives as long as the program
  std::string_view packed;  ///< the same in gzip; empty: there is none
  std::string_view tag;     ///< ETag, with its quotes
};

/// All files, in order of their paths. Written by client/web/build_viewer.cmake; one page that says so where the viewer
/// was not built.
[[nodiscard]] std::span<const ViewerFile> viewerFiles();

/// The file at the request's path ("/" is the page itself), packed where the client takes gzip; 304 where it has it;
/// 404.
[[nodiscard]] HttpResponse viewerResponse(const HttpRequest& request);

}  // namespace radiosity::net
