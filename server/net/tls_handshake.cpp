#include "server/net/tls_handshake.h"

#include <fmt/format.h>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/detect_ssl.hpp>
#include <string>
#include <utility>

#include "protocol/http_bodies.h"

namespace radiosity::net {
namespace {

constexpr std::size_t kMostRead = std::size_t{64} * 1024;

/// In the clear: all that such a client can read.
const std::string& plainRefusal() {
  static const auto body = protocol::encodeHttpError({"badInput", "this port speaks TLS: use https:// or wss://", {}});
  static const auto text = fmt::format(
      "HTTP/1.1 400 Bad Request\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{}",
      body.size(), body);
  return text;
}

class TlsHandshake : public Connection, public std::enable_shared_from_this<TlsHandshake> {
 public:
  TlsHandshake(TcpStream stream, std::shared_ptr<TlsContext> tls, std::shared_ptr<Hub> hub, ConnectionSlot slot)
      : stream_(std::move(stream)),
        executor_(stream_.get_executor()),
        tls_(std::move(tls)),
        hub_(std::move(hub)),
        slot_(std::move(slot)) {
    ++hub_->counters().tls_handshakes;
  }
  ~TlsHandshake() override { leaveCount(); }
  TlsHandshake(const TlsHandshake&) = delete;
  TlsHandshake& operator=(const TlsHandshake&) = delete;

  void start() {
    hub_->add(weak_from_this());
    asio::dispatch(executor_, [self = shared_from_this()] {
      self->stream_.expires_after(self->hub_->options().handshake_timeout);  // for all of it
      beast::async_detect_ssl(self->stream_, self->buffer_,
                              [self](BoostError error, bool speaks_tls) { self->onDetected(error, speaks_tls); });
    });
  }

  void drain() override {
    asio::post(executor_, [self = shared_from_this()] {
      if (self->hub_) self->stream_.close();
    });
  }

 private:
  void onDetected(BoostError error, bool speaks_tls) {
    if (error) return failed();
    if (!speaks_tls) return refusePlain();
    stream_.secure(
        tls_->context, buffer_.cdata(),
        AnyHandler([self = shared_from_this()](BoostError e, std::size_t used) { self->onHandshake(e, used); }));
  }

  void onHandshake(BoostError error, std::size_t used) {
    // What detection read is part of the first message: all of it belongs to the handshake.
    if (error || used != buffer_.size() || hub_->draining()) return failed();
    leaveCount();
    stream_.expires_never();
    serveHttp(std::move(stream_), std::move(hub_), std::move(slot_));
  }

  /// The peer sees the end before the handler that holds this object is gone, and may come again at once: it must not
  /// still be counted then.
  void failed() {
    ++hub_->counters().tls_handshakes_failed;
    leaveCount();
    stream_.close();
  }

  void leaveCount() {
    if (std::exchange(counted_, false)) --hub_->counters().tls_handshakes;
  }

  void refusePlain() {
    ++hub_->counters().tls_handshakes_failed;
    stream_.expires_after(hub_->options().close_patience);
    asio::async_write(stream_, asio::buffer(plainRefusal()),
                      [self = shared_from_this()](BoostError error, std::size_t) {
                        BoostError ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                        if (!error) self->dropRest();
                      });
  }

  /// Closing with unread bytes would reset the connection and take the answer away from the client.
  void dropRest() {
    buffer_.clear();
    stream_.async_read_some(buffer_.prepare(kMostRead), [self = shared_from_this()](BoostError error, std::size_t) {
      if (!error) self->dropRest();
    });
  }

  Stream stream_;
  const Stream::executor_type executor_;  ///< for other threads: the stream goes elsewhere after the handshake
  std::shared_ptr<TlsContext> tls_;
  std::shared_ptr<Hub> hub_;  ///< null: handed over
  ConnectionSlot slot_;
  beast::flat_buffer buffer_{kMostRead};
  bool counted_ = true;  ///< among the handshakes under way
};

}  // namespace

void serveTls(TcpStream stream, std::shared_ptr<TlsContext> tls, std::shared_ptr<Hub> hub, ConnectionSlot slot) {
  if (hub->counters().tls_handshakes.load() >= protocol::kMaxTlsHandshakes) {
    ++hub->counters().connections_refused;
    return;
  }
  std::make_shared<TlsHandshake>(std::move(stream), std::move(tls), std::move(hub), std::move(slot))->start();
}

}  // namespace radiosity::net
