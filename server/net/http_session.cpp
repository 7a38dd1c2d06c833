#include "server/net/http_session.h"

#include <fmt/format.h>
#include <poll.h>
#include <array>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/read_size.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/serializer.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <ctime>
#include <optional>
#include <span>
#include <stop_token>
#include <utility>

#include "common/one_line.h"
#include "common/sha256.h"
#include "server/net/access.h"
#include "server/net/http_framing.h"
#include "server/net/http_routes.h"
#include "server/net/pace.h"
#include "server/net/websocket_session.h"

namespace radiosity::net {
namespace {

constexpr std::uint32_t kHeaderLimit = 16 * 1024;
constexpr std::size_t kBufferLimit = std::size_t{64} * 1024;
constexpr std::uint64_t kBodyOfGet = std::uint64_t{64} * 1024;
constexpr std::size_t kSmallBody = std::size_t{64} * 1024;  ///< of a response: is sent whatever else waits
/// How often it is looked whether the client still waits for an answer that takes long.
constexpr auto kPresenceInterval = std::chrono::milliseconds(50);
constexpr std::size_t kLingerBytes = std::size_t{64} << 20;  ///< read and dropped so that a refusal can be read

using Parser = http::request_parser<http::vector_body<std::uint8_t>>;
using Response = http::response<http::span_body<const char>>;
using Serializer = http::response_serializer<http::span_body<const char>>;

std::string_view view(boost::core::string_view text) { return {text.data(), text.size()}; }

/// The peer has closed its side, or the connection is broken; also behind bytes that are not read yet. Who sends no
/// more does not wait for an answer either, as proxies see it.
bool hasLeft(tcp::socket::native_handle_type socket) {
  pollfd look{socket, POLLRDHUP, 0};
  return poll(&look, 1, 0) > 0 && (look.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
}

std::string_view firstWord(std::string_view text) { return text.substr(0, text.find(' ')); }

FramingFields framingOf(const Parser& parser) {
  const auto& header = parser.get();
  FramingFields fields{header.version(), header.count(http::field::content_length) > 0, {}, parser.chunked()};
  const auto [first, end] = header.equal_range(http::field::transfer_encoding);
  for (auto line = first; line != end; ++line) fields.transfer_encodings.push_back(view(line->value()));
  return fields;
}

/// What the peer sent is not HTTP, and can be answered; but for a connection that ended or timed out.
bool isMalformed(BoostError error) {
  return error.category() == http::make_error_code(http::error::bad_method).category();
}

/// RFC 9110 section 5.6.7.
std::string httpDate() {
  std::array<char, 64> text{};
  const auto now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  const auto length = std::strftime(text.data(), text.size(), "%a, %d %b %Y %H:%M:%S GMT", &parts);
  return {text.data(), length};
}

/// The part of the memory for uploads that a session holds. All sessions share kBodiesAtATime times the largest
/// upload: each may send one that large, and together they must not fill the machine.
class UploadRoom {
 public:
  explicit UploadRoom(Hub& hub) : hub_(hub) {}
  ~UploadRoom() { hub_.counters().uploads_held_bytes -= held_bytes_; }
  UploadRoom(const UploadRoom&) = delete;
  UploadRoom& operator=(const UploadRoom&) = delete;

  /// False: there is no room for so much; what was held is held still.
  [[nodiscard]] bool hold(std::size_t bytes) {
    auto& all = hub_.counters().uploads_held_bytes;
    const auto now = all += bytes - held_bytes_;
    const bool fits = now <= kBodiesAtATime * hub_.options().max_upload_bytes || bytes <= held_bytes_;
    if (!fits) all -= bytes - held_bytes_;
    if (fits) held_bytes_ = bytes;
    return fits;
  }

 private:
  Hub& hub_;
  std::uint64_t held_bytes_ = 0;
};

class HttpSession : public Connection, public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(Stream stream, std::shared_ptr<Hub> hub, ConnectionSlot slot)
      : stream_(std::move(stream)),
        executor_(stream_.get_executor()),
        hub_(std::move(hub)),
        slot_(std::move(slot)),
        buffer_(kBufferLimit),
        room_(*hub_),
        stall_(executor_),
        presence_(executor_),
        session_(hub_->nextSession()),
        pace_(hub_->options().least_bytes_per_second),
        going_(hub_->sendRoom()) {}

  void start() {
    hub_->add(weak_from_this());
    asio::dispatch(executor_, [self = shared_from_this()] { self->readHeader(); });
  }

  void drain() override {
    asio::post(executor_, [self = shared_from_this()] {
      if (self->idle_) return self->stream_.close();
      self->cutWhenStalled();
    });
  }

 private:
  void readHeader();
  void onHeader(BoostError error);
  void upgrade();
  bool refuseEarly();
  void readBody();
  [[nodiscard]] BoostError parseBody();
  void onBody(BoostError error);
  void onWhole();
  void send(HttpResponse response, bool close);
  void prepare(bool close);
  void writeSome(std::size_t moved);
  void onWritten();
  void linger();
  void cutWhenStalled();
  void watchPresence();

  [[nodiscard]] std::string_view field(http::field name) const { return view(parser_->get()[name]); }
  [[nodiscard]] std::string queryOr(const char* key, std::string_view otherwise) const {
    const auto found = request_.query.find(key);
    return found != request_.query.end() ? found->second : std::string(otherwise);
  }

  Stream stream_;
  const Stream::executor_type executor_;  ///< for other threads: the stream goes elsewhere with an upgrade
  std::shared_ptr<Hub> hub_;
  ConnectionSlot slot_;
  beast::flat_buffer buffer_;
  std::optional<Parser> parser_;
  HttpRequest request_;
  UploadRoom room_;
  bool head_ = false, keep_alive_ = false, idle_ = false;
  bool asked_ = false;  ///< the engine, which takes its time
  asio::steady_timer stall_, presence_;
  const std::uint64_t session_;
  std::stop_source gone_;              ///< of the request that is under way
  std::uint64_t moved_bytes_ = 0;      ///< either way
  Pace pace_;                          ///< of the body that comes or goes
  std::optional<Sha256> body_sha256_;  ///< of what has come of a body that is named by it
  std::size_t body_seen_ = 0;          ///< bytes of the body that have come
  std::string origin_;
  HttpResponse response_;  ///< holds the bytes that message_ points to
  SendRoom::Part going_;   ///< of those bytes; to be given back before they go, since it knows them by their place
  std::optional<Response> message_;
  std::optional<Serializer> serializer_;
  std::size_t lingered_ = 0;
};

void HttpSession::readHeader() {
  if (hub_->draining()) return stream_.close();
  parser_.emplace();
  parser_->header_limit(kHeaderLimit);
  parser_->body_limit(hub_->options().max_upload_bytes);
  head_ = keep_alive_ = false;
  origin_.clear();
  idle_ = buffer_.size() == 0;
  stream_.expires_after(hub_->options().header_timeout);  // for the whole header, however slowly it drips
  http::async_read_header(stream_, buffer_, *parser_, [self = shared_from_this()](BoostError error, std::size_t) {
    self->idle_ = false;
    self->onHeader(error);
  });
}

void HttpSession::onHeader(BoostError error) {
  if (error == http::error::body_limit)
    return send(
        errorResponse(413, "tooLarge",
                      fmt::format("a body may have at most {} bytes (--max-upload)", hub_->options().max_upload_bytes)),
        true);
  if (error == http::error::header_limit || error == http::error::buffer_overflow)
    return send(errorResponse(431, "tooLarge", fmt::format("a header may have at most {} bytes", kHeaderLimit)), true);
  if (error == beast::error::timeout || error == http::error::end_of_stream) return stream_.close();
  if (isMalformed(error)) return send(errorResponse(400, "badInput", "not HTTP/1.1: " + error.message()), true);
  if (error) return stream_.close();
  const auto& message = parser_->get();
  head_ = message.method() == http::verb::head;
  keep_alive_ = message.keep_alive();
  origin_ = field(http::field::origin);
  auto request = parseTarget(view(message.method_string()), view(message.target()));
  if (!request) return send(errorResponse(request.error()), true);
  request_ = std::move(*request);
  request_.content_type = field(http::field::content_type);
  request_.accept_encoding = field(http::field::accept_encoding);
  request_.if_none_match = field(http::field::if_none_match);
  request_.name = queryOr("name", view(message["X-Name"]));
  if (request_.name.empty()) request_.name = "unnamed scene";
  request_.client = queryOr("client", {});
  if (request_.client.empty()) request_.client = view(message["X-Client"]);
  if (request_.client.empty()) request_.client = firstWord(field(http::field::user_agent));
  request_.client = shortLine(request_.client, protocol::kMaxTextBytes);
  if (refuseEarly()) return;
  readBody();
}

/// Everything that can be decided without the body. True: answered, or handed over.
bool HttpSession::refuseEarly() {
  const auto& options = hub_->options();
  const bool no_body = parser_->is_done();
  const auto refuse = [&](HttpResponse response) {
    send(std::move(response), !no_body);
    return true;
  };
  if (auto fault = framingFault(framingOf(*parser_))) {
    send(std::move(*fault), true);  // what follows may be a body, or may not
    return true;
  }
  const auto hosts = parser_->get().count(http::field::host);
  if (hosts > 1 || (hosts == 0 && parser_->get().version() >= 11))  // RFC 9112 section 3.2: whom it is for is not clear
    return refuse(errorResponse(400, "badInput", "a request of HTTP/1.1 needs one Host"));
  const auto host = request_.authority.empty() ? field(http::field::host) : std::string_view(request_.authority);
  if (!hostAllowed(host, options))
    return refuse(errorResponse(403, "forbidden",
                                "this name is not served (Host); use localhost or an IP address, or --allow-origin"));
  if (!originAllowed(origin_, host, options))
    return refuse(errorResponse(403, "forbidden", "this Origin may not use the server; see --allow-origin"));
  const bool ours = request_.path == protocol::kWebSocketPath && boost::beast::websocket::is_upgrade(parser_->get());
  if (ours && !no_body) return refuse(errorResponse(400, "badInput", "a request for an upgrade has no body"));
  if (ours && buffer_.size() > 0) {  // RFC 6455 section 4.1; and what is here already the WebSocket would not see
    send(errorResponse(400, "badInput", "frames may be sent once the upgrade is answered, and not before"), true);
    return true;
  }
  if (ours) {
    upgrade();
    return true;
  }
  if (request_.method != "OPTIONS" && needsToken(request_) && !hasToken(field(http::field::authorization), options)) {
    auto response = errorResponse(401, "unauthenticated", "send Authorization: Bearer <token>");
    response.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"radiosityd\"");
    return refuse(std::move(response));
  }
  if (request_.name.size() > protocol::kMaxTextBytes || request_.name.find_first_of("\r\n\t") != std::string::npos)
    return refuse(errorResponse(400, "badInput", "the name is too long or has control characters"));
  if (auto refused = refusal(request_)) return refuse(std::move(*refused));
  return false;
}

void HttpSession::upgrade() {
  const auto authorization = field(http::field::authorization);
  const bool authenticated = hasToken(authorization, hub_->options());
  if (!authorization.empty() && !authenticated)
    return send(errorResponse(401, "unauthenticated", "the token is wrong"), true);
  const auto offered = field(http::field::sec_websocket_protocol);
  bool speaks = false;
  for (std::string_view rest = offered; !rest.empty();) {
    auto name = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(name.size() + 1, rest.size()));
    while (name.starts_with(' ')) name.remove_prefix(1);
    while (name.ends_with(' ')) name.remove_suffix(1);
    speaks = speaks || name == protocol::kSubprotocol;
  }
  if (!speaks)
    return send(errorResponse(400, "badInput", "ask for the subprotocol radiosity.v1 (Sec-WebSocket-Protocol)"), true);
  if (hub_->draining()) return send(errorResponse({ErrorCode::kBusy, "the server is shutting down", {}}), true);
  stream_.expires_never();
  serveWebSocket(std::move(stream_), parser_->release(), hub_, slot_, authenticated);
}

