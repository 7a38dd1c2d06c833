// Clients for the tests: a WebSocket that speaks radiosity.v1, and HTTP as raw bytes, both blocking with a time limit.
// Beast stays in test_client.cpp.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/bytes.h"
#include "protocol/codec.h"

namespace radiosity::testing {

using Seconds = std::chrono::duration<double>;

struct Upgraded {
  std::string origin = {}, authorization = {}, host = {};
  std::string subprotocol = "radiosity.v1";
  int receive_buffer_bytes = 0;  ///< 0: the system's
};

class TestSocket {
 public:
  /// Connects and upgrades; `status()` is 101 when that went well.
  TestSocket(std::uint16_t port, const Upgraded& how = {});
  ~TestSocket();
  TestSocket(TestSocket&&) noexcept;

  [[nodiscard]] int status() const;
  void sendText(std::string_view text);
  void sendBinary(std::string_view bytes);
  /// Bytes on the wire below the WebSocket protocol.
  void sendRaw(std::string_view bytes);
  void close();

  struct Message {
    bool binary = false;
    Bytes bytes;
    [[nodiscard]] std::string text() const { return {bytes.begin(), bytes.end()}; }
  };
  /// The next message; nothing when the connection has ended (see closeCode) or `limit` has passed.
  std::optional<Message> read(Seconds limit = Seconds(20));
  [[nodiscard]] int closeCode() const;  ///< 0: none received
  [[nodiscard]] bool ended() const;

  // ---- a level higher ----
  /// Sends the call and reads until its answer; other text messages go to `notes`, binary ones to `tiles`.
  protocol::RpcResponse call(const protocol::Call& call);
  protocol::RpcResponse hello(std::string token = {}, std::vector<protocol::PixelFormat> formats = {},
                              std::int64_t credit = protocol::kDefaultCreditBytes);
  /// Reads until a notification of this method has come (or was kept before) and takes it out of `notes`.
  std::optional<protocol::RpcRequest> waitFor(std::string_view method, Seconds limit = Seconds(20));
  std::optional<Bytes> nextTile(Seconds limit = Seconds(20));

  std::vector<protocol::RpcRequest> notes;
  std::vector<Bytes> tiles;

 private:
  void keep(const Message& message);
  struct State;
  std::unique_ptr<State> state_;
};

struct RawResponse {
  int status = 0;
  std::string head, body;
  [[nodiscard]] std::string header(std::string_view name) const;  ///< "" when absent
};

/// A TCP connection to send anything over.
class RawHttp {
 public:
  explicit RawHttp(std::uint16_t port);
  ~RawHttp();
  void send(std::string_view bytes);
  /// One response, body by Content-Length. `head_only`: the answer of a HEAD. Status 0: the connection ended.
  RawResponse receive(bool head_only = false, Seconds limit = Seconds(20));
  /// Takes what has come, or comes first, but no more than 64 KiB; returns how much, 0 at the end or the limit.
  std::size_t readSome(Seconds limit);
  /// True when the other side closes within the limit.
  bool closed(Seconds limit);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// One request on its own connection; a body gets its Content-Length.
RawResponse request(std::uint16_t port, std::string_view method, std::string_view target, std::string_view headers = {},
                    std::string_view body = {});

}  // namespace radiosity::testing
