#include "server/gpu/gather/light_gatherer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "common/task.h"
#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::gpu {
namespace {

/// A single shot of whose light less than this stays in the scene is not held to deliver it all: what one image says of
/// that is too coarse. A crack that is more than one pixel (isCrack) takes up to 0.0012 for each.
constexpr double kClosed = 0.99;

}  // namespace

/// Flux that arrives by form factors and visibility, for a radiosity of one.
double LightGatherer::delivered() const {
  const auto* area = receivers_->patches().node_area.data();
  double delivered = 0.0;
  for (std::size_t i = 0; i < lit_count_; ++i)
    delivered += static_cast<double>(lit_.form_factor[i] * lit_.visibility[i] * area[lit_.node[i]]);
  return delivered;
}

/// As LinkColumn::gain, for one shot.
double LightGatherer::conserve(double area, double kept) const {
  if (kept < kClosed || receivers_->hasGlass()) return 1.0;
  const double sum = delivered();
  return sum > 0.0 ? std::clamp(kept * area / sum, 0.25, 4.0) : 1.0;
}

void LightGatherer::deliver(const solver::GatherShot& shot, std::size_t half, double share, const FluxSink& sink,
                            solver::TransportCounters& counters) const {
  for (std::size_t i = 0; i < lit_count_; ++i) {
    const float seen = lit_.visibility[i];
    if (seen <= 0.0F) continue;
    const auto node = lit_.node[i];
    const double factor = share * static_cast<double>(lit_.form_factor[i] * seen) *
                          static_cast<double>(receivers_->patches().node_area[node]);
    solver::Flux3 flux{};
    for (std::size_t channel = 0; channel < 3; ++channel) {
      flux[channel] = std::lrint(shot.radiosity[channel] * factor);
      sink.totals->gathered[channel] += flux[channel];
    }
    sink.add(static_cast<std::uint32_t>(half), node, flux);
    ++counters.links;
  }
}

void LightGatherer::look(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                         std::span<const std::uint32_t> items, const HemicubeWeights& weights,
                         const ViewWindow* window) {
  testPoint(shot, point, items, 0);
  const auto before = look_lost_;
  if (window != nullptr) {
    weighLostInside(*window, point, items, shot.resolution, weights, look_lost_);
  } else {
    weighLost(point, items, shot.resolution, weights, look_lost_);
  }
  if (look_lost_ != before) open_looks_.add(look_count_);
  ++look_count_;
}

void LightGatherer::finishLinks(const solver::GatherShot& shot, solver::LinkSample& sample,
                                solver::TransportCounters& counters) {
  const double area =
      static_cast<double>(shot.fill) * solver::polygonArea(std::span(shot.corners.data(), shot.corner_count));
  const double one = static_cast<double>(look_count_) * solver::kWeightOne;
  const double escaped = static_cast<double>(look_lost_.escaped) / one;
  const double absorbed = static_cast<double>(look_lost_.absorbed) / one;
  const double kept = 1.0 - escaped - absorbed;
  findVisibility(0, look_count_);
  sample.delivered = delivered();
  sample.due = receivers_->hasGlass() ? sample.delivered : kept * area;
  sample.runs.clear();
  sample.irradiance.resize(lit_count_);
  float* irradiance = sample.irradiance.data();
  std::size_t count = 0, begin = 0;  // of values, and where the run that grows has its first
  for (std::size_t i = 0; i < lit_count_; ++i) {
    // What is hidden is sent too: zeros inside a run cost less than a new run.
    const float value = lit_.form_factor[i] * lit_.visibility[i];
    const auto node = lit_.node[i];
    if (i > 0 && node == lit_.node[i - 1]) {
      irradiance[count - 1] += value;
      continue;
    }
    if (i == 0 || node != lit_.node[i - 1] + 1) {
      if (i > 0) sample.runs.back().count = static_cast<std::uint32_t>(count - begin);
      sample.runs.push_back({node, 0});
      begin = count;
    }
    irradiance[count++] = value;
  }
  if (count > 0) sample.runs.back().count = static_cast<std::uint32_t>(count - begin);
  sample.irradiance.resize(count);
  sample.escaped = escaped * area;
  sample.absorbed = absorbed * area;
  sample.open_looks = open_looks_;
  counters.links += sample.irradiance.size();
  counters.gather_points += look_count_;
  ++counters.gather_shots;
}

