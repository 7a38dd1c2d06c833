// Solves scenes in process, from GLB through importer, charts and the OpenGL transport to the solver's end, so that a
// test can reach between the parts. Throws std::runtime_error when something on the way fails.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"
#include "server/solver/solver.h"
#include "tests/scenes/scene.h"

namespace radiosity::accuracy {

struct Loaded {
  scene::Scene scene;
  std::shared_ptr<const scene::PatchScene> patches;
  scene::PatchMaterials materials;  ///< may be changed before the solve
};

[[nodiscard]] Loaded loadGlb(const std::vector<std::uint8_t>& glb, const scene::ChartOptions& charts);
[[nodiscard]] Loaded load(const test_scenes::TestScene& scene, std::uint64_t texels);

/// A closed room 2 x 1.5 x 2.5 m with a coloured block that hangs in it and a lamp below its ceiling. Lengths are
/// multiplied by `scale`; every object's origin is moved by `offset_m`.
[[nodiscard]] test_scenes::TestScene litRoom(double scale = 1.0, glm::dvec3 offset_m = glm::dvec3(0.0));

/// The same reflectance everywhere, past the importer's clamp.
void paint(Loaded& loaded, float reflectance);

/// A solver that is not done, and what carries its light: one OpenGL context in this thread, or worker processes.
class Solve {
 public:
  explicit Solve(const Loaded& loaded, const solver::SolverSettings& settings = {}, int workers = 0);

  /// Steps until the solver stops of itself; true: at its target. False too after `most_steps`.
  bool run(int most_steps = 1'000'000);
  /// Emission and reflectance of the scene become these, and the solve goes on to its end.
  bool edit(const scene::PatchMaterials& materials);

  [[nodiscard]] solver::Solver& solver() { return *solver_; }
  [[nodiscard]] const solver::Solver& solver() const { return *solver_; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }

  /// Calls visit(node, area, irradiance) for every leaf with area; areas in the unit box.
  template <typename Visit>
  void eachLeaf(const Visit& visit) const {
    const auto light = solver_->irradiance();
    for (const auto& surface : patches_->surfaces) {
      for (const auto first : surface.first_node) {
        if (first == scene::kNone) continue;
        for (auto node = first; node < first + surface.width * surface.height; ++node) {
          if (const auto area = static_cast<double>(patches_->node_area[node]); area > 0.0)
            visit(node, area, glm::dvec3(light[node]));
        }
      }
    }
  }

 private:
  std::shared_ptr<const scene::PatchScene> patches_;
  std::unique_ptr<solver::Transport> transport_;
  std::unique_ptr<solver::Solver> solver_;
};

/// Against one value that every leaf should have, in every channel.
struct FromConstant {
  double mean = 0.0;  ///< of all light received, relative
  double rms = 0.0;   ///< relative, by area
};
[[nodiscard]] FromConstant compareToConstant(const Solve& solve, double exact);

/// Largest difference of any leaf and channel between two solves of the same patches, over the RMS irradiance.
[[nodiscard]] double largestDifference(const Solve& a, const Solve& b, double scale_of_b = 1.0);

/// Expects every irradiance finite and not negative, and emitted = absorbed + specular + escaped + backface + unshot +
/// imbalance to 1e-6 of what is emitted.
void expectSound(const Solve& solve);

}  // namespace radiosity::accuracy
