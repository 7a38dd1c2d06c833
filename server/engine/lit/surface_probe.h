// Measures, once light is solved for, how far the lightmaps are off where people look. Belongs to a LitScene, on the
// solve thread.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/scene/lightmap/lightmap.h"
#include "server/solver/surface/surface_error.h"

namespace radiosity::engine {

class SurfaceProbe {
 public:
  /// Light has changed, or what it was measured in is about to go.
  void forget() {
    measuring_.reset();
    stated_.reset();
    measured_.clear();
    given_up_ = false;
  }
  void giveUp() {
    forget();
    given_up_ = true;
  }
  /// Neither measured nor given up.
  [[nodiscard]] bool isLacking() const { return !stated_ && !given_up_; }
  [[nodiscard]] bool hasBegun() const { return measuring_ != nullptr; }
  /// `solved` is to stay as it is until forget(); lookups are made in `pages`. What is measured is to be told from
  /// `target`, the error that is asked for.
  void begin(const solver::SolvedScene& solved, std::uint64_t seed, std::span<const scene::LightmapPage> pages,
             double target);
  /// Once it has begun: goes on for about `seconds`. `is_late`: no longer than it must.
  void advance(double seconds, bool is_late);
  /// Nothing: it is not measured yet.
  [[nodiscard]] const std::optional<solver::SurfaceErrorParts>& stated() const { return stated_; }
  /// Place by place, what that was found by.
  [[nodiscard]] std::span<const solver::SurfaceError::Measured> measured() const { return measured_; }

 private:
  std::unique_ptr<solver::SurfaceError> measuring_;
  std::optional<solver::SurfaceErrorParts> stated_;
  std::vector<solver::SurfaceError::Measured> measured_;
  bool given_up_ = false;
};

}  // namespace radiosity::engine
