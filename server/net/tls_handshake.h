// From a TCP connection to a TLS one: the time between accept and the first byte of HTTP. A peer that speaks plain HTTP
// is told so. Owns itself; runs on the connection's strand.
#pragma once

#include <memory>

#include "server/net/http_session.h"
#include "server/net/tls_context.h"

namespace radiosity::net {

/// Serves HTTP once the handshake is done; cuts the connection where it is not within options.handshake_timeout, and at
/// once where kMaxTlsHandshakes are under way.
void serveTls(TcpStream stream, std::shared_ptr<TlsContext> tls, std::shared_ptr<Hub> hub, ConnectionSlot slot);

}  // namespace radiosity::net
