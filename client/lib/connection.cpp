#include "client/lib/connection.h"

#include <algorithm>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket.hpp>
#include <deque>
#include <map>
#include <random>

#include "client/lib/pump.h"
#include "client/lib/stream.h"

namespace radiosity::client {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using detail::Clock;

constexpr std::size_t kMaxErrorBodyBytes = 200;

/// What came and waits to be handed to a callback. `frame_bytes` is the credit that a tile takes.
struct Arrival {
  std::variant<protocol::Notification, protocol::Tile> content;
  std::int64_t frame_bytes = 0;
};

}  // namespace

struct Connection::Impl {
  explicit Impl(ConnectionOptions wanted)
      : options(std::move(wanted)), pump(options.keep_going), stream(pump.context()) {}

  // -- opening --

  Result<void> connect() {
    auto connected = detail::openStream(pump, stream.next_layer(), options.url, options.trust, options.timeout);
    if (!connected) return connected;
    stream.read_message_max(protocol::kMaxMessageBytes);
    // A server that is gone without a word is noticed by its silence.
    stream.set_option(websocket::stream_base::timeout{websocket::stream_base::none(), std::chrono::seconds(60), true});
    stream.set_option(websocket::stream_base::decorator([this](websocket::request_type& request) {
      request.set(http::field::user_agent, options.client);
      request.set(http::field::sec_websocket_protocol, protocol::kSubprotocol);
      if (!options.token.empty()) request.set(http::field::authorization, "Bearer " + options.token);
    }));
    websocket::response_type answer;
    const auto error = pump.await(stream, options.timeout, [&](auto handler) {
      stream.async_handshake(answer, options.url.authority(), options.url.target(protocol::kWebSocketPath), handler);
    });
    if (error == websocket::error::upgrade_declined) return declined(answer);
    if (error == http::error::bad_version || error == http::error::bad_line_ending ||
        error == http::error::bad_status || error == http::error::bad_reason)
      return fail(ErrorCode::kUnavailable, "what listens there does not speak HTTP", options.url.text());
    if (error) return tl::unexpected(detail::transferError(error, options.url, "opening the WebSocket"));
    if (answer[http::field::sec_websocket_protocol] != protocol::kSubprotocol)
      return fail(ErrorCode::kUnavailable, "this is not a radiosityd that speaks radiosity.v1", options.url.text());
    read();
    return {};
  }

  Result<void> declined(const websocket::response_type& answer) const {
    std::string body = answer.body().substr(0, kMaxErrorBodyBytes);
    std::replace(body.begin(), body.end(), '\n', ' ');
    const auto status = answer.result_int();
    std::string why = "the server declined the WebSocket with HTTP status " + std::to_string(status);
    if (status == 401 || status == 403) why += " (is the token right? --token-file)";
    return fail(ErrorCode::kUnavailable, why + (body.empty() ? "" : ": " + body), options.url.text());
  }

  Result<void> waitForServerInfo() {
    const auto deadline = Clock::now() + options.timeout;
    (void)pump.runUntil([this] { return info.has_value() || broken.has_value(); }, deadline);
    if (info) return {};
    if (broken) return tl::unexpected(*broken);
    return fail(ErrorCode::kUnavailable, pump.interrupted() ? "interrupted" : "the server sent no serverInfo in time",
                options.url.text());
  }

  // -- reading --

  void read() {
    stream.async_read(buffer, [this](beast::error_code error, std::size_t) {
      if (error) return lose(error);
      if (stream.got_text()) {
        onText(beast::buffers_to_string(buffer.data()));
      } else {
        onTileFrame();
      }
      buffer.consume(buffer.size());
      if (!broken) read();
    });
  }