void HttpSession::readBody() {
  body_seen_ = 0;
  body_sha256_.reset();
  if (namedByContent(request_)) body_sha256_.emplace();
  if (parser_->is_done()) return onWhole();
  pace_.start(hub_->options().idle_timeout);
  if (request_.method != "PUT") {
    // The parser holds a length against the limit with the header; a limit set now is for chunks alone.
    if (parser_->content_length().value_or(0) > kBodyOfGet)
      return send(errorResponse(413, "tooLarge", "a request of this method has no use for so large a body"), true);
    parser_->body_limit(kBodyOfGet);
  }
  if (!beast::iequals(parser_->get()[http::field::expect], "100-continue")) return onBody({});
  static constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
  stream_.expires_after(hub_->options().idle_timeout);
  asio::async_write(stream_, asio::buffer(kContinue),
                    [self = shared_from_this()](BoostError error, std::size_t) { self->onBody(error); });
}

/// All that is here of it. What is left is the beginning of a line of a chunk, or of a trailer.
BoostError HttpSession::parseBody() {
  BoostError error;
  while (!error && !parser_->is_done() && buffer_.size() > 0) {
    const auto used = parser_->put(buffer_.data(), error);
    buffer_.consume(used);
  }
  if (error != http::error::need_more) return error;
  const auto left = buffer_.cdata();
  // The parser would wait for a carriage return until the peer's time is up.
  if (hasBareLineFeed({static_cast<const char*>(left.data()), left.size()})) return http::error::bad_line_ending;
  return {};
}

