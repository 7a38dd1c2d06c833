#include "tests/service/net/test_client.h"

#include <fmt/format.h>
#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/websocket.hpp>
#include <stdexcept>
#include <utility>

namespace radiosity::testing {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using asio::ip::tcp;
using BoostError = boost::system::error_code;

tcp::endpoint local(std::uint16_t port) { return {asio::ip::make_address("127.0.0.1"), port}; }

/// Runs the context until `done` or the limit; false: the limit.
bool runUntil(asio::io_context& context, const bool& done, Seconds limit) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::nanoseconds>(limit);
  context.restart();
  while (!done && std::chrono::steady_clock::now() < end)
    if (context.run_one_until(end) == 0) break;
  return done;
}

}  // namespace

// ---- WebSocket ----

struct TestSocket::State {
  asio::io_context context;
  websocket::stream<beast::tcp_stream, false> ws{context};
  beast::flat_buffer buffer;
  int status = 0, close_code = 0;
  bool ended = false, reading = false, got = false;
  int next_id = 1;
};

TestSocket::TestSocket(std::uint16_t port, const Upgraded& how) : state_(std::make_unique<State>()) {
  auto& ws = state_->ws;
  auto& socket = beast::get_lowest_layer(ws).socket();
  socket.open(tcp::v4());
  if (how.receive_buffer_bytes > 0) socket.set_option(asio::socket_base::receive_buffer_size(how.receive_buffer_bytes));
  socket.connect(local(port));
  ws.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
    if (!how.subprotocol.empty()) request.set(beast::http::field::sec_websocket_protocol, how.subprotocol);
    if (!how.origin.empty()) request.set(beast::http::field::origin, how.origin);
    if (!how.authorization.empty()) request.set(beast::http::field::authorization, how.authorization);
  }));
  ws.read_message_max(16 << 20);
  websocket::response_type response;
  BoostError error;
  ws.handshake(response, how.host.empty() ? fmt::format("127.0.0.1:{}", port) : how.host, "/ws", error);
  state_->status = static_cast<int>(response.result_int());
  state_->ended = static_cast<bool>(error);
}
TestSocket::~TestSocket() = default;
TestSocket::TestSocket(TestSocket&&) noexcept = default;

int TestSocket::status() const { return state_->status; }
int TestSocket::closeCode() const { return state_->close_code; }
bool TestSocket::ended() const { return state_->ended; }

void TestSocket::sendText(std::string_view text) {
  BoostError error;  // a server that has closed meanwhile shows in read()
  state_->ws.text(true);
  state_->ws.write(asio::buffer(text), error);
}
void TestSocket::sendBinary(std::string_view bytes) {
  BoostError error;
  state_->ws.binary(true);
  state_->ws.write(asio::buffer(bytes), error);
}
void TestSocket::sendRaw(std::string_view bytes) {
  BoostError error;
  asio::write(state_->ws.next_layer().socket(), asio::buffer(bytes), error);
}
void TestSocket::close() {
  BoostError error;
  state_->ws.next_layer().socket().close(error);
}

std::optional<TestSocket::Message> TestSocket::read(Seconds limit) {
  auto& s = *state_;
  if (s.ended) return std::nullopt;
  if (!s.reading) {
    s.reading = true;
    s.got = false;
    s.ws.async_read(s.buffer, [&s](BoostError error, std::size_t) {
      s.reading = false;
      s.got = true;
      s.ended = static_cast<bool>(error);
      if (error == websocket::error::closed) s.close_code = static_cast<int>(s.ws.reason().code);
    });
  }
  if (!runUntil(s.context, s.got, limit) || s.ended) return std::nullopt;
  const auto* data = static_cast<const std::uint8_t*>(s.buffer.cdata().data());
  Message message{s.ws.got_binary(), Bytes(data, data + s.buffer.size())};
  s.buffer.consume(s.buffer.size());
  return message;
}

void TestSocket::keep(const Message& message) {
  if (message.binary) return tiles.push_back(message.bytes);
  const auto parsed = protocol::parseRpc(message.text(), 16U << 20U);
  for (const auto& item : parsed.items)
    if (const auto* note = std::get_if<protocol::RpcRequest>(&item)) notes.push_back(*note);
}

protocol::RpcResponse TestSocket::call(const protocol::Call& call) {
  const auto id = std::to_string(state_->next_id++);
  sendText(protocol::encodeCall(id, call));
  while (const auto message = read()) {
    if (!message->binary) {
      const auto parsed = protocol::parseRpc(message->text(), 16U << 20U);
      const auto* response = std::get_if<protocol::RpcResponse>(&parsed.items.at(0));
      if (response != nullptr && response->id == id) return *response;
    }
    keep(*message);
  }
  return {id, nullptr, protocol::RpcError{protocol::RpcCode::kUnavailable, "the connection ended"}};
}