  void onText(const std::string& text) {
    for (auto& item : protocol::parseRpc(text, protocol::kMaxMessageBytes).items) {
      if (auto* response = std::get_if<protocol::RpcResponse>(&item)) {
        onResponse(std::move(*response));
      } else if (auto* request = std::get_if<protocol::RpcRequest>(&item)) {
        auto notification = protocol::decodeNotification(*request);
        if (!notification) continue;  // of a newer minor version: the protocol says ignore
        if (const auto* server_info = std::get_if<protocol::ServerInfo>(&*notification)) info = *server_info;
        arrivals.push_back({std::move(*notification)});
      } else {
        const auto& malformed = std::get<protocol::RpcMalformed>(item);
        return breakWith("the server sent a message that is not JSON-RPC: " + malformed.error.message);
      }
    }
  }

  void onResponse(protocol::RpcResponse response) {
    // An error with id null answers no call in particular; it comes before the server closes and tells why.
    if (response.id == "null" && response.error) last_words = response.error->message;
    const auto place = waiting.find(response.id);
    if (place != waiting.end()) place->second = std::move(response);
  }

  void onTileFrame() {
    const auto data = buffer.cdata();
    auto tile = protocol::decodeTile(std::span(static_cast<const std::uint8_t*>(data.data()), data.size()));
    if (!tile) return breakWith("the server sent a bad tile: " + tile.error().text());
    arrivals.push_back({std::move(*tile), static_cast<std::int64_t>(data.size())});
  }

  void breakWith(const std::string& why) {
    if (!broken) broken = Error{ErrorCode::kUnavailable, why, options.url.text()};
  }

  void lose(const beast::error_code& error) {
    if (error == websocket::error::closed) {
      const auto& reason = stream.reason();
      std::string why = "the server closed the connection (code " + std::to_string(reason.code) + ")";
      if (reason.reason.size() > 0) why += ": " + std::string(reason.reason.data(), reason.reason.size());
      if (!last_words.empty()) why += ": " + last_words;
      return breakWith(why);
    }
    if (!broken) broken = detail::transferError(error, options.url, "talking to the server");
  }

  // -- writing --

  void send(std::string text) {
    outgoing.push_back(std::move(text));
    if (outgoing.size() == 1) write();
  }

  void write() {
    stream.text(true);
    stream.async_write(boost::asio::buffer(outgoing.front()), [this](beast::error_code error, std::size_t) {
      if (error) return lose(error);
      outgoing.pop_front();
      if (!outgoing.empty()) write();
    });
  }

  // -- handing over --

  /// True where something was handed over. Callbacks run outside of any handler, so a slow one delays only us; its
  /// tiles hold credit back and so slow the server's tile lane, as they should.
  bool dispatch() {
    if (arrivals.empty()) return false;
    std::int64_t consumed_bytes = 0;
    while (!arrivals.empty()) {
      const Arrival arrival = std::move(arrivals.front());
      arrivals.pop_front();
      consumed_bytes += arrival.frame_bytes;
      if (const auto* tile = std::get_if<protocol::Tile>(&arrival.content)) {
        if (tile_handler) tile_handler(*tile);
      } else if (notification_handler) {
        notification_handler(std::get<protocol::Notification>(arrival.content));
      }
    }
    if (consumed_bytes > 0 && !broken) send(protocol::encodeCall({}, protocol::CreditCall{.bytes = consumed_bytes}));
    return true;
  }

  ConnectionOptions options;
  detail::Pump pump;
  websocket::stream<detail::Stream> stream;
  beast::flat_buffer buffer;
  std::deque<std::string> outgoing;
  std::deque<Arrival> arrivals;
  std::map<protocol::RequestId, std::optional<protocol::RpcResponse>> waiting;
  std::uint64_t next_id = 1;
  std::optional<Error> broken;
  std::string last_words;
  std::optional<protocol::ServerInfo> info;
  protocol::HelloReply hello_reply;
  NotificationHandler notification_handler;
  TileHandler tile_handler;
};

