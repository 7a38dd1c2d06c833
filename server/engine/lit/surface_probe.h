// Measures, once light is solved for, how far the lightmaps are off where people look. Belongs to a LitScene, on the
// solve thread.
#pragma once

#include <memory>
#include <optional>
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
  }
  /// Goes on for about `seconds`, from the beginning where there is none yet. `solved` is to stay as it is until
  /// forget(); `make_pages` makes what lookups are made in.
  template <typename MakePages>
  void advance(const solver::SolvedScene& solved, std::uint64_t seed, const MakePages& make_pages, double seconds) {
    if (!measuring_) begin(solved, seed, make_pages());
    if (!measuring_->advance(seconds)) return;
    stated_ = measuring_->stated();
    measuring_.reset();
  }
  /// Nothing: it is not measured yet.
  [[nodiscard]] const std::optional<solver::SurfaceErrorParts>& stated() const { return stated_; }

 private:
  void begin(const solver::SolvedScene& solved, std::uint64_t seed, const std::vector<scene::LightmapPage>& pages);

  std::unique_ptr<solver::SurfaceError> measuring_;
  std::optional<solver::SurfaceErrorParts> stated_;
};

}  // namespace radiosity::engine
