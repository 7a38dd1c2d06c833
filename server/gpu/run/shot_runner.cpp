#include "server/gpu/run/shot_runner.h"

#include <algorithm>
#include <bit>
#include <chrono>

#include "common/task.h"

namespace radiosity::gpu {
namespace {

constexpr std::uint32_t kLattices = solver::kLatticeSide * solver::kLatticeSide;

bool goodResolution(std::uint32_t n) { return n >= kMinResolution && n <= kMaxResolution && n % 2 == 0; }

bool goodReceivers(const solver::ReceiverPoints& points) {
  return points.count >= 1 && points.count <= solver::kMaxReceiverPoints;
}

bool inside(std::uint32_t first, std::uint32_t count, std::size_t size) {
  return count <= size && first <= size - count;
}

bool fitsTable(const solver::LampShot& shot, std::span<const float> tables) {
  if (!shot.shape.hasTable()) return true;
  if (!inside(shot.first_web, shot.web_size, tables.size())) return false;
  const auto table = tables.subspan(shot.first_web, shot.web_size);
  return shot.shape.kind == solver::LampShape::Kind::kSky ? scene::isSkyTable(table) : scene::isWebTable(table);
}

Result<void> checkPunctual(const ShotSpan& shots) {
  for (std::size_t i = 0; i < shots.point_lights.size(); ++i) {
    const auto& shot = shots.point_lights[i];
    if (goodResolution(shot.resolution) && shot.half <= 1 && shot.frame.lattice < kLattices &&
        goodReceivers(shot.receivers)) {
      continue;
    }
    return fail(ErrorCode::kInternal,
                "resolution must be even and 4..2048, half 0 or 1, lattice 0..15, 1 to 8 receiving points",
                "point light shot " + std::to_string(i));
  }
  for (std::size_t i = 0; i < shots.parallel.size(); ++i) {
    const auto& shot = shots.parallel[i];
    if (goodResolution(shot.resolution) && shot.half <= 1 && goodReceivers(shot.receivers) && shot.view_count > 0 &&
        inside(shot.first_view, shot.view_count, shots.views.size()) &&
        inside(shot.first_of_sky, shot.sky_count, shots.views.size())) {
      continue;
    }
    return fail(ErrorCode::kInternal,
                "resolution must be even and 4..2048, half 0 or 1, 1 to 8 receiving points, views inside the batch",
                "parallel shot " + std::to_string(i));
  }
  for (std::size_t i = 0; i < shots.lamps.size(); ++i) {
    const auto& shot = shots.lamps[i];
    if (shot.half <= 1 && goodReceivers(shot.receivers) && fitsTable(shot, shots.webs)) continue;
    return fail(ErrorCode::kInternal, "half must be 0 or 1, 1 to 8 receiving points, a table inside the batch",
                "lamp shot " + std::to_string(i));
  }
  return {};
}

}  // namespace

ShotSpan spanOf(const solver::ShotBatch& batch) {
  return {batch.mode,     batch.flux_scale, batch.scatter,   batch.gather, batch.points, batch.point_lights,
          batch.parallel, batch.views,      batch.receivers, batch.boxes,  batch.lamps,  batch.webs};
}

Result<void> checkShots(const ShotSpan& shots) {
  if (auto good = checkPunctual(shots); !good) return good;
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
    const bool points_fit = inside(shot.first_point, shot.point_count, shots.points.size()) &&
                            inside(shot.first_run, shot.run_count, shots.receivers.size()) &&
                            inside(shot.first_box, shot.box_count, shots.boxes.size());
    const bool rows_fit = std::has_single_bit(shot.spot_rows) && shot.spot_rows <= scene::kSpotRows &&
                          shot.spots.row < scene::kSpotRows && shot.spots.at >= 0.0F && shot.spots.at < 1.0F;
    if (!goodResolution(shot.resolution) || shot.half > solver::kBothHalves || shot.corner_count < 3 ||
        shot.corner_count > solver::kMaxCorners || !rows_fit || !points_fit) {
      return fail(
          ErrorCode::kInternal,
          "resolution must be even and 4..2048, half 0, 1 or both, 3 to 8 corners, 1 to 16 rows of spots (a power "
          "of two), one of them within [0, 16) and a part of it within [0, 1), points, receivers and boxes inside the "
          "batch",
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

void ShotRunner::setScene(const std::shared_ptr<const Receivers>& receivers, Sight sight) {
  receivers_ = receivers;
  sight_ = sight;
  punctual_ = PunctualGatherer(receivers);
  lamps_ = LampGatherer(receivers);
  accumulator_ = ScatterAccumulator(receivers->patches().nodeCount());
  gatherer_ = LightGatherer(receivers);
  begun_.reset();
  link_store_.reset();
}

Result<solver::TransportCounters> ShotRunner::run(const ShotSpan& shots, const FluxSink& sink) {
  if (!receivers_) return fail(ErrorCode::kInternal, "setScene must come before run");
  if (const auto good = checkShots(shots); !good) return tl::unexpected(good.error());
  if (shots.mode == solver::LinkMode::kPaperMipmap) {
    if (auto prepared = images_.preparePaper(); !prepared) return tl::unexpected(prepared.error());
  }
  begun_.reset();
  solver::TransportCounters counters;
  scatter(shots, sink, counters);
  for (const auto& shot : shots.lamps) lamps_.gather(shot, shots.webs, shots.flux_scale, sink, counters);
  if (sight_ == Sight::kRays && shots.mode != solver::LinkMode::kPaperMipmap) {
    gatherByRays(shots, sink, counters);
    if (const auto good = images_.check(); !good) return tl::unexpected(good.error());
    return counters;
  }
  for (const auto& shot : shots.gather) {
    gatherer_.gather(shot, shots.points.subspan(shot.first_point, shot.point_count), shots.flux_scale, images_,
                     *weights_, sink, counters);
  }
  for (const auto& shot : shots.point_lights) punctual_.gather(shot, shots.flux_scale, images_, sink, counters);
  for (const auto& shot : shots.parallel) {
    punctual_.gather(shot, shots.views, shots.flux_scale, images_, sink, counters);
  }
  if (const auto good = images_.check(); !good) return tl::unexpected(good.error());
  return counters;
}

void ShotRunner::gatherByRays(const ShotSpan& shots, const FluxSink& sink, solver::TransportCounters& counters) {
  for (const auto& shot : shots.gather)
    gatherer_.gather(shot, shots.points.subspan(shot.first_point, shot.point_count), shots.flux_scale, sink, counters);
  for (const auto& shot : shots.point_lights) punctual_.gather(shot, shots.flux_scale, sink, counters);
  for (const auto& shot : shots.parallel) punctual_.gather(shot, shots.views, shots.flux_scale, sink, counters);
}

void ShotRunner::scatter(const ShotSpan& shots, const FluxSink& sink, solver::TransportCounters& counters) {
  const auto pass = shots.mode == solver::LinkMode::kPaperMipmap ? HemicubePass::kPaper : HemicubePass::kNodes;
  std::vector<HemicubeView> views;
  for (std::size_t first = 0; first < shots.scatter.size();) {
    interruptionPoint();
    // Neighbours of equal resolution share an atlas.
    const auto resolution = shots.scatter[first].resolution;
    const auto capacity = images_.hemicubeCapacity(resolution);
    views.clear();
    auto last = first;
    for (; last < shots.scatter.size() && views.size() < capacity && shots.scatter[last].resolution == resolution;
         ++last) {
      views.push_back({shots.scatter[last].frame, shots.scatter[last].level_bias});
    }
    const auto images = images_.hemicubes(pass, resolution, views, counters);
    const auto start = std::chrono::steady_clock::now();
    const auto pixels = hemicubePixels(resolution);
    for (auto i = first; i < last; ++i) {
      const auto& shot = shots.scatter[i];
      accumulator_.accumulate(images.subspan((i - first) * pixels, pixels),
                              weights_->get(resolution, shot.frame.lattice), shot, shots.flux_scale, sink, counters);
    }
    counters.accumulate_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    first = last;
  }
}

}  // namespace radiosity::gpu
