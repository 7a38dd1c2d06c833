// Grids of probes: what they need is read on the solve thread, and their light is told on any other.
#pragma once

#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <mutex>
#include <vector>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"
#include "server/scene/values/probe_grid.h"
#include "server/solver/probes/probe_set.h"

namespace radiosity::engine {

/// Of one moment; shared parts stay as they are.
struct ProbeParts {
  std::vector<scene::ProbeGrid> grids;
  std::shared_ptr<const scene::PatchScene> patches;
  scene::PatchMaterials materials;
  solver::LightSources sources;
  std::vector<glm::vec3> irradiance, difference;  ///< lux, by node of level 0; what the halves of the solve differ by
  double systematic = 1.0;                        ///< systematicPart()
  std::uint64_t seed = 1;
};

/// Errors as Engine::probes() has them; kInvalidScene: a grid lies outside of the scene. Cost: a copy of the light, but
/// where none is asked for.
[[nodiscard]] Result<ProbeParts> readProbes(const LitScene& lit, const ProbeRequest& request);

/// Keeps what probes see from one time to the next. One thread outside of the calls, but for letGo().
class ProbeKeeper {
 public:
  /// Of all grids of `parts`. Cost: a ray tree and ProbeSet of what is new, where only light differs a pass over the
  /// rays. On all cores, with interruption points: what was found by then stays. The same bits whatever was asked
  /// before. kTooLarge: mirrors send the rays of so many probes on too often.
  [[nodiscard]] Result<std::vector<ProbeGridLight>> light(const ProbeParts& parts);
  /// The scene is another: what is kept of the former goes, now or at the end of light(). Any thread; waits for none.
  void letGo();
  /// Their places alone.
  [[nodiscard]] static std::vector<ProbeGridLight> places(const ProbeParts& parts);

 private:
  struct Kept {
    scene::ProbeGrid grid;
    std::size_t in_all = 0;  ///< probes of all grids then, by which rays and memory are shared out
    std::unique_ptr<solver::ProbeSet> set;
  };
  void takeScene(const std::shared_ptr<const scene::PatchScene>& patches);
  void dropOthers(const ProbeParts& parts, std::size_t in_all, const solver::PlaceLight& light);
  [[nodiscard]] solver::ProbeSet& setOf(const scene::ProbeGrid& grid, std::size_t in_all, const ProbeParts& parts,
                                        const solver::PlaceLight& light);
  [[nodiscard]] Result<std::vector<ProbeGridLight>> lightOf(const ProbeParts& parts);
  void clear();
  void clearFormer();

  std::atomic<bool> is_former_ = false;  ///< what is kept is of a scene that is there no more
  std::mutex mutex_;                     ///< of all that follows
  // Of the scene that the rays are of; in the order in which each refers to those before.
  std::shared_ptr<const scene::PatchScene> patches_;
  std::unique_ptr<std::vector<solver::Side>> sides_;
  std::shared_ptr<const solver::LeafRays> rays_;
  std::uint64_t seed_ = 0;
  std::vector<Kept> kept_;
};

}  // namespace radiosity::engine
