// A connection as the sessions use it, with or without TLS: one type, so that there is one code for both. Owned by a
// session, used on its strand.
//
// Handlers and buffers lose their types here. Beast's operations are templates in templates; carried on through TLS,
// every one of them would be made anew, and a session would take twice the memory to compile.
#pragma once

#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/buffers_range.hpp>
#include <boost/beast/core/role.hpp>
#include <boost/container/static_vector.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>

#include "server/net/beast.h"

namespace radiosity::net {

/// A handler of any type. To be called once, or never; its memory is free before it runs, as Asio promises.
class AnyHandler {
 public:
  template <typename Handler>
  explicit AnyHandler(Handler handler) : call_(std::make_unique<CallOf<Handler>>(std::move(handler))) {}
  void operator()(BoostError error = {}, std::size_t bytes = 0) { Call::run(std::move(call_), error, bytes); }

 private:
  struct Call {
    Call() = default;
    virtual ~Call() = default;
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;
    virtual void runAndFree(std::unique_ptr<Call> self, BoostError error, std::size_t bytes) = 0;
    static void run(std::unique_ptr<Call> call, BoostError error, std::size_t bytes) {
      auto& target = *call;
      target.runAndFree(std::move(call), error, bytes);
    }
  };
  template <typename Handler>
  struct CallOf final : Call {
    explicit CallOf(Handler&& wanted) : handler(std::move(wanted)) {}
    void runAndFree(std::unique_ptr<Call> self, BoostError error, std::size_t bytes) override {
      auto moved = std::move(handler);
      self.reset();
      if constexpr (std::is_invocable_v<Handler&, BoostError, std::size_t>) {
        moved(error, bytes);
      } else {
        moved(error);
      }
    }
    Handler handler;
  };

  std::unique_ptr<Call> call_;
};

/// An AsyncStream of Beast. Time limits are those of the TCP stream below: they cover the records of TLS too.
class Stream {
 public:
  using executor_type = TcpStream::executor_type;
  using next_layer_type = TcpStream;

  explicit Stream(TcpStream stream);
  Stream(Stream&&) noexcept;
  Stream& operator=(Stream&&) noexcept;
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  TcpStream::socket_type& socket() { return tcp_->socket(); }
  void close() { tcp_->close(); }

  /// The server's side of the TLS handshake; all that follows is enciphered. `read`: bytes that were read already; they
  /// must live until the handler (error, bytes of them used) is called, as must the context.
  void secure(asio::ssl::context& context, asio::const_buffer read, AnyHandler handler);

  /// Says that nothing more will be sent: close_notify and the peer's, where there is TLS.
  void endSending(AnyHandler handler);

  // NOLINTBEGIN(readability-identifier-naming): names that Beast asks for, or uses itself
  TcpStream& next_layer() { return *tcp_; }
  executor_type get_executor() { return tcp_->get_executor(); }
  void expires_after(std::chrono::nanoseconds time) { tcp_->expires_after(time); }
  void expires_never() { tcp_->expires_never(); }
  template <typename Buffers, typename Handler>
  void async_read_some(const Buffers& buffers, Handler&& handler) {
    readSome(few<asio::mutable_buffer>(buffers), AnyHandler(std::forward<Handler>(handler)));
  }
  template <typename Buffers, typename Handler>
  void async_write_some(const Buffers& buffers, Handler&& handler) {
    writeSome(few<asio::const_buffer>(buffers), AnyHandler(std::forward<Handler>(handler)));
  }
  /// How Beast's WebSocket ends a connection.
  template <typename Handler>
  friend void async_teardown(beast::role_type role, Stream& stream, Handler&& handler) {
    stream.tearDown(role, AnyHandler(std::forward<Handler>(handler)));
  }
  // NOLINTEND(readability-identifier-naming)

 private:
  struct Tls;
  /// More than an operation has; what does not fit is left to the next, which reading and writing "some" allows.
  static constexpr std::size_t kFew = 16;
  template <typename Buffer>
  using Few = boost::container::static_vector<Buffer, kFew>;

  template <typename Buffer, typename Buffers>
  static Few<Buffer> few(const Buffers& buffers) {
    Few<Buffer> some;
    for (const auto buffer : beast::buffers_range_ref(buffers)) {
      if (some.size() == kFew) break;
      if (buffer.size() > 0) some.push_back(buffer);
    }
    return some;
  }
  void readSome(const Few<asio::mutable_buffer>& buffers, AnyHandler handler);
  void writeSome(const Few<asio::const_buffer>& buffers, AnyHandler handler);
  void tearDown(beast::role_type role, AnyHandler handler);

  std::unique_ptr<TcpStream> tcp_;  ///< on the heap: TLS refers to it
  std::unique_ptr<Tls> tls_;        ///< null: plain
};

}  // namespace radiosity::net
