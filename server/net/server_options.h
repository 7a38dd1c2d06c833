// What the network side can be told. Plain values, set before the server opens; server/options.cpp fills them from the
// command line, tests shorten the times.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "protocol/limits.h"
#include "server/state/uploads.h"

namespace radiosity::net {

/// Bodies of the largest size (max_upload_bytes) that there is room for, coming, and as many going.
inline constexpr std::uint64_t kBodiesAtATime = 2;

struct ServerOptions {
  std::string address = "127.0.0.1";       ///< IP address, no name
  std::uint16_t port = 8765;               ///< 0: any free one
  std::string token;                       ///< empty: none needed
  bool insecure = false;                   ///< allow another than a loopback address without a token
  std::filesystem::path tls_certificate;   ///< PEM; with it and the key only TLS is spoken
  std::filesystem::path tls_key;           ///< PEM, not encrypted
  std::vector<std::string> allow_origins;  ///< "https://viewer.example.org", beside the server's own
  std::filesystem::path scene_root;        ///< empty: no server-side files
  std::size_t max_upload_bytes = protocol::kMaxUploadBytes;
  std::size_t max_clients = protocol::kMaxClients;
  int threads = 2;
  std::string version = "0.0.0";
  std::shared_ptr<state::Uploads> uploads;  ///< null: uploads do not outlive the server

  std::chrono::milliseconds handshake_timeout{10'000};  ///< of TLS, from the first byte to the last
  std::chrono::milliseconds hello_timeout{protocol::kHelloTimeoutMs};
  std::chrono::milliseconds write_deadline{protocol::kWriteDeadlineMs};
  std::chrono::milliseconds close_patience{2'000};   ///< for the closing handshake, then the socket is cut
  std::chrono::milliseconds header_timeout{10'000};  ///< for a whole HTTP header
  std::chrono::milliseconds idle_timeout{30'000};    ///< of a kept-alive connection, in a body, pings
  std::size_t least_bytes_per_second = 64 * 1024;    ///< of a body, either way; idle_timeout is for all of its pauses
  std::chrono::milliseconds progress_interval{100};  ///< at least this between two progress notifications
  std::chrono::milliseconds drain_grace{5'000};      ///< for what is under way when the server stops
  std::chrono::milliseconds drain_patience{1'000};   ///< then: for a peer that takes nothing, or does not close
};

}  // namespace radiosity::net