void LightGatherer::gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points,
                           double flux_scale, ImageSource& source, WeightCache& weights, const FluxSink& sink,
                           solver::TransportCounters& counters) {
  if (points.empty()) return;
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const double waited_before = source.seconds();
  findLit(shot);
  const bool both = shot.half == solver::kBothHalves && points.size() > 1;
  beginSums();
  std::array<Lost, 2> lost{};
  const auto capacity = source.hemicubeCapacity(shot.resolution);
  std::vector<HemicubeView> views;
  for (std::size_t first = 0; first < points.size(); first += capacity) {
    views.clear();
    for (const auto& point : points.subspan(first, std::min(capacity, points.size() - first))) views.push_back({point});
    const auto images = source.hemicubes(HemicubePass::kItems, shot.resolution, views, counters);
    const auto pixels = hemicubePixels(shot.resolution);
    for (std::size_t i = 0; i < views.size(); ++i) {
      interruptionPoint();
      const auto items = images.subspan(i * pixels, pixels);
      const std::size_t half = both && 2 * (first + i) >= points.size() ? 1 : 0;
      testPoint(shot, views[i].frame, items, half);
      weighLost(views[i].frame, items, shot.resolution, weights.get(shot.resolution, views[i].frame.lattice),
                lost[half]);
    }
  }
  deliverSums(shot, points.size(), lost, flux_scale, sink, counters);
  counters.gather_seconds +=
      std::chrono::duration<double>(Clock::now() - start).count() - (source.seconds() - waited_before);
}

void LightGatherer::gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points,
                           double flux_scale, const FluxSink& sink, solver::TransportCounters& counters) {
  if (points.empty()) return;
  const auto start = std::chrono::steady_clock::now();
  findLit(shot);
  const bool both = shot.half == solver::kBothHalves && points.size() > 1;
  beginSums();
  std::array<Lost, 2> lost{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t half = both && 2 * i >= points.size() ? 1 : 0;
    asked_ = {};
    askRays(shot, points[i], static_cast<std::uint32_t>(i), half);
    loseByRays(points[i], lost[half]);
  }
  deliverSums(shot, points.size(), lost, flux_scale, sink, counters);
  counters.gather_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void LightGatherer::beginSums() {
  for (std::size_t half = 0; half < 2; ++half) {
    for (auto* sum : {&lit_.weight[half], &lit_.visible_weight[half]}) {
      std::fill_n(sum->begin(), lit_count_, 0.0F);
    }
  }
  beginEdges();
}

/// What was found from so many points, of which each half has its part where the shot is of both.
void LightGatherer::deliverSums(const solver::GatherShot& shot, std::size_t points, const std::array<Lost, 2>& lost,
                                double flux_scale, const FluxSink& sink, solver::TransportCounters& counters) {
  const bool both = shot.half == solver::kBothHalves && points > 1;
  const double area =
      static_cast<double>(shot.fill) * solver::polygonArea(std::span(shot.corners.data(), shot.corner_count));
  const std::size_t first_half = both ? (points + 1) / 2 : points;
  for (std::size_t sums = 0; sums < (both ? 2U : 1U); ++sums) {
    const std::size_t count = sums == 0 ? first_half : points - first_half;
    const double share = (both ? 0.5 : 1.0) * flux_scale, one = static_cast<double>(count) * solver::kWeightOne;
    const double escaped = static_cast<double>(lost[sums].escaped) / one;
    const double absorbed = static_cast<double>(lost[sums].absorbed) / one;
    findVisibility(sums, count);
    const double scale = conserve(area, 1.0 - escaped - absorbed);
    deliver(shot, both ? sums : shot.half % 2, share * scale, sink, counters);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const double flux = shot.radiosity[channel] * area * share;
      sink.totals->escaped[channel] += std::lrint(flux * escaped);
      sink.totals->backface[channel] += std::lrint(flux * absorbed);
    }
  }
  counters.gather_points += points;
  ++counters.gather_shots;
}

}  // namespace radiosity::gpu
