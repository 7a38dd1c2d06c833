// One viewer: frames in to Calls, two lanes out. Control messages go first and in order; tiles fill the rest, as far as
// the client's credit reaches. One write at a time, each with a deadline. Owns itself; runs on its own strand.
#pragma once

#include <memory>

#include "server/net/http_session.h"
#include "server/net/hub.h"

namespace radiosity::net {

/// `upgrade` asks for subprotocol radiosity.v1 and passed the Origin check. `authenticated`: it brought the token.
void serveWebSocket(Stream stream, Upgrade upgrade, std::shared_ptr<Hub> hub, ConnectionSlot slot, bool authenticated);

}  // namespace radiosity::net
