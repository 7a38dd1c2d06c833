#include "server/solver/transport/wave.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "common/check.h"

namespace radiosity::solver {
namespace {

/// Short enough that nobody notices the wait, long enough that the workers' waiting for the last of them does not
/// count.
constexpr double kSliceSeconds = 0.06;
/// Never less, and the first of all, before anything was measured: 30 ms on a processor's core. On a crowded machine
/// shorter slices would mostly be waiting for the last worker.
constexpr double kLeastSlice = 1'000'000.0;

}  // namespace

void Wave::begin(ShotBatch batch, const scene::PatchScene& patches) {
  RAD_CHECK(!under_way_);
  batch_ = std::move(batch);
  slice_.reset();
  flux_.reset(patches.nodeCount());
  cost_ = {static_cast<double>(patches.triangles.size()), static_cast<double>(patches.leaves.size())};
  next_gather_ = next_scatter_ = 0;
  cost_left_ = 0.0;
  for (const auto& shot : batch_.gather) cost_left_ += cost_(shot);
  for (const auto& shot : batch_.scatter) cost_left_ += cost_(shot);
  others_left_ = !batch_.point_lights.empty() || !batch_.parallel.empty() || !batch_.lamps.empty();
  under_way_ = true;
}

/// Takes shots until their cost reaches the target.
template <typename Shot, typename Take>
void Wave::fill(const std::vector<Shot>& shots, std::size_t& next, double target, double& cost, Take take) const {
  for (; next < shots.size() && cost < target; ++next) {
    cost += cost_(shots[next]);
    take(shots[next]);
  }
}

ShotBatch Wave::nextSlice() {
  const double most = std::max(kLeastSlice, kSliceSeconds * cost_per_second_);
  // Slices of equal cost, or the last would often be a crumb.
  const double target = cost_left_ / std::max(1.0, std::ceil(cost_left_ / most));
  ShotBatch slice;
  slice.mode = batch_.mode;
  slice.may_be_put_off = true;
  slice.flux_scale = batch_.flux_scale;
  slice_cost_ = 0.0;
  if (std::exchange(others_left_, false)) {  // lights that are no surfaces come in small batches already
    slice.point_lights = std::move(batch_.point_lights);
    slice.parallel = std::move(batch_.parallel);
    slice.views = std::move(batch_.views);
    slice.lamps = std::move(batch_.lamps);
    slice.webs = std::move(batch_.webs);
    return slice;
  }
  fill(batch_.gather, next_gather_, target, slice_cost_, [&](GatherShot shot) {
    const auto first = batch_.points.begin() + shot.first_point;
    shot.first_point = static_cast<std::uint32_t>(slice.points.size());
    slice.points.insert(slice.points.end(), first, first + shot.point_count);
    slice.gather.push_back(shot);
  });
  fill(batch_.scatter, next_scatter_, target, slice_cost_, [&](const ScatterShot& s) { slice.scatter.push_back(s); });
  return slice;
}

Result<bool> Wave::advance(Transport& transport, TransportCounters& counters) {
  RAD_CHECK(under_way_);
  if (!slice_) slice_ = nextSlice();
  const auto start = std::chrono::steady_clock::now();
  const auto done = transport.run(*slice_, flux_);
  if (!done && done.error().code == ErrorCode::kCancelled) return false;  // put off: nothing of it has arrived
  slice_.reset();
  if (!done) {
    under_way_ = false;
    return tl::unexpected<Error>(done.error());
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (slice_cost_ > 0.0) cost_per_second_ = slice_cost_ / std::max(seconds, 1e-6);
  cost_left_ -= slice_cost_;
  counters += *done;
  under_way_ = next_gather_ < batch_.gather.size() || next_scatter_ < batch_.scatter.size();
  return !under_way_;
}

}  // namespace radiosity::solver
