#include "server/gpu/gather/scatter_accumulator.h"

#include <cmath>

namespace radiosity::gpu {

std::size_t findRuns(std::span<const std::uint32_t> ids, std::span<std::uint32_t> starts) {
  std::size_t count = 0;
  starts[count++] = 0;
  const auto step = [&](std::size_t i) {
    starts[count] = static_cast<std::uint32_t>(i);  // kept only if a run begins here: no branch to mispredict
    count += static_cast<std::size_t>(ids[i] != ids[i - 1]);
  };
  constexpr std::size_t kBlock = 16;
  std::size_t i = 1;
  for (; i + kBlock <= ids.size(); i += kBlock) {
    std::uint32_t changes = 0;  // a vectorised look ahead: large images are mostly long runs
    for (std::size_t k = i; k < i + kBlock; ++k) changes |= ids[k] ^ ids[k - 1];
    if (changes == 0) continue;
    for (std::size_t k = i; k < i + kBlock; ++k) step(k);
  }
  for (; i < ids.size(); ++i) step(i);
  starts[count] = static_cast<std::uint32_t>(ids.size());
  return count;
}

void ScatterAccumulator::weigh(std::span<const std::uint32_t> ids, const HemicubeWeights& weights) {
  starts_.resize(ids.size() + 1);
  touched_.resize(ids.size() + 1);
  const auto runs = findRuns(ids, starts_);
  std::size_t touched = 0;
  for (std::size_t run = 0; run < runs; ++run) {
    const auto id = ids[starts_[run]];
    auto& weight = weight_[id];
    touched_[touched] = id;
    touched += static_cast<std::size_t>(weight == 0);
    weight += weights.before[starts_[run + 1]] - weights.before[starts_[run]];
  }
  touched_count_ = touched;
}

void ScatterAccumulator::accumulate(std::span<const std::uint32_t> ids, const HemicubeWeights& weights,
                                    const solver::ScatterShot& shot, double flux_scale, const FluxSink& sink,
                                    solver::TransportCounters& counters) {
  weigh(ids, weights);
  const double per_weight = flux_scale / solver::kWeightOne;
  const std::array<double, 3> flux{shot.flux[0] * per_weight, shot.flux[1] * per_weight, shot.flux[2] * per_weight};
  const auto nodes = static_cast<std::uint32_t>(weight_.size() - 2);
  const auto deliver = [&](std::uint32_t id) {
    const double weight = weight_[id];
    return solver::Flux3{std::lrint(weight * flux[0]), std::lrint(weight * flux[1]), std::lrint(weight * flux[2])};
  };
  const auto add = [](solver::Flux3& into, const solver::Flux3& from) {
    for (std::size_t channel = 0; channel < 3; ++channel) into[channel] += from[channel];
  };
  solver::Flux3 scattered{};
  for (std::size_t i = 0; i < touched_count_; ++i) {
    const auto id = touched_[i];
    const auto delivered = deliver(id);
    weight_[id] = 0;
    if (id < nodes) {
      sink.add(shot.half, id, delivered);
      add(scattered, delivered);
    } else {
      add(id == nodes ? sink.totals->escaped : sink.totals->backface, delivered);
    }
  }
  add(sink.totals->scattered, scattered);
  counters.links += touched_count_;
  ++counters.scatter_shots;
}

}  // namespace radiosity::gpu
