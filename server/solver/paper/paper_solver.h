// Progressive radiosity as Lum, Ma and Max (2002) describe it; README.md maps their sections to the functions here. One
// shooter at a time: chosen greedily, its hemicube drawn with mipmapped patch IDs, what it sends added to nodes of any
// level, pushed and pulled only when it must be. Owned by the solve loop; one thread.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/paper/patch_trees.h"
#include "server/solver/solver.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

class PaperSolver final : public Solver {
 public:
  PaperSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
              Transport& transport, const SolverSettings& settings, const LightSources& sources = {});

  /// One shot. After an error what it took is lost: the caller makes a new solver.
  [[nodiscard]] Result<StepOutcome> step() override;
  /// "Recalculation of the entire radiosity solution from scratch" (section 1).
  void setMaterials(const scene::PatchMaterials& materials) override;
  void setLights(const LightSources& sources) override;
  void setTargetError(double target) override;
  void assess() override { settleError(); }

  [[nodiscard]] std::vector<glm::vec3> irradiance() const override;
  /// There is one set of samples: both halves are it.
  [[nodiscard]] std::vector<glm::vec3> halfIrradiance(std::uint32_t /*half*/) const override { return irradiance(); }
  [[nodiscard]] std::vector<glm::vec3> unshot() const override;
  [[nodiscard]] std::vector<std::uint8_t> shotLevels() const override { return shot_level_; }
  /// `residual` alone: the method does not know what its samples are off by.
  [[nodiscard]] const ErrorParts& error() const override { return error_; }
  [[nodiscard]] EnergyParts energy() const override;
  [[nodiscard]] const TransportCounters& transportCounters() const override { return transport_counters_; }
  [[nodiscard]] const PlannerCounters& plannerCounters() const override { return counters_; }
  [[nodiscard]] std::uint32_t rounds() const override { return 1; }
  [[nodiscard]] SolveLimit limit() const override { return SolveLimit::kNone; }
  [[nodiscard]] bool hasFluxScale() const override { return true; }
  [[nodiscard]] bool save(ArchiveWriter& to) const override;
  [[nodiscard]] bool restore(ArchiveReader& from) override;

 private:
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self);
  void startAnew();
  [[nodiscard]] std::optional<NodePlace> chooseShooter();
  [[nodiscard]] NodePlace descend(std::uint32_t side) const;
  [[nodiscard]] std::optional<ScatterShot> shotFrom(const NodePlace& node);
  [[nodiscard]] std::uint32_t resolutionFor(double power) const;
  [[nodiscard]] Result<void> carry(const ShotBatch& batch);
  void settleError();
  [[nodiscard]] double passedPart(const Side& side) const;
  [[nodiscard]] const PatchTrees& shown() const;
  [[nodiscard]] bool isDone() const { return error_.residual <= settings_.target_error; }

  std::shared_ptr<const scene::PatchScene> patches_;
  scene::PatchMaterials materials_;
  Transport& transport_;
  SolverSettings settings_;
  LightSources sources_;
  PunctualLights punctual_;
  PatchTrees trees_;
  /// The same with nothing put off, for those who look, so that no look changes which patch shoots next; until the next
  /// shot.
  mutable std::optional<PatchTrees> shown_;
  FluxAccumulators flux_;  ///< of one shot
  glm::dvec3 emitted_{0.0};
  double received_ = 0.0, reflected_ = 0.0;  ///< by all shots so far, all channels
  double share_ = 0.0;                       ///< power of a shot, about
  std::vector<std::uint8_t> shot_level_;     ///< by node, of leaves
  ErrorParts error_;
  TransportCounters transport_counters_;
  PlannerCounters counters_;
  std::uint64_t shots_ = 0;
};

}  // namespace radiosity::solver
