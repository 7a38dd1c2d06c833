// HTTP transfers with the server: one connection a call, streamed to and from files. Blocking, on the caller's thread;
// `keep_going` is asked at least every 50 ms, so that a caller can stop any wait at once.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "client/lib/atomic_file.h"
#include "client/lib/server_url.h"
#include "client/lib/tls.h"
#include "common/result.h"

namespace radiosity::client {

/// Called while waiting; false abandons the call, which then fails with kUnavailable "interrupted".
using KeepGoing = std::function<bool()>;

/// Bytes so far and in all (0: not known), for a progress line.
using TransferProgress = std::function<void(std::uint64_t done_bytes, std::uint64_t total_bytes)>;

struct HttpOptions {
  ServerUrl url;
  TlsTrust trust = {};
  std::string token;  ///< sent as "Authorization: Bearer"; empty: none
  KeepGoing keep_going = {};
  TransferProgress progress = {};
  std::chrono::milliseconds connect_timeout{10'000};
  /// Longest wait without a byte moving; generous, since a big scene takes its time to load or to be packed.
  std::chrono::milliseconds silence_timeout{600'000};
};

/// An answer whatever its status; a Result's error means that there was no answer.
struct HttpReply {
  unsigned status = 0;
  std::string content_type;
  std::string body;  ///< at most kMaxReplyBytes; empty where it went to a file

  [[nodiscard]] bool ok() const { return status >= 200 && status < 300; }
};

inline constexpr std::uint64_t kMaxReplyBytes = 16U << 20U;

[[nodiscard]] Result<HttpReply> httpGet(const HttpOptions& options, std::string_view path);

/// A 2xx body goes to `file` (not committed); any other body stays in the reply. A short body is an error.
[[nodiscard]] Result<HttpReply> httpGetToFile(const HttpOptions& options, std::string_view path, AtomicFile& file);

[[nodiscard]] Result<HttpReply> httpPutFile(const HttpOptions& options, std::string_view path,
                                            std::string_view content_type, const std::string& file);
[[nodiscard]] Result<HttpReply> httpPutText(const HttpOptions& options, std::string_view path,
                                            std::string_view content_type, std::string body);

}  // namespace radiosity::client
