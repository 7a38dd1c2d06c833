// ShotRunner::measure: item buffers of many shots share an atlas, whichever shots they belong to.
#include <chrono>

#include "server/gpu/shot_runner.h"

namespace radiosity::gpu {

Result<solver::TransportCounters> ShotRunner::measure(const ShotSpan& shots, std::vector<solver::LinkSample>& samples) {
  if (!has_scene_) return fail(ErrorCode::kInternal, "setScene must come before measure");
  if (const auto good = checkShots(shots); !good) return tl::unexpected(good.error());
  solver::TransportCounters counters;
  samples.assign(shots.gather.size(), {});
  measureGather(shots, samples, counters);
  return counters;
}

void ShotRunner::measureGather(const ShotSpan& shots, std::vector<solver::LinkSample>& samples,
                               solver::TransportCounters& counters) {
  using Clock = std::chrono::steady_clock;
  // Points of neighbouring shots with equal resolution, in order.
  struct Look {
    std::size_t shot, point;
  };
  std::vector<Look> looks;
  for (std::size_t i = 0; i < shots.gather.size(); ++i) {
    const auto& shot = shots.gather[i];
    for (std::size_t p = 0; p < shot.point_count; ++p) looks.push_back({i, shot.first_point + p});
  }
  std::vector<HemicubeView> views;
  for (std::size_t first = 0; first < looks.size();) {
    const auto resolution = shots.gather[looks[first].shot].resolution;
    views.clear();
    auto last = first;
    for (; last < looks.size() && views.size() < renderer_.capacity(resolution) &&
           shots.gather[looks[last].shot].resolution == resolution;
         ++last) {
      views.push_back({shots.points[looks[last].point]});
    }
    const auto images = renderer_.render(HemicubePass::kItems, resolution, views, counters);
    const auto start = Clock::now();
    const auto pixels = hemicubePixels(resolution);
    for (auto i = first; i < last; ++i) {
      const auto& shot = shots.gather[looks[i].shot];
      if (looks[i].point == shot.first_point) gatherer_.beginLinks(shot);
      const auto& frame = shots.points[looks[i].point];
      gatherer_.look(shot, frame, images.subspan((i - first) * pixels, pixels),
                     weights_.get(resolution, frame.lattice));
      if (looks[i].point + 1 == shot.first_point + shot.point_count) {
        gatherer_.finishLinks(shot, samples[looks[i].shot], counters);
      }
    }
    counters.gather_seconds += std::chrono::duration<double>(Clock::now() - start).count();
    first = last;
  }
}

}  // namespace radiosity::gpu
