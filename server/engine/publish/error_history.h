// How the error of the present solve has fallen, so that who comes late can see it. A plain value; owned by the solve
// loop, which guards it.
#pragma once

#include <cstddef>
#include <vector>

#include "server/engine/engine.h"

namespace radiosity::engine {

class ErrorHistory {
 public:
  /// Takes a sample at so many seconds of solve time, above 0. Where time runs backwards a new solve has begun, and
  /// what was before is forgotten; at the same time the newer sample counts. O(kErrorSamples).
  ///
  /// Where there are more than kErrorSamples the one whose neighbours are nearest to each other, in the logarithm of
  /// time, is left out; the first and the last stay. So no gap that this leaves is wider than 2 / (kErrorSamples - 1)
  /// of the whole, from first to last: the mean gap between every second sample.
  void add(double seconds, const ErrorEstimate& error);

  [[nodiscard]] const std::vector<ErrorSample>& samples() const { return samples_; }  ///< seconds ascending

 private:
  void leaveOneOut();

  std::vector<ErrorSample> samples_;
};

}  // namespace radiosity::engine
