#include "common/task.h"

#include <algorithm>

namespace radiosity {
namespace {

constexpr auto kToldInterval = std::chrono::milliseconds(100);

}  // namespace

void Task::beginStage(double end) {
  stage_begin_ = stage_end_.load();
  stage_end_ = end;
  tellProgress(0.0);
}

void Task::tellProgress(double of_stage) {
  const double begin = stage_begin_, end = stage_end_;
  const double now_done = begin + (end - begin) * std::clamp(of_stage, 0.0, 1.0);
  auto done = fraction_.load();
  while (done < now_done && !fraction_.compare_exchange_weak(done, now_done)) {
  }
  if (done >= now_done || !told_) return;
  const auto now = Clock::now().time_since_epoch().count();
  auto next = next_told_.load();
  constexpr Clock::rep kInterval = std::chrono::duration_cast<Clock::duration>(kToldInterval).count();
  if (now >= next && next_told_.compare_exchange_strong(next, now + kInterval)) told_();
}

}  // namespace radiosity
