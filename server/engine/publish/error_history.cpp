#include "server/engine/publish/error_history.h"

namespace radiosity::engine {

void ErrorHistory::add(double seconds, const ErrorEstimate& error) {
  if (!samples_.empty() && seconds < samples_.back().seconds) samples_.clear();
  if (!(seconds > 0.0)) return;
  if (!samples_.empty() && seconds == samples_.back().seconds) {
    samples_.back().error = error;
    return;
  }
  samples_.push_back({seconds, error});
  if (samples_.size() > kErrorSamples) leaveOneOut();
}

/// Ratios of times are ordered as the differences of their logarithms.
void ErrorHistory::leaveOneOut() {
  std::size_t nearest = 1;
  const auto ratio = [&](std::size_t i) { return samples_[i + 1].seconds / samples_[i - 1].seconds; };
  for (std::size_t i = 2; i + 1 < samples_.size(); ++i) {
    if (ratio(i) < ratio(nearest)) nearest = i;
  }
  samples_.erase(samples_.begin() + static_cast<std::ptrdiff_t>(nearest));
}

}  // namespace radiosity::engine
