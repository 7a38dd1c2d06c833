// The least rate of a peer that sends or takes a body. Every pause alone would let one that drips a byte now and then
// hold its part of the memory for ever.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace radiosity::net {

class Pace {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Pace(std::size_t least_bytes_per_second) : least_(static_cast<double>(least_bytes_per_second)) {}

  /// The peer may be late by `slack` in all.
  void start(Clock::duration slack, Clock::time_point now = Clock::now()) {
    slack_ = slack;
    until_ = now + slack;
  }
  /// How long the next bytes may take, now that these have come: the least rate's bytes earn a second, and nobody
  /// has more than the slack.
  [[nodiscard]] Clock::duration moved(std::size_t bytes, Clock::time_point now = Clock::now()) {
    const std::chrono::duration<double> earned(static_cast<double>(bytes) / least_);
    until_ = std::min(until_ + std::chrono::duration_cast<Clock::duration>(earned), now + slack_);
    return std::max(until_ - now, Clock::duration::zero());
  }

 private:
  double least_;
  Clock::duration slack_{};
  Clock::time_point until_;
};

}  // namespace radiosity::net
