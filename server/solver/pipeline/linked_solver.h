// Radiosity that remembers what it measured: the links of lamps, and of nodes so bright that rays would find them too
// seldom, and the rays that gather all other light. Every edit of light or colour runs over the links and rays there
// are.
//
// Lights: direct light, from many points. Grow: nodes that are bright become shooters. Improve, until the stated error
// is reached: more rays, or further samples of a shooter whose two halves differ, whichever lowers it most for its
// cost.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "common/result.h"
#include "server/solver/edits/change_reach.h"
#include "server/solver/error/field_error.h"
#include "server/solver/lamps/crowd.h"
#include "server/solver/lamps/light_tints.h"
#include "server/solver/links/link_memory.h"
#include "server/solver/links/link_planner.h"
#include "server/solver/links/link_system.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/unshot_pyramid.h"
#include "server/solver/pipeline/kept_ends.h"
#include "server/solver/pipeline/link_wave.h"
#include "server/solver/pipeline/shaded_light.h"
#include "server/solver/reflected/direct_smoothing.h"
#include "server/solver/reflected/leaf_gather.h"
#include "server/solver/repair/edit_repair.h"
#include "server/solver/repair/link_inheritance.h"
#include "server/solver/solver.h"
#include "server/solver/transport/node_shots.h"
#include "server/solver/variation/variation_stage.h"

