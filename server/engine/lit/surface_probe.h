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
  }
  /// Goes on for about `seconds`, from the beginning where there is none yet. `solved` is to stay as it is until
  /// forget(); `make_pages` makes what lookups are made in.
  template <typename MakePages>
  void advance(const solver::SolvedScene& solved, std::uint64_t seed, const MakePages& make_pages, double seconds) {
    if (!measuring_) begin(solved, seed, make_pages());
    if (!measuring_->advance(seconds)) return;
    stated_ = measuring_->stated();
    measured_ = measuring_->measured();
    measuring_.reset();
  }
  /// Nothing: it is not measured yet.
  [[nodiscard]] const std::optional<solver::SurfaceErrorParts>& stated() const { return stated_; }
  /// Place by place, what that was found by.
  [[nodiscard]] std::span<const solver::SurfaceError::Measured> measured() const { return measured_; }

 private:
  void begin(const solver::SolvedScene& solved, std::uint64_t seed, const std::vector<scene::LightmapPage>& pages);

  std::unique_ptr<solver::SurfaceError> measuring_;
  std::optional<solver::SurfaceErrorParts> stated_;
  std::vector<solver::SurfaceError::Measured> measured_;
};

}  // namespace radiosity::engine
