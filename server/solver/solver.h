// Progressive radiosity of one scene: waves of shots from the strongest nodes (planar ones gathered as polygons, others
// scattered through hemicubes of mip-level patch IDs), direct light gathered from many points, whole rounds
// averaged until the stated error is reached. Owned by the solve loop; one thread. Carries no light itself: that is the
// Transport's.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/patch_scene.h"
#include "server/solver/estimate.h"
#include "server/solver/lights.h"
#include "server/solver/planner.h"
#include "server/solver/punctual_lights.h"
#include "server/solver/state.h"
#include "server/solver/transport.h"

namespace radiosity::solver {

struct SolverSettings {
  double target_error = 0.02;
  std::uint64_t seed = 1;
  /// Lum, Ma and Max 2002 to the letter: one round, direct light scattered, links chosen by the hardware's mipmapping,
  /// Gaussian over the unpushed irradiance. It stops when the residual reaches the target; its sampling error is what
  /// it is.
  bool paper_mode = false;
  PlannerSettings planner;
};

enum class StepOutcome {
  kShot,       ///< a wave was shot; the lightmaps are on their way
  kRoundDone,  ///< a round ended; irradiance() and error() are new
  kConverged,  ///< and the error is at most the target
  kExhausted,  ///< no further round fits the integers\' headroom; the error stays above the target
};

class Solver {
 public:
  Solver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
         solver::Transport& transport, const SolverSettings& settings, const LightSources& sources = {});

  /// One batch: some 10 to 100 ms of work. On error nothing has changed, except that the wave's light is taken as shot;
  /// the caller starts over with a new Solver.
  [[nodiscard]] Result<StepOutcome> step();

  /// Emission or reflectance changed: what was received stays, what is unshot follows. Shooting goes on.
  void setMaterials(const scene::PatchMaterials& materials);
  /// Lights without extent, or the sky, changed: only what they deliver is shot again, with opposite sign where less.
  void setLights(const LightSources& sources);
  /// Goes on with further rounds when the solve had stopped at a larger error.
  void setTargetError(double target);

  /// Brings irradiance() and error() up to date when the solve is stopped before its first round ended.
  void assess();

  /// Irradiance (lux) by node, level 0. In the first round it grows with every wave; later it is that of the last whole
  /// round.
  [[nodiscard]] const std::vector<glm::vec3>& irradiance() const { return irradiance_; }
  [[nodiscard]] const ErrorParts& error() const { return error_; }
  [[nodiscard]] EnergyParts energy() const;
  [[nodiscard]] const TransportCounters& transportCounters() const { return transport_counters_; }
  [[nodiscard]] const PlannerCounters& plannerCounters() const { return planner_.counters(); }
  [[nodiscard]] std::uint32_t rounds() const { return state_.rounds(); }
  [[nodiscard]] std::uint64_t shots() const {
    const auto& done = transport_counters_;
    return done.scatter_shots + done.gather_points + done.point_images + done.parallel_images;
  }
  [[nodiscard]] const RadiosityState& state() const { return state_; }

 private:
  enum class Phase { kDirect, kIndirect, kDone };
  [[nodiscard]] Result<StepOutcome> gatherDirect();
  [[nodiscard]] Result<StepOutcome> scatterIndirect();
  [[nodiscard]] StepOutcome finishRound();
  [[nodiscard]] Result<void> run(const ShotBatch& batch);
  void startRound();
  void restartRound();
  void publish();
  [[nodiscard]] double owedPower() const;
  [[nodiscard]] double roundPower() const;
  [[nodiscard]] double remainder() const;

  PunctualLights punctual_;
  RadiosityState state_;
  std::vector<LightPolygon> lights_;
  solver::Transport& transport_;
  SolverSettings settings_;
  Planner planner_;
  Phase phase_ = Phase::kDirect;
  bool polygons_due_ = false;  // the round's light polygons are still to be gathered
  bool live_ = true;           // show every wave: in the first round, and after an edit until the round ends
  FluxAccumulators batch_;
  TransportCounters transport_counters_;
  std::array<double, 3> gather_emitted_{};  // flux the gather shots stood for, over all rounds
  std::vector<glm::vec3> irradiance_;
  ErrorParts error_;
};

}  // namespace radiosity::solver
