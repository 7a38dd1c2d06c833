// Progressive shooting that forgets its links, in memory that does not grow: waves of shots from the strongest nodes
// (planar ones gathered as polygons, others scattered through hemicubes of mip-level patch IDs), direct light gathered
// from many points, whole rounds averaged until the stated error is reached.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/shooting/direct_shots.h"
#include "server/solver/shooting/estimate.h"
#include "server/solver/shooting/planner.h"
#include "server/solver/shooting/state.h"
#include "server/solver/solver.h"
#include "server/solver/transport/transport.h"
#include "server/solver/transport/wave.h"

namespace radiosity::solver {

class ShootingSolver final : public Solver {
 public:
  ShootingSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                 Transport& transport, const SolverSettings& settings, const LightSources& sources = {});

  [[nodiscard]] Result<StepOutcome> step() override;
  void setMaterials(const scene::PatchMaterials& materials) override;
  /// Only what they deliver is shot again, with opposite sign where less.
  void setLights(const LightSources& sources) override;
  void setTargetError(double target) override;
  void assess() override;

  [[nodiscard]] std::vector<glm::vec3> irradiance() const override { return irradiance_; }
  [[nodiscard]] std::vector<glm::vec3> halfIrradiance(std::uint32_t half) const override;
  [[nodiscard]] std::vector<glm::vec3> unshot() const override;
  [[nodiscard]] std::vector<std::uint8_t> shotLevels() const override;
  [[nodiscard]] const ErrorParts& error() const override { return error_; }
  [[nodiscard]] EnergyParts energy() const override;
  [[nodiscard]] const TransportCounters& transportCounters() const override { return transport_counters_; }
  [[nodiscard]] const PlannerCounters& plannerCounters() const override { return planner_.counters(); }
  [[nodiscard]] std::uint32_t rounds() const override { return state_.rounds(); }
  [[nodiscard]] SolveLimit limit() const override {
    return state_.rounds() >= kMaxRounds ? SolveLimit::kRounds : SolveLimit::kNone;
  }
  [[nodiscard]] bool hasFluxScale() const override { return true; }
  [[nodiscard]] bool save(ArchiveWriter& to) const override;
  [[nodiscard]] bool restore(ArchiveReader& from) override;

 private:
  enum class Phase { kDirect, kIndirect, kDone };
  /// Flux sums have headroom for this many rounds (RadiosityState::chooseFluxScale).
  static constexpr std::uint32_t kMaxRounds = 1024;
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self);
  void planDirect();
  [[nodiscard]] bool planIndirect();
  void beginWave(ShotBatch batch, const std::array<double, 3>& emitted_before);
  [[nodiscard]] Result<StepOutcome> advanceWave();
  void land();
  [[nodiscard]] StepOutcome finishRound();
  /// Flux that all shots planned so far stand for.
  [[nodiscard]] std::array<double, 3> emittedFlux() const;
  void startRound();
  void restartRound();
  void publish();
  [[nodiscard]] double owedPower() const;
  [[nodiscard]] double roundPower() const;
  [[nodiscard]] double remainder() const;

  PunctualLights punctual_;
  RadiosityState state_;
  solver::Transport& transport_;
  SolverSettings settings_;
  DirectShots direct_;
  Planner planner_;
  Phase phase_ = Phase::kDirect;
  bool live_ = true;  // show every wave: in the first round, and after an edit until the round ends
  Wave wave_;
  bool wave_is_direct_ = false;
  std::array<double, 3> wave_flux_{};  // what the wave under way stands for
  TransportCounters transport_counters_;
  std::array<double, 3> gather_emitted_{};  // flux the gather shots stood for, over all rounds
  std::vector<glm::vec3> irradiance_;
  ErrorParts error_;
};

}  // namespace radiosity::solver
