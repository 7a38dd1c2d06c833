#include "server/net/websocket_session.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/post.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/log.h"
#include "server/net/calls.h"
#include "server/net/convert.h"
#include "server/net/session_timers.h"
#include "server/net/tile_lane.h"

namespace radiosity::net {
namespace {

namespace websocket = boost::beast::websocket;
using Clock = std::chrono::steady_clock;
using protocol::CloseCode;

constexpr double kLongestPauseSeconds = 1e9;  ///< between two versions, at the lowest rate; a clock counts further
constexpr const char* kDrainReason = "the server is shutting down";
constexpr int kSendBufferBytes = 512 * 1024;  ///< more would only make tiles older before they arrive

class WebSocketSession final : public Peer, public Connection, public std::enable_shared_from_this<WebSocketSession> {
 public:
  WebSocketSession(Stream stream, std::shared_ptr<Hub> hub, ConnectionSlot slot)
      : ws_(std::move(stream)),
        hub_(std::move(hub)),
        slot_(std::move(slot)),
        deadline_(ws_.get_executor()),
        cut_(ws_.get_executor()),
        timers_(ws_.get_executor()) {}

  void start(Upgrade upgrade, bool authenticated);

  // Any thread.
  void sendText(SharedText text) override;
  void sendMissed(std::vector<SharedText> texts) override;
  void sendProgress(SharedText text) override;
  void lightmapsChanged() override;
  void camerasChanged() override;
  void drain() override;

  void forget(Timer timer) override;
  void answered() override;

  // On the strand.
  Timer later(std::chrono::milliseconds delay, std::function<void()> task) override {
    return timers_.start(weak_from_this(), delay, std::move(task));
  }
  void greeted() override { greeted_ = true; }
  void tilesWanted() override { pump(); }
  void subscribed() override;
  void closeAfterWrites(CloseCode code, std::string reason) override;

 private:
  void configure();
  void onAccepted(BoostError error);
  void read();
  void onRead(BoostError error);
  void onStrand(std::function<void(WebSocketSession&)> task);
  void enqueue(SharedText text, bool counts = true);
  void cutAfter(std::chrono::milliseconds patience);
  void adoptLightmaps();
  void tellCameras();
  void pump();
  void writeText(SharedText text);
  void writeTile(OutgoingTile tile);
  void startDeadline();
  void onWritten(BoostError error, bool tile);
  void close(CloseCode code, const std::string& reason);
  void cut();

  websocket::stream<Stream, false> ws_;
  std::shared_ptr<Hub> hub_;
  ConnectionSlot slot_;
  Upgrade upgrade_;
  beast::flat_buffer buffer_;
  TileLane tiles_;
  std::optional<Calls> calls_;
  bool accepted_ = false;  ///< the upgrade is answered: frames may be written
  bool greeted_ = false;

  struct Waiting {
    SharedText text;
    bool counts;  ///< against the limits of the control lane
  };
  std::deque<Waiting> control_;  ///< not yet given to the socket
  std::size_t control_messages_ = 0, control_bytes_ = 0;
  SharedText progress_, cameras_;  ///< the newest; older ones were not worth sending
  SharedText writing_text_;
  std::optional<OutgoingTile> writing_tile_;
  bool writing_ = false, closing_ = false, draining_ = false;
  std::uint64_t write_number_ = 0;
  std::optional<std::pair<CloseCode, std::string>> close_when_written_;
  asio::steady_timer deadline_, cut_;
  SessionTimers timers_;

