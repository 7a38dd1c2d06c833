// Carries out shots, one after the other, with images from wherever its source has them. One thread.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "server/gpu/draw/image_source.h"
#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/gather/lamp_gatherer.h"
#include "server/gpu/gather/light_gatherer.h"
#include "server/gpu/gather/punctual_gatherer.h"
#include "server/gpu/gather/scatter_accumulator.h"
#include "server/gpu/run/sight.h"

namespace radiosity::gpu {

/// Part of a batch (or all of it). Gather shots index `points`, parallel shots `views`, lamps `webs`.
struct ShotSpan {
  solver::LinkMode mode = solver::LinkMode::kFormula;
  double flux_scale = 1.0;
  std::span<const solver::ScatterShot> scatter;
  std::span<const solver::GatherShot> gather;
  std::span<const solver::HemicubeFrame> points;
  std::span<const solver::PointShot> point_lights;
  std::span<const solver::ParallelShot> parallel;
  std::span<const solver::ParallelView> views;
  std::span<const solver::NodeRun> receivers;  ///< of gather shots that want not all
  std::span<const scene::ChangedBox> boxes;
  std::span<const solver::LampShot> lamps;
  std::span<const float> webs;  ///< of the lamps
};
[[nodiscard]] ShotSpan spanOf(const solver::ShotBatch& batch);

class ShotRunner {
 public:
  /// `weights` outlive it; others may use them at the same time.
  ShotRunner(ImageSource images, WeightCache& weights) : images_(std::move(images)), weights_(&weights) {}

  /// After the scene of the renderers.
  void setScene(const std::shared_ptr<const Receivers>& receivers, Sight sight);
  [[nodiscard]] Result<solver::TransportCounters> run(const ShotSpan& shots, const FluxSink& sink);
  /// Links of every gather shot, then of every scatter shot, each by itself (Transport::measure).
  [[nodiscard]] Result<solver::TransportCounters> measure(const ShotSpan& shots,
                                                          const solver::Transport::TakeLinks& take);
  /// measure() was interrupted in a shot that it got further with, and that the next one goes on with from there, if it
  /// comes first in it.
  [[nodiscard]] bool keepsPlace() const { return begun_ && gatherer_.place() > came_to_; }

 private:
  /// A shot with all that its links follow from.
  struct BegunShot {
    solver::GatherShot shot;  ///< that begins where the spans do
    std::vector<solver::HemicubeFrame> points;
    std::vector<solver::NodeRun> receivers;
    bool operator==(const BegunShot&) const = default;
  };
  [[nodiscard]] static BegunShot begunShot(const ShotSpan& shots, const solver::GatherShot& shot);
  void scatter(const ShotSpan& shots, const FluxSink& sink, solver::TransportCounters& counters);
  void measureGather(const ShotSpan& shots, const solver::Transport::TakeLinks& take,
                     solver::TransportCounters& counters);
  void measureScatter(const ShotSpan& shots, const solver::Transport::TakeLinks& take,
                      solver::TransportCounters& counters);

  void measureByRays(const ShotSpan& shots, const solver::Transport::TakeLinks& take,
                     solver::TransportCounters& counters);
  void gatherByRays(const ShotSpan& shots, const FluxSink& sink, solver::TransportCounters& counters);

  ImageSource images_;
  WeightCache* weights_;
  Sight sight_ = Sight::kImages;
  ScatterAccumulator accumulator_;
  LightGatherer gatherer_;
  std::optional<BegunShot> begun_;          ///< that gatherer_ is at, by rays
  std::array<std::uint32_t, 3> came_to_{};  ///< LightGatherer::place() when the present measure() took it up
  std::shared_ptr<const Receivers> receivers_;
  std::optional<FluxStore> link_store_;
  PunctualGatherer punctual_;
  LampGatherer lamps_;
};

/// kInternal, naming the shot, if the batch breaks the contract of transport.h (a peer process sent it).
[[nodiscard]] Result<void> checkShots(const ShotSpan& shots);

}  // namespace radiosity::gpu
