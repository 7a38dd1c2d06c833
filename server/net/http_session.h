// One connection speaking HTTP/1.1: limits and timeouts, then the routes; hands over to a WebSocketSession on an
// upgrade. Owns itself (shared_ptr in its handlers); runs on its own strand.
#pragma once

#include <memory>

#include "server/net/hub.h"
#include "server/net/stream.h"

namespace radiosity::net {

/// Counts as an open connection while it lives.
using ConnectionSlot = std::shared_ptr<void>;

/// Starts serving; the session also registers itself with the hub for the shutdown.
void serveHttp(Stream stream, std::shared_ptr<Hub> hub, ConnectionSlot slot);

}  // namespace radiosity::net
