// GET /status: what the server is doing, as a page that needs no script.
#pragma once

#include <string>
#include <string_view>

#include "server/engine/engine.h"

namespace radiosity::net {

[[nodiscard]] std::string statusPage(const engine::Status& status, std::size_t viewers, std::string_view version);

/// Text for HTML content and attributes.
[[nodiscard]] std::string htmlEscaped(std::string_view text);

}  // namespace radiosity::net
