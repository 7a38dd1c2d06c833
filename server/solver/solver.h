// Progressive radiosity of one scene. Three ways: LinkedSolver (the default) remembers the links of lamps, and gathers
// reflected light by rays that it remembers, too; ShootingSolver remembers neither, and averages whole rounds of shots,
// where memory is scarce; PaperSolver follows Lum, Ma and Max (2002). Owned by the solve loop; one thread. Carries no
// light itself: that is the Transport's.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "common/archive.h"
#include "common/method.h"
#include "common/result.h"
#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/error/error_parts.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/planner_settings.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

class LeafRays;

struct SolverSettings {
  double target_error = 0.02;
  std::uint64_t seed = 1;
  Method method = Method::kGather;
  /// Whether light that varies within leaves is looked for, stated, and corrected. Without, leaves are lumped: each
  /// shoots its mean, and that alone is what the error is about.
  bool within_leaves = true;
  /// Bytes that remembered links and rays never exceed, half of it each. When they are used up the solve ends above its
  /// target. A scene whose rays would not fit, or whose lights alone would take half of it, is solved by averaged
  /// shooting, which remembers neither.
  std::size_t link_memory = std::size_t{1} << 30;
  /// A gathered solve ends, whatever its error, so many rounds after the last edit or its start: no round helps then.
  std::uint32_t max_rounds = 100'000;
  PlannerSettings planner;
};

enum class StepOutcome {
  kSlice,      ///< a part of a wave was shot; nothing new to show
  kShot,       ///< a wave was shot; the lightmaps are on their way
  kRoundDone,  ///< irradiance() and error() are new
  kConverged,  ///< and the error is at most the target
  kExhausted,  ///< nothing more can be done here; the error stays above the target
};

/// What keeps a solve above its target when it is exhausted.
enum class SolveLimit {
  kNone,
  kLinkMemory,  ///< SolverSettings::link_memory
  kRounds,      ///< as many rounds as sums have room for
  kPatches,     ///< no sample can lower the error any more
  kWithin,      ///< light that varies within leaves
  kRays,        ///< every leaf has as many rays as it may have
};

/// What is remembered, and what for, for reports.
struct LinkCounters {
  std::uint64_t bytes = 0;       ///< that all links take
  std::uint64_t shooters = 0;    ///< that have links
  std::uint64_t samples = 0;     ///< hemicubes or gathered polygons, or sequences of images of a light, taken for them
  std::uint64_t solutions = 0;   ///< of the equation over the links: all bounces without another hemicube
  std::uint64_t sweeps = 0;      ///< of these solutions
  std::uint64_t replayed = 0;    ///< links of shooters used once more in these sweeps: as many shots were not shot
  std::uint64_t rows = 0;        ///< of the equation, in each half
  std::uint64_t rows_saved = 0;  ///< where reflectance is uniform one row serves three channels
  // Of edits of geometry, in all: samples that no change was seen from; that were taken again for the leaves whose
  // links may have changed, and how many these were; that were taken again. And those that still wait for that.
  std::uint64_t kept = 0, repaired = 0, repaired_links = 0, retaken = 0, waiting = 0;
  std::uint64_t own_looks = 0;  ///< of leaves at lamps, for themselves
  std::uint64_t rays = 0;       ///< that leaves gather by
  std::uint64_t rays_kept = 0;  ///< of these, that an edit of geometry left as they were
};

class Solver {
 public:
  virtual ~Solver() = default;

  /// A slice of a wave: some 10 to 100 ms of work. On an error of the transport the caller starts over with a new
  /// Solver.
  [[nodiscard]] virtual Result<StepOutcome> step() = 0;

  /// Emission or reflectance changed: nothing is invalidated; shooting goes on.
  virtual void setMaterials(const scene::PatchMaterials& materials) = 0;
  /// Lights without extent, or the sky, changed.
  virtual void setLights(const LightSources& sources) = 0;
  /// Goes on when the solve had stopped at a larger error. What is measured keeps the pixels that sufficed for that
  /// one.
  virtual void setTargetError(double target) = 0;
  /// Time is short: what is still to be measured of the wave is left out where that can be done, and the next steps
  /// bring to an end what there is.
  virtual void endWave() {}
  /// Brings irradiance() and error() up to date when the solve is stopped before its first round ended.
  virtual void assess() = 0;

