// What becomes of the light of a scene, for people: lamps whose light reaches nothing, each with the reason, and rooms
// that are turned inside out. Belongs to a LitScene, on the solve thread.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"
#include "server/solver/solver.h"

namespace radiosity::engine {

/// What a report is made of.
struct LitParts {
  const scene::Document& document;
  const scene::Scene& scene;
  const scene::PatchScene& patches;
  const scene::PatchMaterials& materials;
  const solver::LightSources& sources;
};

class LightReport {
 public:
  /// Lamps that shine with nothing: buried, covered, black, without area. Once for each scene, and when its light has
  /// changed. Cost: a pass over the instances, and over the leaves of lamps.
  void findDark(const LitParts& parts);

  /// After a solve: lamps whose light reaches nothing, and on which surfaces' backs it ends where more than 5 % of it
  /// do. Rays are asked only where so much light is lost that there may be such lamps.
  void findLost(const LitParts& parts, solver::Solver& solver);

  /// Nothing is known of a solve any more.
  void forgetLost() { lost_.clear(); }

  /// Why nothing is lit, in a few words; empty: something is, or may be when the scene is solved. `power`: emitted, all
  /// channels.
  [[nodiscard]] std::string unlit(double power, const solver::EnergyParts& energy, bool is_solved) const;

  [[nodiscard]] const std::vector<std::string>& dark() const { return dark_; }
  [[nodiscard]] const std::vector<std::string>& lost() const { return lost_; }

 private:
  std::vector<std::string> dark_, lost_;
  std::size_t dark_count_ = 0;  ///< lamps that shine with nothing, named or not
};

}  // namespace radiosity::engine