protocol::RpcResponse TestSocket::hello(std::string token, std::vector<protocol::PixelFormat> formats,
                                        std::int64_t credit) {
  protocol::HelloCall hello;
  hello.client = "test";
  hello.token = std::move(token);
  hello.tile_formats = std::move(formats);
  hello.credit_bytes = credit;
  return call(hello);
}

std::optional<protocol::RpcRequest> TestSocket::waitFor(std::string_view method, Seconds limit) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::nanoseconds>(limit);
  while (true) {
    const auto found = std::find_if(notes.begin(), notes.end(), [&](const auto& n) { return n.method == method; });
    if (found != notes.end()) {
      auto note = std::move(*found);
      notes.erase(found);
      return note;
    }
    const auto message = read(Seconds(end - std::chrono::steady_clock::now()));
    if (!message) return std::nullopt;
    keep(*message);
  }
}

std::optional<Bytes> TestSocket::nextTile(Seconds limit) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::nanoseconds>(limit);
  while (tiles.empty()) {
    const auto message = read(Seconds(end - std::chrono::steady_clock::now()));
    if (!message) return std::nullopt;
    keep(*message);
  }
  auto tile = std::move(tiles.front());
  tiles.erase(tiles.begin());
  return tile;
}

// ---- HTTP ----

struct RawHttp::State {
  asio::io_context context;
  tcp::socket socket{context};
  std::string received;

  /// Reads some more; false: ended, or the limit.
  bool more(Seconds limit) {
    std::array<char, 65536> chunk{};
    bool done = false;
    std::size_t count = 0;
    socket.async_read_some(asio::buffer(chunk), [&](BoostError, std::size_t n) {
      count = n;
      done = true;
    });
    if (!runUntil(context, done, limit)) {
      BoostError ignored;
      socket.cancel(ignored);
      context.restart();
      context.run();
      return false;
    }
    received.append(chunk.data(), count);
    return count > 0;
  }
};

RawHttp::RawHttp(std::uint16_t port) : state_(std::make_unique<State>()) { state_->socket.connect(local(port)); }
RawHttp::~RawHttp() = default;

void RawHttp::send(std::string_view bytes) {
  BoostError error;  // a server that refuses may close before it has read everything
  asio::write(state_->socket, asio::buffer(bytes), error);
}

std::string RawResponse::header(std::string_view name) const {
  std::string lower = head;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  std::string wanted = "\r\n" + std::string(name) + ": ";
  std::transform(wanted.begin(), wanted.end(), wanted.begin(), [](unsigned char c) { return std::tolower(c); });
  const auto at = lower.find(wanted);
  if (at == std::string::npos) return {};
  const auto start = at + wanted.size();
  return head.substr(start, head.find("\r\n", start) - start);
}

RawResponse RawHttp::receive(bool head_only, Seconds limit) {
  auto& text = state_->received;
  RawResponse response;
  while (text.find("\r\n\r\n") == std::string::npos)
    if (!state_->more(limit)) return response;
  const auto end = text.find("\r\n\r\n") + 4;
  response.head = text.substr(0, end);
  text.erase(0, end);
  response.status = std::stoi(response.head.substr(9, 3));
  const auto length = response.header("content-length");
  const auto size = head_only || length.empty() ? std::size_t{0} : static_cast<std::size_t>(std::stoull(length));
  while (text.size() < size)
    if (!state_->more(limit)) break;
  response.body = text.substr(0, size);
  text.erase(0, size);
  return response;
}

std::size_t RawHttp::readSome(Seconds limit) {
  state_->received.clear();
  (void)state_->more(limit);
  return std::exchange(state_->received, {}).size();
}

bool RawHttp::closed(Seconds limit) {
  const auto before = std::chrono::steady_clock::now();
  while (state_->more(limit)) {
  }
  return std::chrono::steady_clock::now() - before < limit;
}

RawResponse request(std::uint16_t port, std::string_view method, std::string_view target, std::string_view headers,
                    std::string_view body) {
  RawHttp http(port);
  auto text = fmt::format("{} {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{}", method, target, port, headers);
  if (!body.empty()) text += fmt::format("Content-Length: {}\r\n", body.size());
  http.send(text + "\r\n" + std::string(body));
  return http.receive(method == "HEAD");
}

}  // namespace radiosity::testing
