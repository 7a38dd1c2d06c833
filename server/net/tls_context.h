// Certificate and key of --tls-cert and --tls-key as OpenSSL takes them. Immutable once made; any thread.
#pragma once

#include <boost/asio/ssl/context.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>

#include "common/result.h"

namespace radiosity::net {

struct TlsContext {
  boost::asio::ssl::context context{boost::asio::ssl::context::tls_server};  ///< TLS 1.2 and 1.3
  std::int64_t expires_at_s = 0;  ///< of the certificate, since 1970-01-01 UTC
};

/// `certificate`: PEM, the server's own first, then those between it and the authority. `key`: PEM, not encrypted.
/// kBadUsage names the file and what is wrong: unreadable, not PEM, an encrypted key, one that belongs to another
/// certificate. A certificate whose time is over is taken, with a warning in the log.
[[nodiscard]] Result<std::shared_ptr<TlsContext>> loadTls(const std::filesystem::path& certificate,
                                                          const std::filesystem::path& key);

}  // namespace radiosity::net
