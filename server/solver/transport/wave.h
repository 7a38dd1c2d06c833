// A wave of shots on its way. It goes to the transport in slices of some 50 ms, so that an edit, a pause or the end of
// the server need not wait for all of it. Everything delivered is a sum of integers: where the cuts lie, which depends
// on time, changes no bit. Owned by the Solver; one thread.
#pragma once

#include <cstddef>
#include <optional>

#include "common/result.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/shot_cost.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

class Wave {
 public:
  /// Of the scene, whose triangles and leaves tell the cost of a shot. No wave may be under way.
  void begin(ShotBatch batch, const scene::PatchScene& patches);
  [[nodiscard]] bool underWay() const { return under_way_; }

  /// Has the transport carry out the next slice and adds what was done to `counters`. True: that was the last one, and
  /// flux() is what the whole wave delivered. A slice that was put off comes again. After an error the wave is lost.
  [[nodiscard]] Result<bool> advance(Transport& transport, TransportCounters& counters);

  [[nodiscard]] FluxAccumulators& flux() { return flux_; }

 private:
  [[nodiscard]] ShotBatch nextSlice();
  template <typename Shot, typename Take>
  void fill(const std::vector<Shot>& shots, std::size_t& next, double target, double& cost, Take take) const;

  ShotBatch batch_;
  std::optional<ShotBatch> slice_;  // the next one, where it was put off
  FluxAccumulators flux_;
  ShotCost cost_{0.0};
  std::size_t next_gather_ = 0, next_scatter_ = 0;
  double cost_left_ = 0.0, slice_cost_ = 0.0;
  double cost_per_second_ = 0.0;  // of the last slice; 0: not known
  bool others_left_ = false;
  bool under_way_ = false;
};

}  // namespace radiosity::solver