void HttpSession::onBody(BoostError error) {
  if (!error) error = parseBody();
  if (error == http::error::body_limit)
    return send(errorResponse(413, "tooLarge", "the body is larger than this path accepts (--max-upload)"), true);
  if (isMalformed(error))
    return send(errorResponse(400, "badInput", "the body is not what its header says: " + error.message()), true);
  if (error) return stream_.close();
  // The hash is taken part by part: of a GiB it takes a second, in which nobody else would be served.
  const auto& body = parser_->get().body();
  const auto came = std::span(body).subspan(body_seen_);
  if (body_sha256_) body_sha256_->add(came);
  body_seen_ = body.size();
  if (!room_.hold(body.size()))
    return send(errorResponse({ErrorCode::kBusy, "other uploads take all the room there is; try again", {}}), true);
  if (parser_->is_done()) return onWhole();
  const auto room = beast::read_size(buffer_, kBufferLimit);
  if (room == 0) return onBody(http::error::buffer_overflow);
  stream_.expires_after(pace_.moved(came.size()));
  stream_.async_read_some(buffer_.prepare(room), [self = shared_from_this()](BoostError e, std::size_t n) {
    self->buffer_.commit(n);
    self->moved_bytes_ += n;
    self->onBody(e == asio::error::eof ? BoostError(http::error::partial_message) : e);
  });
}

