#include "server/solver/transport/transport.h"

#include <utility>

namespace radiosity::solver {

void LinkSample::addFlux(std::uint32_t node, std::int64_t flux, const scene::PatchScene& patches) {
  if (flux == 0) return;
  const auto sum = static_cast<double>(flux) / kMeasureScale;
  const auto area = static_cast<double>(patches.node_area[node]);
  if (area > 0.0) {
    add(node, static_cast<float>(sum / area));
  } else {
    absorbed += sum;
  }
}

void LinkSample::scale(double factor) {
  for (auto& value : irradiance) value *= static_cast<float>(factor);
  escaped *= factor;
  absorbed *= factor;
  delivered *= factor;
  due *= factor;
}

TransportCounters& TransportCounters::operator+=(const TransportCounters& other) {
  scatter_shots += other.scatter_shots;
  gather_shots += other.gather_shots;
  gather_points += other.gather_points;
  point_images += other.point_images;
  parallel_images += other.parallel_images;
  pixels += other.pixels;
  links += other.links;
  triangles_drawn += other.triangles_drawn;
  triangles_culled += other.triangles_culled;
  triangles_between += other.triangles_between;
  triangles_hidden += other.triangles_hidden;
  faces += other.faces;
  faces_empty += other.faces_empty;
  render_seconds += other.render_seconds;
  accumulate_seconds += other.accumulate_seconds;
  gather_seconds += other.gather_seconds;
  return *this;
}

Result<TransportCounters> Transport::measure(const ShotBatch& batch, const TakeLinks& take) {
  const auto patches = scene();
  if (!patches) return fail(ErrorCode::kInternal, "setScene must come before measure");
  TransportCounters counters;
  FluxAccumulators flux;
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
    auto done = run(one, flux);
    if (!done) return done;
    counters += *done;
    LinkSample links;
    for (std::uint32_t node = 0; node < patches->nodeCount(); ++node)
      links.addFlux(node, flux.node[0][node][0], *patches);
    links.escaped += static_cast<double>(flux.escaped[0]) / kMeasureScale;
    links.absorbed += static_cast<double>(flux.backface[0]) / kMeasureScale;
    take(i, std::move(links));
  }
  return counters;
}

}  // namespace radiosity::solver
