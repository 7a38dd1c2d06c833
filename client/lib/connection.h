// A WebSocket connection to radiosityd, speaking radiosity.v1: calls with time limits, notifications and tiles.
// Owned and used by one thread; blocking. Notifications and tiles that arrive are handed to the callbacks from inside
// call() and poll(), on the caller's thread, so nothing here needs a lock. Callbacks must not call back into the
// connection.
//
//   auto connection = Connection::open({.url = *parseServerUrl("127.0.0.1:8765"), .client = "mine"});
//   auto status = connection->call(protocol::StatusCall{});
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "client/lib/server_url.h"
#include "client/lib/tls.h"
#include "common/result.h"
#include "protocol/codec.h"
#include "protocol/messages.h"
#include "protocol/tile_frame.h"

namespace radiosity::client {

struct ConnectionOptions {
  ServerUrl url;
  TlsTrust trust = {};
  std::string client = "radiosity";  ///< who we are, shown to others beside our edits
  std::string token = {};            ///< empty: none
  /// Asked at least every 50 ms of any wait; false abandons it with kUnavailable "interrupted".
  std::function<bool()> keep_going = {};
  std::int64_t credit_bytes = protocol::kDefaultCreditBytes;  ///< tiles in flight
  std::chrono::milliseconds timeout{10'000};                  ///< connecting and handshake together
};

/// Why a call failed. With `rpc` the server answered an error; without, there was no answer.
struct CallFailure {
  Error error;
  std::optional<protocol::RpcError> rpc = {};
};

template <typename T>
using CallResult = tl::expected<T, CallFailure>;

class Connection {
 public:
  using NotificationHandler = std::function<void(const protocol::Notification&)>;
  using TileHandler = std::function<void(const protocol::Tile&)>;

  /// Connects, waits for serverInfo and says hello. Errors: nobody listens, not a radiosityd, wrong token.
  [[nodiscard]] static CallResult<Connection> open(ConnectionOptions options);

  Connection(Connection&&) noexcept;
  Connection& operator=(Connection&&) noexcept;
  ~Connection();

  [[nodiscard]] const protocol::ServerInfo& serverInfo() const;
  [[nodiscard]] const protocol::HelloReply& hello() const;

  void onNotification(NotificationHandler handler);
  /// Tiles come after a SubscribeCall. The credit of a tile goes back to the server once its handler has returned; a
  /// frame that does not decode ends the connection.
  void onTile(TileHandler handler);

  /// Sends the call and waits for its reply, at most `timeout`.
  template <typename CallType>
  [[nodiscard]] CallResult<typename CallType::Reply> call(const CallType& message,
                                                          std::chrono::milliseconds timeout = kCallTimeout) {
    auto result = exchange(protocol::Call(message), CallType::kMethod, timeout);
    if (!result) return tl::unexpected(result.error());
    auto reply = protocol::decodeReply<typename CallType::Reply>(**result);
    if (!reply) return tl::unexpected(CallFailure{reply.error()});
    return *reply;
  }

  /// Handles whatever arrives within `duration`; returns early once something was handled. Fails where the connection
  /// is gone.
  [[nodiscard]] Result<void> poll(std::chrono::milliseconds duration);

  static constexpr std::chrono::milliseconds kCallTimeout{30'000};

 private:
  struct Impl;
  explicit Connection(std::unique_ptr<Impl> impl);
  [[nodiscard]] CallResult<protocol::JsonPtr> exchange(const protocol::Call& call, std::string_view method,
                                                       std::chrono::milliseconds timeout);

  std::unique_ptr<Impl> impl_;
};

/// Waits between attempts to connect again: doubles from 0.25 s to 8 s, each with random parts so that many clients of
/// one server do not come back all at once.
class BackOff {
 public:
  [[nodiscard]] std::chrono::milliseconds next();
  void reset() { attempts_ = 0; }

 private:
  unsigned attempts_ = 0;
};

}  // namespace radiosity::client
