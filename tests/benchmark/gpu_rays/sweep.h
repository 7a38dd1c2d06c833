// What a solve on a card needs besides rays: sweeps of the equation over kept hits, and waiting for an answer.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/gpu/gl/egl_context.h"

namespace radiosity::benchmarks {

struct SweepTimes {
  std::size_t leaves = 0;
  std::uint32_t hits = 0, group = 0;  ///< of each leaf; threads
  bool transposed = false;
  double seconds = 0.0;         ///< of one sweep, of ten in a row
  double bytes = 0.0;           ///< that one reads and writes: hits, light at their ends, and what a leaf has
  double greatest_error = 0.0;  ///< of what was reckoned in double precision, of the largest
};

/// Over `of_each` hits of each leaf, leaf after leaf (RayScene::leafHits); `copies`: of each leaf so many, whose rays
/// end on any copy.
[[nodiscard]] Result<std::vector<SweepTimes>> timeSweeps(const gpu::EglContext& context, const std::string& folder,
                                                         const std::vector<std::uint32_t>& hits, std::uint32_t of_each,
                                                         std::uint32_t copies, int times);

/// Seconds from asking for the smallest thing until its answer is there: median.
[[nodiscard]] Result<double> timeRoundTrip(const gpu::EglContext& context, const std::string& folder);

}  // namespace radiosity::benchmarks
