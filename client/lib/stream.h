// Private to client/lib: a connection with or without TLS as one type, so that HTTP and WebSocket have one code for
// both. Used by one thread. As in the server, handlers and buffers lose their types, or every operation of Beast would
// be compiled twice.
#pragma once

#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/buffers_range.hpp>
#include <boost/beast/core/role.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/container/static_vector.hpp>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace radiosity::client::detail {

/// An AsyncStream of Beast; starts plain.
class Stream {
 public:
  using Tcp = boost::beast::tcp_stream;
  using Error = boost::beast::error_code;
  using executor_type = Tcp::executor_type;
  using next_layer_type = Tcp;
  using Handler = std::function<void(Error, std::size_t)>;

  explicit Stream(boost::asio::io_context& context);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// The client's side of the TLS handshake; all that follows is enciphered. `host` is what the certificate must be
  /// made out to where `verify` is set.
  void secure(boost::asio::ssl::context& context, const std::string& host, bool verify, Handler handler);
  /// OpenSSL's SSL of a stream that was secured; for its verdict on the certificate.
  [[nodiscard]] void* nativeTls() const;

  // NOLINTBEGIN(readability-identifier-naming): names that Beast asks for
  Tcp& next_layer() { return tcp_; }
  executor_type get_executor() { return tcp_.get_executor(); }
  template <typename Buffers, typename H>
  void async_read_some(const Buffers& buffers, H&& handler) {
    readSome(few<boost::asio::mutable_buffer>(buffers), shared(std::forward<H>(handler)));
  }
  template <typename Buffers, typename H>
  void async_write_some(const Buffers& buffers, H&& handler) {
    writeSome(few<boost::asio::const_buffer>(buffers), shared(std::forward<H>(handler)));
  }
  /// How Beast's WebSocket ends a connection.
  template <typename H>
  friend void async_teardown(boost::beast::role_type role, Stream& stream, H&& handler) {
    auto held = std::make_shared<std::decay_t<H>>(std::forward<H>(handler));
    stream.tearDown(role, [held](Error error, std::size_t) { (*held)(error); });
  }
  // NOLINTEND(readability-identifier-naming)

 private:
  struct Tls;
  static constexpr std::size_t kFew = 16;
  template <typename Buffer>
  using Few = boost::container::static_vector<Buffer, kFew>;

  /// Handlers of Beast can be moved only, a std::function wants to be copied.
  template <typename H>
  static Handler shared(H&& handler) {
    auto held = std::make_shared<std::decay_t<H>>(std::forward<H>(handler));
    return [held](Error error, std::size_t bytes) { (*held)(error, bytes); };
  }
  template <typename Buffer, typename Buffers>
  static Few<Buffer> few(const Buffers& buffers) {
    Few<Buffer> some;
    for (const auto buffer : boost::beast::buffers_range_ref(buffers)) {
      if (some.size() == kFew) break;
      if (buffer.size() > 0) some.push_back(buffer);
    }
    return some;
  }
  void readSome(const Few<boost::asio::mutable_buffer>& buffers, Handler handler);
  void writeSome(const Few<boost::asio::const_buffer>& buffers, Handler handler);
  void tearDown(boost::beast::role_type role, Handler handler);

  Tcp tcp_;
  std::unique_ptr<Tls> tls_;  ///< null: plain
};

}  // namespace radiosity::client::detail
