// After an edit of geometry: the links that it may have changed, column by column, and the shots that measure them
// again. Plain values; one thread writes them.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/solver/edits/shadows.h"
#include "server/solver/links/link_memory.h"
#include "server/solver/links/link_planner.h"
#include "server/solver/links/link_system.h"
#include "server/solver/patches/lights.h"
#include "server/solver/solver.h"
#include "server/solver/transport/node_shots.h"

namespace radiosity::solver {

/// The links of a solver, and what they are measured with. Views: all of it is to outlive them.
struct LinkParts {
  const scene::PatchScene& patches;
  const std::vector<Side>& sides;
  const std::vector<LightPolygon>& lights;
  const NodeShots& shots;
  const SolverSettings& settings;
  LinkSystem& system;
  LinkExpander& expander;
  LinkMemory& memory;
  Transport& transport;
};

/// Samples of a column that are to be taken again.
struct Repair {
  struct LeafLink {
    std::uint32_t value;
    float link;
  };

  std::uint32_t shooter = 0, old_shooter = 0;
  std::size_t half = 0;
  std::uint32_t samples = 0;  ///< of a light polygon: points
  bool whole = false;         ///< all their links; the column is empty
  bool overtaken = false;     ///< nor were they taken again after the edit before
  double reach = HUGE_VAL;    ///< what the old links are wrong by (ChangeReach); infinite: cannot wait
  // Of a light, of which some points look first and stand for all of them:
  std::uint32_t first_shots = 0;  ///< those that shall have looked next; 0: as many as look first
  std::uint32_t looked = 0;       ///< points that have
  LinkColumn::Totals found = {};  ///< by them, times points
  double noise = 0.0;             ///< square of the error of irradiance times area, where both halves have as many;
                                  ///< what all points would leave of it counts by what share of them has looked
  std::vector<LeafLink> by_points = {};  ///< ascending: of leaves that looked at it for themselves, by points alone
  bool past_losses = false;              ///< its looks see where the change is alone, whatever is lost elsewhere

  /// As if none had looked.
  void lookAnew() {
    looked = 0;
    found = {};
    past_losses = false;
    by_points.clear();
  }
  /// What the points that have not looked leave of the noise.
  [[nodiscard]] double roughness() const { return noise * (1.0 - static_cast<double>(looked) / samples); }
};

/// Short enough that nobody notices the wait, long enough that the workers' waiting for the last of them does not
/// count.
inline constexpr double kSliceSeconds = 0.06;
/// So many of what is done one after the other take that long, as far as is known; at least so many, for the workers.
struct SliceLength {
  std::size_t most, fewest;
};

/// What need not be as true as it can be.
struct RepairRules {
  bool lights_may_be_rough = true;  ///< lights look with some of their points first
  bool may_look_past = true;        ///< of what is lost, little that is lost elsewhere need not be seen again
  bool is_idle = false;             ///< nothing else is to be done: the shots of a light come one by one
};

/// What an edit changed, and what those did that came before it, for links that none of them saw taken again.
struct EditShadows {
  std::unique_ptr<Shadows> now, earlier;  ///< the second: null where there is no such link
  [[nodiscard]] const Shadows& of(const Repair& repair) const { return repair.overtaken ? *earlier : *now; }
};

/// A light's points look in shots of kLightPoints, the first of what is left of a division.
[[nodiscard]] inline std::uint32_t lightShots(std::uint32_t points) {
  return (points + kLightPoints - 1) / kLightPoints;
}

struct ShotRange {
  std::uint32_t first, end;
};
/// Surfaces that one can see through hide nothing for sure.
[[nodiscard]] bool mayLookFromLeaves(const LinkParts& parts);
/// Of a light's shots, those that are next.
[[nodiscard]] ShotRange shotsOfLight(const LinkParts& parts, const RepairRules& rules, const Repair& repair);
[[nodiscard]] std::uint32_t shotsOf(const LinkParts& parts, const RepairRules& rules, const Repair& repair);
/// The shots that the column was made of; of a light, as many points, or those of them that look now.
void addSamples(const LinkParts& parts, const RepairRules& rules, const Repair& repair, ShotBatch& batch);

}  // namespace radiosity::solver
