#include "server/solver/pipeline/link_wave.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace radiosity::solver {

void LinkWave::begin(std::vector<Measurement> wanted) {
  wanted_ = std::move(wanted);
  measured_ = 0;
}

bool LinkWave::isSource(const Measurement& want) const {
  return parts_.system.shooters()[want.shooter].sample_cost > 0.0;
}

Result<void> LinkWave::advance(TransportCounters& counters) {
  const auto& want = wanted_[measured_];
  if (!isSource(want)) return measureShots(counters);
  if (parts_.system.shooters()[want.shooter].crowd != scene::kNone) {
    if (measureCrowd(want, counters)) ++measured_;
    return {};
  }
  const auto done = measureSource(want, counters);
  if (!done && done.error().code == ErrorCode::kCancelled) return {};
  ++measured_;
  return done;
}

Result<void> LinkWave::measureShots(TransportCounters& counters) {
  const auto start = std::chrono::steady_clock::now();
  auto slice = std::span(wanted_).subspan(measured_, std::min(slice_.most, wanted_.size() - measured_));
  const auto isSource = [this](const Measurement& want) { return this->isSource(want); };
  slice = slice.first(static_cast<std::size_t>(std::find_if(slice.begin(), slice.end(), isSource) - slice.begin()));
  ShotBatch batch;
  batch.may_be_put_off = true;
  std::vector<const Measurement*> gathered, scattered;
  for (const auto& want : slice) {
    const auto& shooter = parts_.system.shooters()[want.shooter];
    if (shooter.isLight()) {
      parts_.shots.add(parts_.lights[shooter.light], want.half, want.index, want.points,
                       parts_.settings.planner.lightResolution(want.index), batch);
    } else {
      parts_.shots.add(shooter.place, want.half, want.index, shooter.resolution, batch);
    }
    (batch.gather.size() > gathered.size() ? gathered : scattered).push_back(&want);
  }
  gathered.insert(gathered.end(), scattered.begin(), scattered.end());
  std::size_t taken = 0;
  const auto take = [&](std::size_t i, LinkSample&& links) {
    taken = i + 1;
    const auto& want = *gathered[i];
    const bool is_scattered = i >= batch.gather.size();
    if (is_scattered) links.scale(parts_.system.shooters()[want.shooter].area);  // it carried a flux of one
    parts_.expander.expand(links, is_scattered);
    parts_.system.addSample(want.shooter, want.half, parts_.expander, links, want.points);
  };
  const auto done = parts_.transport.measure(batch, take);
  if (!done && done.error().code == ErrorCode::kCancelled) {
    putOff(slice, gathered, taken);
    return {};
  }
  if (!done) return tl::unexpected<Error>(done.error());
  counters += *done;
  measured_ += slice.size();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  slice_.most =
      static_cast<std::size_t>(std::clamp(static_cast<double>(slice.size()) * kSliceSeconds / std::max(seconds, 1e-6),
                                          static_cast<double>(slice_.fewest), 4096.0));
  return {};
}

/// The rest of a slice, of which so many were taken, in the order in which the transport takes them.
void LinkWave::putOff(std::span<Measurement> slice, std::span<const Measurement* const> order, std::size_t taken) {
  std::vector<Measurement> ordered;
  for (const auto* want : order) ordered.push_back(*want);
  std::ranges::copy(ordered, slice.begin());
  measured_ += taken;
  slice_.most = std::max<std::size_t>(taken, std::max<std::size_t>(slice_.fewest, 1));
}

/// False: there is more to do.
bool LinkWave::measureCrowd(const Measurement& want, TransportCounters& counters) {
  const auto& crowd = lamps_.crowds[parts_.system.shooters()[want.shooter].crowd];
  if (!crowd_sample_ || !crowd_sample_->isOf(crowd, want.half, want.index))
    crowd_sample_ = std::make_unique<CrowdSample>(parts_.patches, parts_.sides, *rays_(), parts_.settings.seed, crowd,
                                                  want.half, want.index);
  if (!crowd_sample_->advance(kSliceSeconds, in_haste_ ? CrowdSample::Leaves::kSome : CrowdSample::Leaves::kAll))
    return false;
  if (!crowd_sample_->isWhole()) rough_.push_back(want);
  counters.gather_shots += 1;
  counters.gather_points += CrowdSample::kDraws;
  const auto links = std::exchange(crowd_sample_, nullptr)->links();
  parts_.expander.expand(links);
  parts_.system.addSample(want.shooter, want.half, parts_.expander, links, want.points);
  return true;
}

/// One sequence of shots of a light without extent.
Result<void> LinkWave::measureSource(const Measurement& want, TransportCounters& counters) {
  const auto& source = lamps_.sources[parts_.system.shooters()[want.shooter].source];
  ShotBatch batch;
  batch.may_be_put_off = true;
  batch.flux_scale = kMeasureScale * std::exp2(-std::ceil(std::log2(std::max(1.0, source.flux_per_intensity))));
  lamps_.punctual.addSample(source, want.index, static_cast<std::uint32_t>(want.half), batch);
  FluxAccumulators flux;
  flux.reset(parts_.patches.nodeCount());
  const auto done = parts_.transport.run(batch, flux);
  if (!done) return tl::unexpected<Error>(done.error());
  counters += *done;
  LinkSample links;
  for (std::uint32_t node = 0; node < parts_.patches.nodeCount(); ++node)
    links.addFlux(node, flux.node[want.half][node][0], parts_.patches);
  links.escaped += static_cast<double>(flux.escaped[0]) / kMeasureScale;
  links.absorbed += static_cast<double>(flux.backface[0]) / kMeasureScale;
  // The shots of a half carry half of an intensity of one.
  links.scale(2.0 * kMeasureScale / batch.flux_scale);
  parts_.expander.expand(links);
  parts_.system.addSample(want.shooter, want.half, parts_.expander, links, want.points);
  return {};
}

/// Without it there is no light of the crowd in this half.
bool LinkWave::isFirstOfCrowd(const Measurement& want) const {
  const auto& shooter = parts_.system.shooters()[want.shooter];
  return shooter.crowd != scene::kNone && shooter.column[want.half].points() == 0.0;
}

bool LinkWave::endInHaste() {
  const auto left = wanted_.begin() + static_cast<std::ptrdiff_t>(measured_);
  const auto is_crowd = [this](const Measurement& want) { return isFirstOfCrowd(want); };
  if (measured_ == 0 && std::ranges::none_of(wanted_, is_crowd)) return false;
  wanted_.erase(std::remove_if(left, wanted_.end(), std::not_fn(is_crowd)), wanted_.end());
  in_haste_ = true;
  return true;
}

bool LinkWave::forgetRough() {
  if (!in_haste_ || !isMeasured()) return false;
  in_haste_ = false;
  const auto rough = std::exchange(rough_, {});
  for (const auto& want : rough) parts_.system.forget(want.shooter, want.half);
  return !rough.empty();
}

bool LinkWave::fits() const {
  const auto exists = [this](const Measurement& want) {
    return want.shooter < parts_.system.shooters().size() && want.half < 2;
  };
  return measured_ <= wanted_.size() && std::ranges::all_of(wanted_, exists) && std::ranges::all_of(rough_, exists);
}

}  // namespace radiosity::solver
