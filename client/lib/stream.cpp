#include "client/lib/stream.h"

#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <boost/asio/ip/address.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket/ssl.hpp>

namespace radiosity::client::detail {

namespace asio = boost::asio;
namespace beast = boost::beast;

struct Stream::Tls {
  Tls(Tcp& tcp, asio::ssl::context& context) : stream(tcp, context) {}
  beast::ssl_stream<Tcp&> stream;
};

Stream::Stream(asio::io_context& context) : tcp_(context) {}
Stream::~Stream() = default;

void* Stream::nativeTls() const { return tls_ ? tls_->stream.native_handle() : nullptr; }

void Stream::secure(asio::ssl::context& context, const std::string& host, bool verify, Handler handler) {
  tls_ = std::make_unique<Tls>(tcp_, context);
  auto& tls = tls_->stream;
  auto* native = tls.native_handle();
  Error not_an_address;
  asio::ip::make_address(host, not_an_address);
  // An address has no place in Server Name Indication (RFC 6066, section 3).
  if (not_an_address) SSL_set_tlsext_host_name(native, host.c_str());
  tls.set_verify_mode(verify ? asio::ssl::verify_peer : asio::ssl::verify_none);
  if (not_an_address) {
    SSL_set_hostflags(native, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    SSL_set1_host(native, host.c_str());
  } else {
    X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(native), host.c_str());
  }
  tls.async_handshake(asio::ssl::stream_base::client,
                      [handler = std::move(handler)](Error error) { handler(error, 0); });
}

void Stream::readSome(const Few<asio::mutable_buffer>& buffers, Handler handler) {
  if (tls_) return tls_->stream.async_read_some(buffers, std::move(handler));
  tcp_.async_read_some(buffers, std::move(handler));
}

void Stream::writeSome(const Few<asio::const_buffer>& buffers, Handler handler) {
  if (tls_) return tls_->stream.async_write_some(buffers, std::move(handler));
  tcp_.async_write_some(buffers, std::move(handler));
}

void Stream::tearDown(beast::role_type role, Handler handler) {
  using beast::websocket::async_teardown;
  const auto done = [handler = std::move(handler)](Error error) { handler(error, 0); };
  if (tls_) return async_teardown(role, tls_->stream, done);
  async_teardown(role, tcp_, done);
}

}  // namespace radiosity::client::detail
