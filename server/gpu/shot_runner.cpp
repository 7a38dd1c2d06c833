#include "server/gpu/shot_runner.h"

#include <algorithm>
#include <chrono>

namespace radiosity::gpu {
namespace {

constexpr std::uint32_t kLattices = solver::kLatticeSide * solver::kLatticeSide;

bool goodResolution(std::uint32_t n) { return n >= kMinResolution && n <= kMaxResolution && n % 2 == 0; }

}  // namespace

Result<void> checkShots(const ShotSpan& shots) {
  for (std::size_t i = 0; i < shots.scatter.size(); ++i) {
    const auto& shot = shots.scatter[i];
    if (!goodResolution(shot.resolution) || shot.half > 1 || shot.frame.lattice >= kLattices) {
      return fail(ErrorCode::kInternal,
                  "resolution must be even and 4..2048, half 0 or 1, lattice 0..15; got " +
                      std::to_string(shot.resolution) + ", " + std::to_string(shot.half) + ", " +
                      std::to_string(shot.frame.lattice),
                  "scatter shot " + std::to_string(i));
    }
  }
  for (std::size_t i = 0; i < shots.gather.size(); ++i) {
    const auto& shot = shots.gather[i];
    const bool points_fit =
        shot.point_count <= shots.points.size() && shot.first_point <= shots.points.size() - shot.point_count;
    if (!goodResolution(shot.resolution) || shot.half > solver::kBothHalves || shot.corner_count < 3 ||
        shot.corner_count > solver::kMaxCorners || !points_fit) {
      return fail(ErrorCode::kInternal,
                  "resolution must be even and 4..2048, half 0, 1 or both, 3 to 8 corners, points inside the batch",
                  "gather shot " + std::to_string(i));
    }
    for (const auto& point : shots.points.subspan(shot.first_point, shot.point_count)) {
      if (point.lattice >= kLattices) {
        return fail(ErrorCode::kInternal, "lattice must be 0..15", "gather shot " + std::to_string(i));
      }
    }
  }
  return {};
}

Result<std::unique_ptr<ShotRunner>> ShotRunner::create() {
  auto context = EglContext::create();
  if (!context) return tl::unexpected(context.error());
  auto renderer = HemicubeRenderer::create(**context);
  if (!renderer) return tl::unexpected(renderer.error());
  return std::unique_ptr<ShotRunner>(new ShotRunner(std::move(*context), std::move(*renderer)));
}

Result<void> ShotRunner::setScene(std::shared_ptr<const scene::PatchScene> patches) {
  auto scene = GpuScene::upload(*context_, patches);
  if (!scene) return tl::unexpected(scene.error());
  renderer_.setScene(std::move(*scene));
  accumulator_ = ScatterAccumulator(patches->nodeCount());
  gatherer_ = LightGatherer(patches);
  patches_ = std::move(patches);
  link_store_.reset();
  has_scene_ = true;
  return {};
}

Result<solver::TransportCounters> ShotRunner::run(const ShotSpan& shots, const FluxSink& sink) {
  if (!has_scene_) return fail(ErrorCode::kInternal, "setScene must come before run");
  if (const auto good = checkShots(shots); !good) return tl::unexpected(good.error());
  if (shots.mode == solver::LinkMode::kPaperMipmap) {
    if (auto prepared = renderer_.preparePaper(); !prepared) return tl::unexpected(prepared.error());
  }
  solver::TransportCounters counters;
  scatter(shots, sink, counters);
  for (const auto& shot : shots.gather) {
    gatherer_.gather(shot, shots.points.subspan(shot.first_point, shot.point_count), shots.flux_scale, renderer_,
                     weights_, sink, counters);
  }
  return counters;
}

void ShotRunner::scatter(const ShotSpan& shots, const FluxSink& sink, solver::TransportCounters& counters) {
  const auto pass = shots.mode == solver::LinkMode::kPaperMipmap ? HemicubePass::kPaper : HemicubePass::kNodes;
  std::vector<HemicubeView> views;
  for (std::size_t first = 0; first < shots.scatter.size();) {
    // Neighbours of equal resolution share an atlas.
    const auto resolution = shots.scatter[first].resolution;
    const auto capacity = renderer_.capacity(resolution);
    views.clear();
    auto last = first;
    for (; last < shots.scatter.size() && views.size() < capacity && shots.scatter[last].resolution == resolution;
         ++last) {
      views.push_back({shots.scatter[last].frame, shots.scatter[last].level_bias});
    }
    const auto images = renderer_.render(pass, resolution, views, counters);
    const auto start = std::chrono::steady_clock::now();
    const auto pixels = hemicubePixels(resolution);
    for (auto i = first; i < last; ++i) {
      const auto& shot = shots.scatter[i];
      accumulator_.accumulate(images.subspan((i - first) * pixels, pixels),
                              weights_.get(resolution, shot.frame.lattice), shot, shots.flux_scale, sink, counters);
    }
    counters.accumulate_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    first = last;
  }
}

}  // namespace radiosity::gpu
