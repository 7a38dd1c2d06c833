// Chooses what to shoot next (Lum, Ma and Max 2002, 4.2): the side with most unshot power is pushed and pulled, its
// quadtree is walked down along the strongest child until a node's power falls to the share of one shot, and that node
// shoots.
//
// A wave is a batch of such shots chosen from one state. Its size depends on settings alone, never on the number of
// workers or on time, so that the same seed gives the same bits everywhere.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/solver/patches/outlines.h"
#include "server/solver/planner_settings.h"
#include "server/solver/shooting/state.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

class Planner {
 public:
  Planner(const scene::PatchScene& patches, PlannerSettings settings) : settings_(settings), outlines_(patches) {}

  /// A round begins with `power` to shoot: sets the share of one shot.
  void startRound(double power) {
    share_ = power / static_cast<double>(settings_.shooters_a_round);
    wave_ = 0;
  }

  /// Next wave of shots of reflected light (and of emission that is not gathered as direct light); the leaves they
  /// stand for are marked as shot. Stops early when the power that remains is below `remainder`. An empty batch:
  /// nothing worth shooting.
  [[nodiscard]] ShotBatch scatterWave(RadiosityState& state, double remainder);

  /// Flux that the shooters so far stood for, per channel, lux unit^2. What was delivered differs by chance (roulette,
  /// one point of a coloured node, visibility from few points); the balance of energy shows by how much.
  [[nodiscard]] const std::array<double, 3>& intended() const { return intended_; }

  /// The last wave found nothing left worth shooting (a wave can be empty because roulette killed all it chose).
  [[nodiscard]] bool exhausted() const { return exhausted_; }

  [[nodiscard]] const PlannerCounters& counters() const { return counters_; }
  [[nodiscard]] PlannerSettings& settings() { return settings_; }

  /// What its choices depend on, beside the state.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.settings_, self.counters_, self.intended_, self.exhausted_, self.share_, self.wave_,
            self.shots_planned_);
  }

 private:
  struct Node {
    double power;
    std::uint32_t side, level, x, y;
  };
  void shoot(RadiosityState& state, Side& side, const Node& node, ShotBatch& batch);
  void addShot(const RadiosityState& state, const Side& side, const Node& node, double weight, std::uint32_t half,
               std::uint64_t node_key, ShotBatch& batch);
  void addNodeGather(const RadiosityState& state, const Side& side, const Node& node, double weight,
                     const std::array<bool, 2>& plays, std::uint64_t node_key, ShotBatch& batch);
  /// Nodes of planar surfaces shoot as polygons of their mean radiosity, gathered; others from one point, scattered.
  [[nodiscard]] bool canGather(const RadiosityState& state, const Side& side) const {
    const auto& surface = state.patches().surfaces[side.surface];
    return settings_.gather_nodes && surface.planar && !surface.see_through;
  }
  /// A point (texel coordinates) of the part of the node that is covered and not buried, chosen by unshot power.
  [[nodiscard]] static glm::dvec2 openPoint(const RadiosityState& state, const Side& side, const Node& node, double u,
                                            double v);
  /// All of the node's polygon is covered and not buried.
  [[nodiscard]] bool isWhole(const RadiosityState& state, const Side& side, const Node& node) const;
  [[nodiscard]] bool mustSplit(const RadiosityState& state, const Side& side, const Node& node) const;
  /// Only what varies inside the node is left, and too little to split it: nothing to shoot in this round.
  [[nodiscard]] bool isSpent(const RadiosityState& state, const Side& side, const Node& node) const;
  [[nodiscard]] std::uint32_t resolutionFor(double power) const;

  PlannerSettings settings_;
  Outlines outlines_;
  PlannerCounters counters_;
  std::array<double, 3> intended_{};
  bool exhausted_ = false;
  double share_ = 0.0;      // power of one shot in this round
  std::uint32_t wave_ = 0;  // of this round
  std::uint64_t shots_planned_ = 0;
};

}  // namespace radiosity::solver