Connection::Connection(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Connection::Connection(Connection&&) noexcept = default;
Connection& Connection::operator=(Connection&&) noexcept = default;
Connection::~Connection() = default;

CallResult<Connection> Connection::open(ConnectionOptions options) {
  auto impl = std::make_unique<Impl>(std::move(options));
  if (auto connected = impl->connect(); !connected) return tl::unexpected(CallFailure{connected.error()});
  if (auto greeted = impl->waitForServerInfo(); !greeted) return tl::unexpected(CallFailure{greeted.error()});
  Connection connection(std::move(impl));
  const auto& wanted = connection.impl_->options;
  auto reply = connection.call(
      protocol::HelloCall{.client = wanted.client,
                          .token = wanted.token,
                          .tile_formats = {protocol::PixelFormat::kRgba16f, protocol::PixelFormat::kRgba32f},
                          .codecs = {protocol::Codec::kDeflate, protocol::Codec::kNone},
                          .credit_bytes = wanted.credit_bytes},
      wanted.timeout);
  if (!reply) return tl::unexpected(reply.error());
  connection.impl_->hello_reply = *reply;
  return connection;
}

const protocol::ServerInfo& Connection::serverInfo() const { return *impl_->info; }
const protocol::HelloReply& Connection::hello() const { return impl_->hello_reply; }
void Connection::onNotification(NotificationHandler handler) { impl_->notification_handler = std::move(handler); }
void Connection::onTile(TileHandler handler) { impl_->tile_handler = std::move(handler); }

CallResult<protocol::JsonPtr> Connection::exchange(const protocol::Call& call, std::string_view method,
                                                   std::chrono::milliseconds timeout) {
  auto& impl = *impl_;
  const auto lost = [&] { return tl::unexpected(CallFailure{*impl.broken}); };
  if (impl.broken) return lost();
  const protocol::RequestId id = std::to_string(impl.next_id++);
  std::string text = protocol::encodeCall(id, call);
  if (text.size() > protocol::kMaxMessageBytes)
    return tl::unexpected(CallFailure{{ErrorCode::kTooLarge,
                                       "the message would be " + std::to_string(text.size()) + " bytes; the limit is " +
                                           std::to_string(protocol::kMaxMessageBytes),
                                       std::string(method)}});
  const auto place = impl.waiting.emplace(id, std::nullopt).first;
  impl.send(std::move(text));
  const auto deadline = Clock::now() + timeout;
  bool in_time = true;
  while (in_time && !place->second && !impl.broken) {
    in_time = impl.pump.runUntil([&] { return place->second || impl.broken || !impl.arrivals.empty(); }, deadline);
    impl.dispatch();
  }
  const auto response = std::move(place->second);
  impl.waiting.erase(place);
  if (!response && impl.broken) return lost();
  if (!response) {
    const std::string why = impl.pump.interrupted() ? "interrupted"
                                                    : "no answer to " + std::string(method) + " within " +
                                                          std::to_string(timeout.count() / 1000) + " s";
    return tl::unexpected(CallFailure{{ErrorCode::kUnavailable, why, impl.options.url.text()}});
  }
  if (response->error) return tl::unexpected(CallFailure{protocol::fromRpcError(*response->error), response->error});
  return response->result;
}

Result<void> Connection::poll(std::chrono::milliseconds duration) {
  auto& impl = *impl_;
  if (!impl.dispatch() && !impl.broken) {
    impl.pump.context().poll();  // runs what can be run at once, where runUntil() has no time for anything
    (void)impl.pump.runUntil([&] { return impl.broken || !impl.arrivals.empty(); }, Clock::now() + duration);
    impl.dispatch();
  }
  if (impl.broken) return tl::unexpected(*impl.broken);
  return {};
}

std::chrono::milliseconds BackOff::next() {
  constexpr double kFirstMs = 250.0;
  constexpr unsigned kDoublings = 5;  // 8 s
  static std::minstd_rand random(std::random_device{}());
  std::uniform_real_distribution<double> spread(0.5, 1.0);
  const double wait_ms = kFirstMs * static_cast<double>(1U << std::min(attempts_++, kDoublings)) * spread(random);
  return std::chrono::milliseconds(static_cast<std::int64_t>(wait_ms));
}

}  // namespace radiosity::client
