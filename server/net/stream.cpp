#include "server/net/stream.h"

#include <boost/asio/post.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <boost/beast/websocket/ssl.hpp>

namespace radiosity::net {

/// Of Beast rather than Asio, since it joins small buffers to one record.
struct Stream::Tls {
  Tls(TcpStream& tcp, asio::ssl::context& context) : stream(tcp, context) {}
  beast::ssl_stream<TcpStream&> stream;
};

Stream::Stream(TcpStream stream) : tcp_(std::make_unique<TcpStream>(std::move(stream))) {}
Stream::Stream(Stream&&) noexcept = default;
Stream& Stream::operator=(Stream&&) noexcept = default;
Stream::~Stream() = default;

void Stream::secure(asio::ssl::context& context, asio::const_buffer read, AnyHandler handler) {
  tls_ = std::make_unique<Tls>(*tcp_, context);
  tls_->stream.async_handshake(asio::ssl::stream_base::server, read, std::move(handler));
}

void Stream::readSome(const Few<asio::mutable_buffer>& buffers, AnyHandler handler) {
  if (tls_) return tls_->stream.async_read_some(buffers, std::move(handler));
  tcp_->async_read_some(buffers, std::move(handler));
}

void Stream::writeSome(const Few<asio::const_buffer>& buffers, AnyHandler handler) {
  if (tls_) return tls_->stream.async_write_some(buffers, std::move(handler));
  tcp_->async_write_some(buffers, std::move(handler));
}

void Stream::endSending(AnyHandler handler) {
  if (tls_) return tls_->stream.async_shutdown(std::move(handler));
  BoostError error;
  socket().shutdown(tcp::socket::shutdown_send, error);
  asio::post(get_executor(), [handler = std::move(handler), error]() mutable { handler(error); });
}

void Stream::tearDown(beast::role_type role, AnyHandler handler) {
  using beast::websocket::async_teardown;
  if (tls_) return async_teardown(role, tls_->stream, std::move(handler));
  async_teardown(role, *tcp_, std::move(handler));
}

}  // namespace radiosity::net
