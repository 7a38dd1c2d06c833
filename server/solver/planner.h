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

#include "server/solver/outlines.h"
#include "server/solver/state.h"
#include "server/solver/transport.h"

namespace radiosity::solver {

struct PlannerSettings {
  std::uint64_t seed = 1;
  LinkMode mode = LinkMode::kFormula;
  std::uint32_t pairs_a_wave = 64;       ///< shooters; each shoots once into either half
  std::uint32_t shooters_a_round = 256;  ///< a round's power is divided into about this many shots
  std::uint32_t first_shooters =
      128;  ///< where links are kept: at first no shooter has more than one in so many parts of the power
  std::uint32_t resolution = 64;            ///< N of a hemicube that carries a full share of power
  std::uint32_t light_resolution = 128;     ///< N of the item buffers of gathered light
  std::uint32_t coarse_light_samples = 32;  ///< where links are kept: so many samples of a light have those
  std::uint32_t node_resolution = 32;  ///< N of the item buffers of gathered nodes, at least (LinkPlanner::setTarget)
  bool gather_nodes = true;            ///< nodes of planar surfaces are gathered as polygons; false: all is scattered
  std::uint32_t light_points = 16;     ///< points on lights in a round and half, shared by power
  double variation_share = 0.25;       ///< split a node whose inner variation weighs this part of a share
  float level_bias = 0.0F;             ///< positive: coarser links

  /// Of a light's sample, where links are kept. Pixels blur the edges of shadows, in all samples alike: of the direct
  /// light in the room of 402 polygons 0.26 %. Images twice as wide add next to nothing to it, and take 1.7 times as
  /// long, so they come when samples are so many that it would be most of what is left.
  [[nodiscard]] std::uint32_t lightResolution(std::uint32_t sample) const {
    return sample < coarse_light_samples ? light_resolution : 2 * light_resolution;
  }
  /// What a light's sample takes beside one of the first.
  [[nodiscard]] double lightCost(std::uint32_t sample) const { return sample < coarse_light_samples ? 1.0 : 1.7; }
};

/// What a wave skipped, for reports.
struct PlannerCounters {
  std::uint64_t shooters = 0, push_pulls = 0;
  std::uint64_t roulette_kills = 0;  ///< weak nodes whose light another node carried in the mean
  std::uint64_t gathered_nodes = 0;  ///< of the shooters, those gathered as polygons
  std::uint64_t whole_subtrees = 0;  ///< nodes above leaf level shot as one
};

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