void HttpSession::onWhole() {
  request_.body = std::move(parser_->get().body());
  if (body_sha256_) request_.body_sha256 = body_sha256_->finish();
  hub_->counters().upload_bytes += request_.body.size();
  stream_.expires_never();
  asked_ = true;
  gone_ = std::stop_source();
  request_.session = session_;
  request_.gone = gone_.get_token();
  watchPresence();
  hub_->hold(shared_from_this());
  respond(hub_, std::move(request_), [weak = weak_from_this()](HttpResponse response) {
    const auto self = weak.lock();
    if (self == nullptr) return;
    asio::post(self->executor_, [self, response = std::move(response)]() mutable {
      self->hub_->letGo(self);
      self->send(std::move(response), false);
    });
  });
}

void HttpSession::send(HttpResponse response, bool close) {
  asked_ = false;
  presence_.cancel();
  (void)room_.hold(0);
  response_ = std::move(response);
  const auto size = response_.bytes ? response_.bytes->size() : 0;
  if (size > kSmallBody && !head_ && !going_.hold(response_.bytes.get(), size))
    response_ = errorResponse({ErrorCode::kBusy, "other downloads take all the room there is; try again", {}});
  const auto kind = static_cast<std::size_t>(response_.status / 100);
  ++hub_->counters().http_responses.at(std::min<std::size_t>(kind, 5));
  prepare(close || !keep_alive_ || hub_->draining());
  pace_.start(hub_->options().idle_timeout);
  serializer_.emplace(*message_);
  if (head_) serializer_->split(true);
  writeSome(0);
}

