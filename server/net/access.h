// Who may talk to the server: bearer token, Origin and Host. Pure functions; any thread.
#pragma once

#include <string_view>

#include "common/result.h"
#include "server/net/server_options.h"

namespace radiosity::net {

/// Time does not depend on where the two differ.
[[nodiscard]] bool sameSecret(std::string_view given, std::string_view expected);

/// `authorization`: the header's value. True where no token is needed.
[[nodiscard]] bool hasToken(std::string_view authorization, const ServerOptions& options);

/// A browser says which page is asking; other programs send no Origin and are let in. Allowed: the host that was asked
/// itself, and --allow-origin.
[[nodiscard]] bool originAllowed(std::string_view origin, std::string_view host, const ServerOptions& options);
[[nodiscard]] bool originListed(std::string_view origin, const ServerOptions& options);

/// Guards an open loopback server against DNS rebinding (a page whose own name was made to point at 127.0.0.1):
/// without a token, only IP addresses, "localhost" and the hosts of --allow-origin are served.
[[nodiscard]] bool hostAllowed(std::string_view host, const ServerOptions& options);

/// kBadUsage: no IP address, or one reachable from outside without token or --insecure; an --allow-origin that is none.
[[nodiscard]] Result<void> checkExposure(const ServerOptions& options);

}  // namespace radiosity::net
