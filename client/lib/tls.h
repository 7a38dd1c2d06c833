// Whom a TLS connection trusts. Plain values, and one function private to client/lib.
#pragma once

#include <chrono>
#include <string>

#include "client/lib/server_url.h"
#include "common/result.h"

namespace radiosity::client {

struct TlsTrust {
  std::string ca_file = {};  ///< PEM; empty: the authorities that this machine trusts
  /// Whether the certificate must be genuine and made out to the host's name or address. Without, anyone between here
  /// and the server can read and change everything, the token too.
  bool verify = true;
};

namespace detail {

class Pump;
class Stream;

/// Connects, and where the URL says https:// or wss:// makes the TLS handshake (1.2 or newer). Errors say what to
/// check: nobody listens, plain HTTP there, a certificate that is not trusted or is another host's; kBadUsage for a
/// `ca_file` that cannot be read.
[[nodiscard]] Result<void> openStream(Pump& pump, Stream& stream, const ServerUrl& url, const TlsTrust& trust,
                                      std::chrono::steady_clock::duration timeout);

}  // namespace detail
}  // namespace radiosity::client