void HttpSession::prepare(bool close) {
  const auto* data = response_.bytes ? reinterpret_cast<const char*>(response_.bytes->data()) : response_.text.data();
  const auto size = response_.bytes ? response_.bytes->size() : response_.text.size();
  message_.emplace();
  auto& m = *message_;
  m.version(11);
  m.result(static_cast<unsigned>(response_.status));
  m.keep_alive(!close);
  m.body() = beast::span<const char>(data, size);
  if (response_.status != 204 && response_.status != 304) m.content_length(size);
  m.set(http::field::date, httpDate());
  m.set(http::field::server, "radiosityd/" + hub_->options().version);
  if (size > 0) m.set(http::field::content_type, response_.content_type);
  m.set(http::field::cache_control, "no-store");
  m.set("X-Content-Type-Options", "nosniff");
  if (!origin_.empty() && originListed(origin_, hub_->options())) {
    m.set(http::field::access_control_allow_origin, origin_);
    m.set(http::field::vary, "Origin");
    m.set(http::field::access_control_allow_methods, "GET, HEAD, PUT, OPTIONS");
    m.set(http::field::access_control_allow_headers, "Authorization, Content-Type, X-Client, X-Name");
    m.set(http::field::access_control_expose_headers, "Location, Retry-After, X-Revision");
  }
  for (const auto& [name, value] : response_.headers) m.set(name, value);
}

/// `moved`: bytes that were taken since the last time.
void HttpSession::writeSome(std::size_t moved) {
  if (serializer_->is_done() || (head_ && serializer_->is_header_done())) return onWritten();
  stream_.expires_after(pace_.moved(moved));
  http::async_write_some(stream_, *serializer_, [self = shared_from_this()](BoostError error, std::size_t n) {
    if (error) return self->stream_.close();
    self->moved_bytes_ += n;
    self->writeSome(n);
  });
}

void HttpSession::onWritten() {
  const bool keep = message_->keep_alive();
  serializer_.reset();
  message_.reset();
  going_.release();
  response_ = {};
  if (keep) return readHeader();
  stream_.expires_after(hub_->options().close_patience);
  stream_.endSending(AnyHandler([self = shared_from_this()](BoostError) {
    BoostError ignored;
    self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    self->linger();
  }));
}

/// Closing with unread bytes would reset the connection and take the response away from the client. What comes is
/// dropped as it is, deciphered or not.
void HttpSession::linger() {
  if (lingered_ == 0) stream_.expires_after(hub_->options().close_patience);
  buffer_.clear();
  stream_.next_layer().async_read_some(buffer_.prepare(kBufferLimit),
                                       [self = shared_from_this()](BoostError error, std::size_t n) {
                                         self->lingered_ += n;
                                         if (error || self->lingered_ > kLingerBytes) return self->stream_.close();
                                         self->linger();
                                       });
}

/// While the engine makes the answer nothing is read, so that only this finds out that nobody waits for it any more.
void HttpSession::watchPresence() {
  presence_.expires_after(kPresenceInterval);
  presence_.async_wait([weak = weak_from_this()](BoostError error) {
    const auto self = weak.lock();
    if (error || self == nullptr || !self->asked_) return;
    if (hasLeft(self->stream_.socket().native_handle())) return (void)self->gone_.request_stop();
    self->watchPresence();
  });
}

/// While the server drains: a peer that neither sends nor takes anything is not waited for.
void HttpSession::cutWhenStalled() {
  stall_.expires_after(hub_->options().drain_patience);
  stall_.async_wait([weak = weak_from_this(), before = moved_bytes_](BoostError error) {
    const auto self = weak.lock();
    if (error || self == nullptr) return;
    if (!self->asked_ && self->moved_bytes_ == before) return self->stream_.close();
    self->cutWhenStalled();
  });
}

}  // namespace

void serveHttp(Stream stream, std::shared_ptr<Hub> hub, ConnectionSlot slot) {
  std::make_shared<HttpSession>(std::move(stream), std::move(hub), std::move(slot))->start();
}

}  // namespace radiosity::net