  /// Irradiance (lux) by node, level 0; for the shading normal where there is one (makeSolver), as are its halves and
  /// its direct part. Grows with every wave at first; later it changes from round to round. Summed up
  /// at each call, O(nodes).
  [[nodiscard]] virtual std::vector<glm::vec3> irradiance() const = 0;
  /// The same from one of the two independent halves of the samples.
  [[nodiscard]] virtual std::vector<glm::vec3> halfIrradiance(std::uint32_t half) const = 0;
  /// The part of irradiance that comes straight from lights, by node, level 0; empty: not known, or not by itself.
  /// Costs a pass over the lights' links.
  [[nodiscard]] virtual std::vector<glm::vec3> directIrradiance() const { return {}; }
  /// After an edit of geometry: irradiance() is not there yet, since links are being measured again.
  [[nodiscard]] virtual bool isRepairing() const { return false; }
  /// An edit is still to be taken in: irradiance() is the light before it, and assess() would take the time of several
  /// steps.
  [[nodiscard]] virtual bool isUnsettled() const { return false; }
  /// After an edit of geometry: links that matter little beside the target error are still those of before, which
  /// error() counts. Further steps after kConverged measure them, and end with kConverged once more.
  [[nodiscard]] virtual bool isBehind() const { return false; }
  /// Radiosity (lm/m^2, signed) by node, level 0, that is still to be shot. What light polygons emit is not in it: they
  /// are owed by the light, not by its leaves.
  [[nodiscard]] virtual std::vector<glm::vec3> unshot() const = 0;
  /// By node, level 0: the level of the node that last shot for this leaf; kNeverShot where none has.
  [[nodiscard]] virtual std::vector<std::uint8_t> shotLevels() const = 0;
  static constexpr std::uint8_t kNeverShot = 255;
  /// Squares of what of error().sampling the halves do not differ by, lux^2 by channel and node of level 0; empty: no
  /// such error is known.
  [[nodiscard]] virtual std::vector<glm::vec3> commonErrorSquared() const { return {}; }
  [[nodiscard]] virtual const ErrorParts& error() const = 0;
  [[nodiscard]] virtual EnergyParts energy() const = 0;
  /// Whether light goes by way of mirrors, metal and glass at all.
  [[nodiscard]] virtual bool showsMirrors() const { return false; }
  /// Flux, all channels, that mirrors and metal reflect of the light of lamps that are no surfaces. It leaves as if it
  /// was diffuse: rays do not find these lamps in mirrors. What glass reflects of them is left out.
  [[nodiscard]] virtual double spreadByMirrors() const { return 0.0; }
  /// What leaves are asked by that see by rays, made now where it is not there yet; null: this solver has none.
  [[nodiscard]] virtual std::shared_ptr<const LeafRays> rays() { return nullptr; }
  [[nodiscard]] virtual const TransportCounters& transportCounters() const = 0;
  [[nodiscard]] virtual const PlannerCounters& plannerCounters() const = 0;
  [[nodiscard]] virtual std::uint32_t rounds() const = 0;
  /// Why the last step() said kExhausted.
  [[nodiscard]] virtual SolveLimit limit() const = 0;
  /// Samples that an edit of geometry made it take again, in part or as a whole; known as soon as it is made.
  [[nodiscard]] virtual std::uint64_t affectedSamples() const { return shots(); }
  /// All zero where links are forgotten.
  [[nodiscard]] virtual LinkCounters linkCounters() const { return {}; }
  /// Flux is kept as integers whose scale was chosen for the light at the start: very different light needs a new
  /// solver.
  [[nodiscard]] virtual bool hasFluxScale() const = 0;

  /// Appends all that it takes to go on later, in the same program, with the same bits. False, and nothing of use
  /// appended, in the middle of something: after one of the next steps it can. Cost: a copy of all links.
  [[nodiscard]] virtual bool save(ArchiveWriter& to) const = 0;
  /// Goes on from what save() wrote. For a new solver, made for the same patches, materials, lights and settings.
  /// False: it was written for something else, and this solver is good for nothing any more.
  [[nodiscard]] virtual bool restore(ArchiveReader& from) = 0;

  [[nodiscard]] std::uint64_t shots() const {
    const auto& done = transportCounters();
    return done.scatter_shots + done.gather_points + done.point_images + done.parallel_images;
  }
};

/// The solver of a scene before an edit of its geometry, and what the edited scene has in common with it.
struct FormerSolver {
  Solver& solver;
  const scene::PatchMap& map;
  bool keep = false;  ///< it stays what it is; else it gives up what it remembers and is of no use afterwards
};

}  // namespace radiosity::solver
