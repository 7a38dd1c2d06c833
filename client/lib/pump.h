// Private to client/lib: runs one asynchronous operation as if it were a blocking one, with a time limit and a caller
// that may want to stop. Everything happens on the caller's thread.
#pragma once

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "client/lib/server_url.h"
#include "common/result.h"

namespace radiosity::client::detail {

using Clock = std::chrono::steady_clock;

class Pump {
 public:
  explicit Pump(std::function<bool()> keep_going) : keep_going_(std::move(keep_going)) {}

  boost::asio::io_context& context() { return context_; }
  [[nodiscard]] bool interrupted() const { return interrupted_; }

  /// Runs handlers until `done()`, `deadline` or an interruption; true where done.
  bool runUntil(const std::function<bool()>& done, Clock::time_point deadline) {
    constexpr std::chrono::milliseconds kSlice{50};
    while (!done()) {
      if (keep_going_ && !keep_going_()) {
        interrupted_ = true;
        return false;
      }
      if (context_.stopped()) context_.restart();
      const auto left = deadline - Clock::now();
      context_.run_one_for(std::clamp<Clock::duration>(left, Clock::duration::zero(), kSlice));
      if (left <= Clock::duration::zero()) return done();
    }
    return true;
  }

  /// `start(handler)` begins an operation on `stream`; handler takes an error code (and anything more). On time-out or
  /// interruption the stream is closed and the operation waited for, since its buffers must not go before it ends.
  template <typename Stream, typename Start>
  boost::beast::error_code await(Stream& stream, Clock::duration timeout, Start&& start) {
    std::optional<boost::beast::error_code> outcome;
    start([&outcome](boost::beast::error_code error, auto&&...) { outcome = error; });
    if (runUntil([&outcome] { return outcome.has_value(); }, Clock::now() + timeout)) return *outcome;
    boost::beast::error_code ignored;
    boost::beast::get_lowest_layer(stream).socket().close(ignored);
    while (!outcome) {
      if (context_.stopped()) context_.restart();
      context_.run_one();
    }
    return interrupted_ ? boost::beast::error_code(boost::asio::error::interrupted)
                        : boost::beast::error_code(boost::beast::error::timeout);
  }

 private:
  boost::asio::io_context context_{1};
  std::function<bool()> keep_going_;
  bool interrupted_ = false;
};

/// Resolves and connects. Errors say what to check.
[[nodiscard]] Result<void> connectTo(Pump& pump, boost::beast::tcp_stream& stream, const ServerUrl& url,
                                     Clock::duration timeout);

/// One sentence for a failed transfer.
[[nodiscard]] Error transferError(const boost::beast::error_code& error, const ServerUrl& url,
                                  const std::string& doing);

}  // namespace radiosity::client::detail