namespace radiosity::solver {

class LinkedSolver final : public Solver {
 public:
  LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
               Transport& transport, const SolverSettings& settings, const LightSources& sources = {});
  /// After an edit of geometry: takes over the links of `former`, the solver of the scene before, that the edit left
  /// alone, and measures the others again with its first steps: same shooters, same points, so that links are those
  /// that a fresh measurement of all would find (and what lamps lose what it would, or a little more). Of shooters that
  /// see the change, only links to leaves whose ways to them pass it are measured (Shadows). `keep_former`: it stays
  /// what it was; else its links go as they are taken over, so that memory never holds them twice, and it is of no use
  /// afterwards.
  LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
               Transport& transport, const SolverSettings& settings, const LightSources& sources, LinkedSolver& former,
               const scene::PatchMap& map, bool keep_former = false);

  /// Light is told for these normals; all else, and error(), is for geometric ones. Before the first step.
  void shadeFor(std::shared_ptr<const scene::ShadingNormals> normals);

  [[nodiscard]] Result<StepOutcome> step() override;
  void setMaterials(const scene::PatchMaterials& materials) override;
  void setLights(const LightSources& sources) override;
  void setTargetError(double target) override;
  void endWave() override;
  void assess() override;

  [[nodiscard]] std::vector<glm::vec3> irradiance() const override;
  [[nodiscard]] std::vector<glm::vec3> halfIrradiance(std::uint32_t half) const override;
  [[nodiscard]] std::vector<glm::vec3> directIrradiance() const override;
  [[nodiscard]] bool isRepairing() const override { return repair_.isRepairing(); }
  [[nodiscard]] bool isUnsettled() const override { return from_links_ == FromLinks::kAfterEdit; }
  /// When all links are there, the light over them is still to be solved for.
  [[nodiscard]] bool isBehind() const override {
    return repair_.lacksLinks() ||
           (phase_ == Phase::kDone && (from_links_ == FromLinks::kToConfirm || assessing_ != Assessed::kNothing));
  }
  [[nodiscard]] std::vector<glm::vec3> unshot() const override;
  [[nodiscard]] std::vector<std::uint8_t> shotLevels() const override;
  [[nodiscard]] std::vector<glm::vec3> commonErrorSquared() const override;
  [[nodiscard]] const ErrorParts& error() const override { return error_; }
  [[nodiscard]] EnergyParts energy() const override;
  [[nodiscard]] bool showsMirrors() const override { return true; }
  /// Some of its scene is coloured glass.
  [[nodiscard]] bool hasTints() const { return tints_.isNeeded(); }
  [[nodiscard]] double spreadByMirrors() const override;
  [[nodiscard]] std::shared_ptr<const LeafRays> rays() override { return leafRays(); }
  [[nodiscard]] const TransportCounters& transportCounters() const override { return counters_; }
  [[nodiscard]] const PlannerCounters& plannerCounters() const override { return planner_.counters(); }
  [[nodiscard]] std::uint32_t rounds() const override { return rounds_; }
  [[nodiscard]] SolveLimit limit() const override { return limit_; }
  [[nodiscard]] LinkCounters linkCounters() const override;
  [[nodiscard]] std::uint64_t affectedSamples() const override { return repair_.affectedSamples(); }
  [[nodiscard]] bool hasFluxScale() const override { return false; }
  [[nodiscard]] bool save(ArchiveWriter& to) const override;
  [[nodiscard]] bool restore(ArchiveReader& from) override;

  /// Whether there is memory for the rays of a scene.
  [[nodiscard]] static bool mayGather(const scene::PatchScene& patches, const SolverSettings& settings);
  /// After an edit of geometry: no light before all links are true.
  void beExact() { repair_.beExact(); }
  /// What the links of all lights can come to take.
  [[nodiscard]] std::size_t lightBytes() const;
  /// What is remembered.
  [[nodiscard]] const LinkSystem& system() const { return system_; }
  /// The rays that reflected light comes by; null: it is not there yet.
  [[nodiscard]] const LeafGather* gathered() const { return gather_.get(); }

 private:
  enum class Phase { kLights, kGrow, kImprove, kDone };
  /// Solving over links goes in slices too: which of its passes is under way.
  enum class Pass { kNone, kFirst, kSecond, kTints, kRays };
  /// What a solution over nothing but the links is for.
  enum class FromLinks { kNo, kAfterEdit, kToConfirm };
  /// What was reached and is being assessed, for which paths may have to be traced.
  enum class Assessed { kNothing, kRound, kEdit, kSolution };

  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self);
  /// All but its light.
  LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, Transport& transport, const SolverSettings& settings);
  [[nodiscard]] ChangeReach prepareRepair(const LinkedSolver& former, const LinkInheritance& links,
                                          const scene::PatchMap& map);
  void takeCounts(const LinkedSolver& former);
  void inheritVariation(const LinkedSolver& former, std::span<const std::uint32_t> value_before);
  [[nodiscard]] double errorBesideMissing() const;
  [[nodiscard]] double fieldNorm() const;
  [[nodiscard]] bool findsMoreDue();
  [[nodiscard]] bool isDueForTarget();
  [[nodiscard]] Result<void> repairSlice();
  /// Rounds are counted on from edit to edit, and no number of edits takes them away from those that follow.
  [[nodiscard]] bool hasRounds() const { return rounds_ - rounds_before_edit_ < settings_.max_rounds; }
  [[nodiscard]] std::vector<Measurement> plan();
  [[nodiscard]] std::vector<Measurement> planLights();
  [[nodiscard]] bool forgetWeakest();
  void takeCrowds(const std::vector<Crowd>& crowds);
  void addCrowd(const Crowd& crowd);
  [[nodiscard]] bool restoreCrowds(ArchiveReader& from);
  [[nodiscard]] bool restoreShown(ArchiveReader& from);
  [[nodiscard]] bool hasTooManyLamps() const;
  void takeSources(const LightSources& sources);
  void addSource(const PunctualLights::Source& source);
  [[nodiscard]] std::array<double, 3> skyFlux() const;
  [[nodiscard]] double powerToShoot() const;
  [[nodiscard]] double lostPart() const;
  void solveAnew();
  void dropNodes();
  [[nodiscard]] bool advanceSolution();
  [[nodiscard]] bool settleFromLinks();
  [[nodiscard]] bool finishEdit();
  [[nodiscard]] bool choosesAfterEdit();
  [[nodiscard]] StepOutcome assessed();
  [[nodiscard]] bool mayGoWithout();
  [[nodiscard]] bool tintLinks();
  [[nodiscard]] bool lacksTint() const;
  [[nodiscard]] bool lightLeaves();
  /// Returns what ShadedLight is to make of the change.
  [[nodiscard]] ShadedLight::Values smoothDirect(DirectSmoothing& smoothing, DirectSmoothing::Halves& halves) const;
  [[nodiscard]] std::vector<float> commonOfLeaves() const;
  [[nodiscard]] ShootersAndLights shootersAndLights() const { return {system_, lights_, sources_, crowds_}; }
  void takeMaterials(const scene::PatchMaterials& materials);
  void takeLights();
  void findImages();
  [[nodiscard]] bool settle();
  enum class Unshot { kNotByRays, kByRaysToo };
  void findUnshot(Unshot which = Unshot::kNotByRays);
  /// Shooters stand for what they sent, and rays for all that is left.
  [[nodiscard]] bool isAllSent(Unshot which) const { return gathers() && which == Unshot::kNotByRays; }
  [[nodiscard]] std::uint32_t nodeOf(std::uint32_t value) const;
  /// Of a leaf value, without what varies within leaves.
  [[nodiscard]] glm::vec3 lightOf(std::size_t value) const { return 0.5F * (half_[0][value] + half_[1][value]); }
  /// While it lives unshot light is what no shooter stands for, whether rays bring it or not. Within another of its
  /// kind it does nothing.
  class AllUnshot {
   public:
    explicit AllUnshot(LinkedSolver& solver) : solver_(solver), is_outer_(solver.gathers() && !solver.all_unshot_) {
      if (!is_outer_) return;
      solver_.findUnshot(Unshot::kByRaysToo);
      solver_.all_unshot_ = true;
    }
    ~AllUnshot() {
      if (!is_outer_) return;
      solver_.all_unshot_ = false;
      solver_.tryNow([this] { solver_.findUnshot(); });
    }
    AllUnshot(const AllUnshot&) = delete;
    AllUnshot& operator=(const AllUnshot&) = delete;

   private:
    LinkedSolver& solver_;
    bool is_outer_;
  };
  [[nodiscard]] bool wantsLamp() const;
  [[nodiscard]] bool sideShines(std::uint32_t side) const;
  [[nodiscard]] bool assessStep();
  /// What the halves' light says, of all leaves; received and reflected flux.
  struct FieldSums {
    FieldError field;
    double received = 0.0, reflected = 0.0;
  };
  [[nodiscard]] FieldSums assessField() const;
  [[nodiscard]] double inMirrors() const;
  [[nodiscard]] std::vector<glm::vec3> spreadLight() const;
  [[nodiscard]] std::array<double, 3> spreadFlux() const;
  [[nodiscard]] std::array<double, 3> imagesThatLeave() const;
  void updateVariation();
  [[nodiscard]] bool withLeafLight(const std::function<bool(const LeafLight&)>& work) const;
  [[nodiscard]] bool wantsVariation() const;
  [[nodiscard]] bool refineVariation();
  [[nodiscard]] double targetOfLinks() const;
  [[nodiscard]] bool aimFurther();
  /// Rays have brought light, and nothing is left to shoot.
  [[nodiscard]] bool gathers() const { return gather_ && gather_->hasGathered(); }
  [[nodiscard]] double shotCost() const;
  [[nodiscard]] double rayCost() const;
  [[nodiscard]] double samplesCost() const;
  [[nodiscard]] double usualRadiosity() const;
  [[nodiscard]] std::vector<double> leastRadiosity() const;
  struct Noise {
    double rays = 0.0, links = 0.0;  ///< squares of relative errors; what smoothing took is shared out between them
  };
  [[nodiscard]] Noise noise() const;
  /// By leaf value.
  [[nodiscard]] std::vector<glm::vec3> ofLeaves(const scene::SideColours& colours) const;
  [[nodiscard]] std::vector<glm::vec3> shiningOfLeaves() const;
  [[nodiscard]] std::vector<glm::vec3> lampsOfLeaves() const;
  [[nodiscard]] std::vector<glm::vec3> imagedLamps() const;
  [[nodiscard]] LeftLight leftLight() const;
  [[nodiscard]] glm::dvec3 passedFlux(const Side& side) const;
  [[nodiscard]] glm::dvec3 passedFlux(const PassingLeaf& leaf) const;
  [[nodiscard]] std::vector<bool> lightOverLinks() const;
  void startRays();
  [[nodiscard]] std::shared_ptr<const LeafRays> leafRays();
  void inheritRays(const LinkedSolver& former, std::span<const std::uint32_t> value_before);
  [[nodiscard]] StepOutcome chooseRays();
  [[nodiscard]] bool refineBlotches();
  [[nodiscard]] double blotch() const;
  void leafUnshot(std::uint32_t side, std::vector<glm::vec3>& leaves, Unshot which = Unshot::kNotByRays) const;
  void startGrowth();
  [[nodiscard]] Result<StepOutcome> advance();
  [[nodiscard]] StepOutcome finishRound();
  [[nodiscard]] StepOutcome chooseNext();
  [[nodiscard]] StepOutcome exhausted(SolveLimit limit);
  [[nodiscard]] StepOutcome ended() const;
  [[nodiscard]] std::uint64_t lightKey() const;
  [[nodiscard]] bool takeKeptEnd();
  void endHere();
  [[nodiscard]] std::span<const LeafVariation::Correction> corrections() const;
  [[nodiscard]] StepOutcome confirm();
  [[nodiscard]] StepOutcome chooseFurther();
  void tryNow(const std::function<void()>& work);

  std::shared_ptr<const scene::PatchScene> patches_;
  Transport& transport_;
  SolverSettings settings_;
  std::vector<Side> sides_;
  std::vector<LightPolygon> lights_;  // those switched off stay, dark: their links are still good
  std::vector<Crowd> crowds_;         // likewise
  PunctualLights punctual_;
  std::vector<PunctualLights::Source> sources_;  // those switched off stay, dark
  std::vector<PunctualLights::Source> sky_;      // its hemispheres, where rays bring their light
  NodeShots shots_;
  LinkSystem system_;
  LinkExpander expander_;
  LinkMemory memory_;
  UnshotPyramid unshot_;
  LinkPlanner planner_;
  std::shared_ptr<const LeafRays> leaf_rays_;      // of rays and paths; null: not asked for yet
  std::shared_ptr<const SpecularLeaves> mirrors_;  // null: none
  LightTints tints_;                               // of light over links
  double tint_noise_ = 0.0;                        // LinkSystem::tintNoise(), of the light that there is
  std::vector<std::uint32_t> looking_;             // shooters that are being looked at for it
  /// Those of which it is known, ascending.
  std::vector<std::uint32_t> tinted_;  // shooters that these are of
  MirroredLamps::Lamps in_mirrors_;
  float least_imaged_ = 0.0F;           // emission of the former, at least
  std::unique_ptr<LeafGather> gather_;  // of reflected light; null: lights, and what is bright, are not measured
  double sampled_alone_ = 0.0;          // error before the last round that brought samples and no rays; 0: none did
  double sample_goal_ = 0.0;            // sampling error that further samples of links shall reach; 0: none
  LinkParts parts_;                     // views of these
  EditRepair repair_;                   // of links that an edit of geometry may have changed
  KeyEnds key_ends_;
  Phase phase_ = Phase::kLights;
  SolveLimit limit_ = SolveLimit::kNone;
  bool lights_fit_ = true;  // no light goes without links for want of memory
  Pass pass_ = Pass::kNone;
  FromLinks from_links_ = FromLinks::kNo;
  bool edit_lights_planned_ = false;  // of the edit being taken in
  bool is_confirmed_ = false;         // the light that there is was solved for from links and rays alone, just now
  bool settling_ = false;             // a wave is measured, its light is still to be solved for
  LinkWave wave_;                     // under way
  bool growing_ = true;               // light is still missing: until the first walk found nothing more to add
  double aim_ = 0.0;                  // error that is worked towards, step by step down to the target
  std::uint32_t rounds_ = 0, rounds_before_edit_ = 0;
  std::uint64_t solutions_ = 0, sweeps_ = 0, replayed_ = 0;
  double varying_ = 0.0, net_unshot_ = 0.0;     // flux, all channels
  bool all_unshot_ = false;                     // an AllUnshot lives
  std::array<std::vector<glm::vec3>, 2> half_;  // irradiance by leaf value
  ShadedLight shaded_;                          // to be added to half_ where it is told
  DirectSmoothing direct_smoothing_;
  std::array<std::vector<glm::vec3>, 2> over_links_;  // of a new solution, while what rays bring is solved for
  VariationStage variation_;                          // once little else is in error
  Assessed assessing_ = Assessed::kNothing;
  bool refined_ = false;   // more paths were traced: what is next is to be chosen anew
  double by_links_ = 0.0;  // sampling error without the noise of that
  ErrorParts error_;
  KeptEnds ends_;
  std::shared_ptr<const KeptEnd> shown_;  // what is told is that; null: it is what was solved for last
  TransportCounters counters_;
};

}  // namespace radiosity::solver