  std::shared_ptr<void> watching_;  ///< keeps the quantity subscribed to coming
  std::atomic<bool> lightmaps_posted_{false}, cameras_posted_{false};
  std::optional<Timer> adoption_;  ///< of newer lightmaps, once the rate asked for allows it
  Clock::time_point next_adoption_, next_cameras_;
};

// ---- coming ----

void WebSocketSession::configure() {
  const auto& options = hub_->options();
  websocket::stream_base::timeout times{};
  times.handshake_timeout = options.header_timeout;
  times.idle_timeout = options.idle_timeout;
  times.keep_alive_pings = true;
  ws_.set_option(times);
  websocket::permessage_deflate off;
  off.server_enable = false;
  ws_.set_option(off);
  ws_.set_option(websocket::stream_base::decorator([version = options.version](websocket::response_type& response) {
    response.set(http::field::server, "radiosityd/" + version);
    response.set(http::field::sec_websocket_protocol, protocol::kSubprotocol);
  }));
  ws_.read_message_max(protocol::kMaxMessageBytes);
  ws_.auto_fragment(false);  // a tile is one frame
  BoostError ignored;
  auto& socket = beast::get_lowest_layer(ws_).socket();
  socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
}

void WebSocketSession::start(Upgrade upgrade, bool authenticated) {
  upgrade_ = std::move(upgrade);
  calls_.emplace(*hub_, weak_from_this(), tiles_, authenticated);
  hub_->add(weak_from_this());
  configure();
  ws_.async_accept(upgrade_, [self = shared_from_this()](BoostError error) { self->onAccepted(error); });
  if (hub_->draining()) drain();  // it may have begun after the request was read, and before this was added
}

void WebSocketSession::onAccepted(BoostError error) {
  if (error) return cut();
  accepted_ = true;
  upgrade_ = {};
  enqueue(std::make_shared<const std::string>(protocol::encodeNotification(hub_->serverInfo())));
  (void)later(hub_->options().hello_timeout, [this] {
    if (!greeted_) closeAfterWrites(CloseCode::kPolicy, "hello did not come in time");
  });
  read();
}

void WebSocketSession::read() {
  ws_.async_read(buffer_, [self = shared_from_this()](BoostError error, std::size_t) { self->onRead(error); });
}

void WebSocketSession::onRead(BoostError error) {
  if (error) {
    hub_->leave(*this);
    return cut();
  }
  if (closing_ || close_when_written_) {  // whatever still comes is read for the sake of the close frame only
    buffer_.consume(buffer_.size());
    return read();
  }
  if (ws_.got_binary()) {
    closeAfterWrites(CloseCode::kBadData, "only text frames are understood");
  } else {
    const auto data = buffer_.cdata();
    calls_->handle({static_cast<const char*>(data.data()), data.size()});
  }
  buffer_.consume(buffer_.size());
  read();
}

// ---- from other threads ----

void WebSocketSession::onStrand(std::function<void(WebSocketSession&)> task) {
  asio::post(ws_.get_executor(), [self = shared_from_this(), task = std::move(task)] { task(*self); });
}

void WebSocketSession::sendText(SharedText text) {
  onStrand([text = std::move(text)](WebSocketSession& s) { s.enqueue(text); });
}

void WebSocketSession::sendMissed(std::vector<SharedText> texts) {
  onStrand([texts = std::move(texts)](WebSocketSession& s) {
    for (const auto& text : texts) s.enqueue(text, false);
  });
}

void WebSocketSession::sendProgress(SharedText text) {
  onStrand([text = std::move(text)](WebSocketSession& s) {
    s.progress_ = text;
    s.pump();
  });
}

void WebSocketSession::lightmapsChanged() {
  if (lightmaps_posted_.exchange(true)) return;  // one visit sees the newest
  onStrand([](WebSocketSession& s) { s.adoptLightmaps(); });
}

void WebSocketSession::camerasChanged() {
  if (cameras_posted_.exchange(true)) return;
  onStrand([](WebSocketSession& s) {
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(s.next_cameras_ - Clock::now());
    if (wait.count() <= 0) return s.tellCameras();
    (void)s.later(wait, [&s] { s.tellCameras(); });
  });
}

/// Answers that are under way, of edits say, go before the end: for half of the time, since the rest is for closing. A
/// peer that does not read would hold the server up for as long as a write may take; what the system has taken of our
/// bytes still reaches it after the socket is closed.
void WebSocketSession::drain() {
  onStrand([](WebSocketSession& s) {
    if (std::exchange(s.draining_, true)) return;
    const auto patience = s.hub_->options().drain_patience;
    s.cutAfter(patience);
    (void)s.later(patience / 2, [&s] { s.closeAfterWrites(CloseCode::kGoingAway, kDrainReason); });
    s.pump();
  });
}

void WebSocketSession::answered() {
  if (hub_->draining()) onStrand([](WebSocketSession& s) { s.pump(); });
}

void WebSocketSession::forget(Timer timer) {
  onStrand([timer](WebSocketSession& s) { s.timers_.cancel(timer); });
}

// ---- lanes ----

/// `counts`: against what may wait. What a client has missed does not: it is bounded by itself, shared by all, and
/// comes in one piece, so that nobody could have read any of it yet.
void WebSocketSession::enqueue(SharedText text, bool counts) {
  if (closing_) return;
  const bool full = control_messages_ >= protocol::kControlLaneMessages ||
                    (control_messages_ > 0 && control_bytes_ + text->size() > protocol::kControlLaneBytes);
  if (counts && full) {
    ++hub_->counters().closed_overload;
    return close(CloseCode::kOverload, "messages are not read");
  }
  if (counts) {
    ++control_messages_;
    control_bytes_ += text->size();
  }
  control_.push_back({std::move(text), counts});
  pump();
}

/// What is new to the subscription comes at once, whatever rate was asked for.
void WebSocketSession::subscribed() {
  watching_ = hub_->watch(toQuantity(tiles_.quantity()));
  next_adoption_ = {};
  if (adoption_) timers_.cancel(*std::exchange(adoption_, std::nullopt));  // its time is that of the rate before
  lightmapsChanged();
}

void WebSocketSession::adoptLightmaps() {
  lightmaps_posted_ = false;
  if (!tiles_.subscribed() || closing_) return;
  const auto lightmaps = hub_->lightmaps(toQuantity(tiles_.quantity()));
  if (lightmaps == nullptr) return pump();  // the first are still to come, and do not wait for the rate
  const auto now = Clock::now();
  if (now < next_adoption_ && tiles_.sendFrom(lightmaps)) {
    if (adoption_) return;
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next_adoption_ - now);
    adoption_ = later(wait, [this] {
      adoption_.reset();
      adoptLightmaps();
    });
    return;
  }
  if (tiles_.maxHz() > 0.0) {
    const std::chrono::duration<double> pause(std::min(1.0 / tiles_.maxHz(), kLongestPauseSeconds));
    next_adoption_ = now + std::chrono::duration_cast<Clock::duration>(pause);
  }
  if (tiles_.setLightmaps(lightmaps))
    enqueue(std::make_shared<const std::string>(protocol::encodeNotification(toLightmapsNote(*lightmaps))));
  pump();
}

void WebSocketSession::tellCameras() {
  cameras_posted_ = false;  // what changes from here on asks for another visit
  next_cameras_ = Clock::now() + std::chrono::milliseconds(protocol::kCamerasIntervalMs);
  cameras_ = hub_->cameras().noteFor(*this);
  pump();
}

void WebSocketSession::pump() {
  if (!accepted_ || writing_ || closing_) return;
  if (!control_.empty()) {
    auto [text, counts] = std::move(control_.front());
    control_.pop_front();
    if (counts) {
      --control_messages_;
      control_bytes_ -= text->size();
    }
    return writeText(std::move(text));
  }
  if (close_when_written_) return close(close_when_written_->first, close_when_written_->second);
  if (draining_ && !calls_->answersAwaited()) return close(CloseCode::kGoingAway, kDrainReason);
  if (!greeted_) return;
  if (progress_) return writeText(std::exchange(progress_, nullptr));
  if (cameras_) return writeText(std::exchange(cameras_, nullptr));
  if (auto tile = tiles_.next(hub_->tiles())) return writeTile(std::move(*tile));
  if (const auto bookmark = tiles_.takeBookmark())
    writeText(std::make_shared<const std::string>(protocol::encodeNotification(*bookmark)));
}

void WebSocketSession::writeText(SharedText text) {
  writing_text_ = std::move(text);
  ws_.text(true);
  startDeadline();
  ws_.async_write(asio::buffer(*writing_text_),
                  [self = shared_from_this()](BoostError error, std::size_t) { self->onWritten(error, false); });
}

void WebSocketSession::writeTile(OutgoingTile tile) {
  writing_tile_ = std::move(tile);
  ws_.binary(true);
  startDeadline();
  const std::array<asio::const_buffer, 2> parts = {asio::buffer(writing_tile_->header),
                                                   asio::buffer(writing_tile_->pixels->payload)};
  ws_.async_write(parts, [self = shared_from_this()](BoostError error, std::size_t) { self->onWritten(error, true); });
}

void WebSocketSession::startDeadline() {
  writing_ = true;
  const auto number = ++write_number_;
  deadline_.expires_after(hub_->options().write_deadline);
  deadline_.async_wait([weak = weak_from_this(), number](BoostError error) {
    const auto self = weak.lock();
    if (error || self == nullptr || !self->writing_ || self->write_number_ != number) return;
    ++self->hub_->counters().closed_too_slow;
    self->close(CloseCode::kTooSlow, "a message was not taken in time");
  });
}

void WebSocketSession::onWritten(BoostError error, bool tile) {
  deadline_.cancel();
  writing_ = false;
  if (error) return cut();
  auto& counters = hub_->counters();
  if (tile) {
    ++counters.tiles_sent;
    counters.tile_bytes_sent += writing_tile_->bytes();
    writing_tile_.reset();
  } else {
    ++counters.text_messages_sent;
    counters.text_bytes_sent += writing_text_->size();
    writing_text_.reset();
  }
  pump();
}

// ---- going ----

/// Posted, so that it takes its place behind answers that were sent before.
void WebSocketSession::closeAfterWrites(CloseCode code, std::string reason) {
  onStrand([code, reason = std::move(reason)](WebSocketSession& s) {
    if (s.close_when_written_ || s.closing_) return;
    if (code == CloseCode::kPolicy) ++s.hub_->counters().closed_policy;
    s.close_when_written_.emplace(code, reason);
    s.pump();
  });
}

/// Asks for the closing handshake; a peer that does not take part is cut off. Behind a write that hangs the close frame
/// waits its turn, so a peer that reads again in time still learns why.
void WebSocketSession::close(CloseCode code, const std::string& reason) {
  if (std::exchange(closing_, true)) return;
  hub_->leave(*this);
  if (calls_) calls_->end();
  watching_.reset();
  control_.clear();
  if (!draining_) cutAfter(hub_->options().close_patience);
  const websocket::close_reason why(static_cast<websocket::close_code>(code), reason);
  ws_.async_close(why, [self = shared_from_this()](BoostError) { self->cut(); });
}

void WebSocketSession::cutAfter(std::chrono::milliseconds patience) {
  cut_.expires_after(patience);
  cut_.async_wait([weak = weak_from_this()](BoostError error) {
    const auto self = weak.lock();
    if (self == nullptr || error) return;
    BoostError ignored;
    // What it did not read in all this time is given up, so that the system does not keep it either.
    if (!self->draining_)
      beast::get_lowest_layer(self->ws_).socket().set_option(asio::socket_base::linger(true, 0), ignored);
    self->cut();
  });
}

void WebSocketSession::cut() {
  closing_ = true;
  if (calls_) calls_->end();
  watching_.reset();
  hub_->leave(*this);
  deadline_.cancel();
  cut_.cancel();
  timers_.cancelAll();
  beast::get_lowest_layer(ws_).close();
}

}  // namespace

void serveWebSocket(Stream stream, Upgrade upgrade, std::shared_ptr<Hub> hub, ConnectionSlot slot, bool authenticated) {
  const auto executor = stream.get_executor();
  auto session = std::make_shared<WebSocketSession>(std::move(stream), std::move(hub), std::move(slot));
  asio::post(executor, [session, upgrade = std::move(upgrade), authenticated]() mutable {
    session->start(std::move(upgrade), authenticated);
  });
}

}  // namespace radiosity::net
