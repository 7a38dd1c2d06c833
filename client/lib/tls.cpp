#include "client/lib/tls.h"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509_vfy.h>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/error.hpp>

#include "client/lib/pump.h"
#include "client/lib/stream.h"

namespace radiosity::client::detail {
namespace {

namespace asio = boost::asio;
namespace ssl = boost::asio::ssl;
using BoostError = boost::system::error_code;

Result<void> trustAuthorities(ssl::context& context, const TlsTrust& trust) {
  BoostError error;
  if (trust.ca_file.empty()) {
    context.set_default_verify_paths(error);
  } else {
    context.load_verify_file(trust.ca_file, error);
  }
  ERR_clear_error();
  if (!error) return {};
  return fail(ErrorCode::kBadUsage, "cannot be read as PEM certificates (" + error.message() + ")",
              trust.ca_file.empty() ? "the system's certificates" : "--ca " + trust.ca_file);
}

Error handshakeError(const BoostError& error, SSL* native, const ServerUrl& url) {
  if (error == ssl::error::stream_truncated) return transferError(asio::error::eof, url, "TLS handshake");
  if (error.category() != asio::error::get_ssl_category()) return transferError(error, url, "TLS handshake");
  const auto verdict = SSL_get_verify_result(native);
  if (verdict == X509_V_ERR_HOSTNAME_MISMATCH || verdict == X509_V_ERR_IP_ADDRESS_MISMATCH)
    return {ErrorCode::kUnavailable,
            "the server's certificate is not made out to " + url.host + " (--insecure checks nothing)", url.text()};
  if (verdict != X509_V_OK)
    return {ErrorCode::kUnavailable,
            std::string("the server's certificate is not accepted: ") + X509_verify_cert_error_string(verdict) +
                " (--ca FILE names an authority to trust; --insecure checks nothing)",
            url.text()};
  if (ERR_GET_REASON(static_cast<unsigned long>(error.value())) == SSL_R_WRONG_VERSION_NUMBER)
    return {ErrorCode::kUnavailable, "the server does not speak TLS there: use http:// or ws://", url.text()};
  return {ErrorCode::kUnavailable, "TLS handshake: " + error.message(), url.text()};
}

}  // namespace

Result<void> openStream(Pump& pump, Stream& stream, const ServerUrl& url, const TlsTrust& trust,
                        Clock::duration timeout) {
  if (!url.tls) return connectTo(pump, stream.next_layer(), url, timeout);
  ssl::context context(ssl::context::tls_client);
  SSL_CTX_set_min_proto_version(context.native_handle(), TLS1_2_VERSION);
  if (auto trusted = trust.verify ? trustAuthorities(context, trust) : Result<void>(); !trusted) return trusted;
  if (auto connected = connectTo(pump, stream.next_layer(), url, timeout); !connected) return connected;
  const auto error = pump.await(stream, timeout, [&](auto handler) {
    stream.secure(context, url.host, trust.verify, [handler](const BoostError& e, std::size_t) mutable { handler(e); });
  });
  if (error) return tl::unexpected(handshakeError(error, static_cast<SSL*>(stream.nativeTls()), url));
  return {};
}

}  // namespace radiosity::client::detail
