// ShotRunner::measure: item buffers of many shots share an atlas, whichever shots they belong to.
#include <algorithm>
#include <chrono>
#include <utility>

#include "common/task.h"
#include "server/gpu/run/shot_runner.h"

namespace radiosity::gpu {

Result<solver::TransportCounters> ShotRunner::measure(const ShotSpan& shots, const solver::Transport::TakeLinks& take) {
  if (!receivers_) return fail(ErrorCode::kInternal, "setScene must come before measure");
  if (const auto good = checkShots(shots); !good) return tl::unexpected(good.error());
  solver::TransportCounters counters;
  came_to_ = gatherer_.place();
  if (sight_ == Sight::kRays && shots.mode != solver::LinkMode::kPaperMipmap) {
    measureByRays(shots, take, counters);
  } else {
    begun_.reset();
    measureGather(shots, take, counters);
  }
  begun_.reset();
  measureScatter(shots, take, counters);
  if (const auto good = images_.check(); !good) return tl::unexpected(good.error());
  return counters;
}

/// A hemicube of node IDs is accumulated as if it carried a flux of one, into integers that are read back at once.
void ShotRunner::measureScatter(const ShotSpan& shots, const solver::Transport::TakeLinks& take,
                                solver::TransportCounters& counters) {
  if (shots.scatter.empty()) return;
  if (!link_store_) link_store_.emplace(receivers_->patches().nodeCount());
  const auto sink = link_store_->sink();
  for (std::size_t i = 0; i < shots.scatter.size(); ++i) {
    auto shot = shots.scatter[i];
    shot.flux = {1.0, 0.0, 0.0};
    shot.half = 0;
    ShotSpan one;
    one.mode = shots.mode;
    one.flux_scale = solver::kMeasureScale;
    one.scatter = std::span(&shot, 1);
    scatter(one, sink, counters);
    solver::LinkSample links;
    for (std::size_t block = 0; block < sink.mark[0].size(); ++block) {
      if (sink.mark[0][block] == 0) continue;
      const auto first = static_cast<std::uint32_t>(block * kMarkNodes);
      const auto last = std::min<std::size_t>(first + kMarkNodes, sink.node[0].size());
      for (auto node = first; node < last; ++node) links.addFlux(node, sink.node[0][node][0], receivers_->patches());
    }
    links.escaped += static_cast<double>(sink.totals->escaped[0]) / solver::kMeasureScale;
    links.absorbed += static_cast<double>(sink.totals->backface[0]) / solver::kMeasureScale;
    sink.clear();
    take(shots.gather.size() + i, std::move(links));
  }
}

void ShotRunner::measureByRays(const ShotSpan& shots, const solver::Transport::TakeLinks& take,
                               solver::TransportCounters& counters) {
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < shots.gather.size(); ++i) {
    const auto& shot = shots.gather[i];
    if (shot.point_count == 0) continue;
    if (auto wanted = begunShot(shots, shot); begun_ != wanted) {
      begun_.reset();
      gatherer_.beginLinks(shot, shots.receivers.subspan(shot.first_run, shot.run_count));
      begun_ = std::move(wanted);
      came_to_ = {};
    }
    while (gatherer_.lookCount() < shot.point_count)
      gatherer_.look(shot, shots.points[shot.first_point + gatherer_.lookCount()]);
    solver::LinkSample links;
    gatherer_.finishLinks(shot, links, counters);
    begun_.reset();
    take(i, std::move(links));
  }
  counters.gather_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

ShotRunner::BegunShot ShotRunner::begunShot(const ShotSpan& shots, const solver::GatherShot& shot) {
  const auto points = shots.points.subspan(shot.first_point, shot.point_count);
  const auto receivers = shots.receivers.subspan(shot.first_run, shot.run_count);
  BegunShot begun{shot, {points.begin(), points.end()}, {receivers.begin(), receivers.end()}};
  begun.shot.first_point = begun.shot.first_run = begun.shot.first_box = 0;
  return begun;
}

void ShotRunner::measureGather(const ShotSpan& shots, const solver::Transport::TakeLinks& take,
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
    interruptionPoint();
    const auto resolution = shots.gather[looks[first].shot].resolution;
    views.clear();
    auto last = first;
    for (; last < looks.size() && views.size() < images_.hemicubeCapacity(resolution) &&
           shots.gather[looks[last].shot].resolution == resolution;
         ++last) {
      const auto& shot = shots.gather[looks[last].shot];
      const auto& point = shots.points[looks[last].point];
      views.push_back({point, 0.0F, std::nullopt});
      if (shot.box_count == 0) continue;
      if (looks[last].point == shot.first_point)
        gatherer_.findWanted(shot, shots.receivers.subspan(shot.first_run, shot.run_count));
      if (!shot.open_looks.has(static_cast<std::uint32_t>(looks[last].point - shot.first_point)))
        views.back().window = gatherer_.windowOf(shot, point, shots.boxes.subspan(shot.first_box, shot.box_count));
    }
    const auto images = images_.hemicubes(HemicubePass::kItems, resolution, views, counters);
    const auto start = Clock::now();
    const auto pixels = hemicubePixels(resolution);
    for (auto i = first; i < last; ++i) {
      interruptionPoint();
      const auto& shot = shots.gather[looks[i].shot];
      if (looks[i].point == shot.first_point)
        gatherer_.beginLinks(shot, shots.receivers.subspan(shot.first_run, shot.run_count));
      const auto& frame = shots.points[looks[i].point];
      const auto& window = views[i - first].window;
      gatherer_.look(shot, frame, images.subspan((i - first) * pixels, pixels),
                     weights_->get(resolution, frame.lattice), window ? &*window : nullptr);
      if (looks[i].point + 1 == shot.first_point + shot.point_count) {
        solver::LinkSample links;
        gatherer_.finishLinks(shot, links, counters);
        take(looks[i].shot, std::move(links));
      }
    }
    counters.gather_seconds += std::chrono::duration<double>(Clock::now() - start).count();
    first = last;
  }
}

}  // namespace radiosity::gpu
