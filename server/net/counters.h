// What the server has done since it started; shown by /metrics. Any thread.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace radiosity::net {

struct Counters {
  using Count = std::atomic<std::uint64_t>;
  Count connections{0};  ///< open now, HTTP and WebSocket
  Count connections_refused{0};
  Count tls_handshakes{0};  ///< under way now
  Count tls_handshakes_failed{0};
  std::atomic<std::int64_t> certificate_expires_at_s{0};  ///< since 1970-01-01 UTC; 0: no TLS
  std::array<Count, 6> http_responses{};                  ///< by first digit of the status
  Count upload_bytes{0};
  Count uploads_held_bytes{0};  ///< of bodies that are coming, or being worked on
  Count calls{0}, calls_failed{0};
  Count text_messages_sent{0}, text_bytes_sent{0};
  Count tiles_sent{0}, tile_bytes_sent{0};
  Count closed_too_slow{0}, closed_overload{0}, closed_policy{0};
};

}  // namespace radiosity::net
