#include "server/solver/transport.h"

#include <cmath>

namespace radiosity::solver {
namespace {

/// Integers of one measured shot: its flux is at most about the area of the unit box's faces.
constexpr double kMeasureScale = 1125899906842624.0;  // 2^50

LinkSample readLinks(const FluxAccumulators& flux, const scene::PatchScene& patches) {
  LinkSample links;
  for (std::size_t node = 0; node < patches.nodeCount(); ++node) {
    const auto sum = static_cast<double>(flux.node[0][node][0]) / kMeasureScale;
    if (sum == 0.0) continue;
    const auto area = static_cast<double>(patches.node_area[node]);
    if (area <= 0.0) {
      links.absorbed += sum;  // a sliver that only the rasteriser saw
      continue;
    }
    links.add(static_cast<std::uint32_t>(node), static_cast<float>(sum / area));
  }
  links.escaped += static_cast<double>(flux.escaped[0]) / kMeasureScale;
  links.absorbed += static_cast<double>(flux.backface[0]) / kMeasureScale;
  return links;
}

}  // namespace

TransportCounters& TransportCounters::operator+=(const TransportCounters& other) {
  scatter_shots += other.scatter_shots;
  gather_shots += other.gather_shots;
  gather_points += other.gather_points;
  pixels += other.pixels;
  links += other.links;
  triangles_drawn += other.triangles_drawn;
  triangles_culled += other.triangles_culled;
  render_seconds += other.render_seconds;
  accumulate_seconds += other.accumulate_seconds;
  gather_seconds += other.gather_seconds;
  return *this;
}

Result<TransportCounters> Transport::measure(const ShotBatch& batch, std::vector<LinkSample>& samples) {
  const auto patches = scene();
  if (!patches) return fail(ErrorCode::kInternal, "setScene must come before measure");
  TransportCounters counters;
  FluxAccumulators flux;
  samples.clear();
  for (std::size_t i = 0; i < batch.gather.size() + batch.scatter.size(); ++i) {
    ShotBatch one;
    one.mode = batch.mode;
    one.flux_scale = kMeasureScale;
    if (i < batch.gather.size()) {
      one.gather = {batch.gather[i]};
      one.points = batch.points;
      one.gather[0].radiosity = {1.0, 0.0, 0.0};
      one.gather[0].half = 0;
    } else {
      one.scatter = {batch.scatter[i - batch.gather.size()]};
      one.scatter[0].flux = {1.0, 0.0, 0.0};
      one.scatter[0].half = 0;
    }
    flux.reset(patches->nodeCount());
    const auto done = run(one, flux);
    if (!done) return done;
    counters += *done;
    samples.push_back(readLinks(flux, *patches));
  }
  return counters;
}

}  // namespace radiosity::solver
