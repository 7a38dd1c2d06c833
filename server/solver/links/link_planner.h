// Chooses what to measure next for the solver that remembers its links: which nodes become shooters (the greedy walk of
// Lum, Ma and Max 2002, 4.2, on unshot power), which shooters need more samples, how much weak ones count. Its choices
// depend on the state and the seed alone, never on time or the number of workers. One thread.
#pragma once

#include <cstdint>
#include <vector>

#include "server/solver/links/link_memory.h"
#include "server/solver/links/link_system.h"
#include "server/solver/links/roulette.h"
#include "server/solver/patches/unshot_pyramid.h"
#include "server/solver/shooting/planner.h"
#include "server/solver/transport/node_shots.h"

namespace radiosity::solver {

/// Points of one sample of a light, but for a first one of fewer: enough for the ratio of weighted visibilities to have
/// little bias. What takes samples again counts on it.
inline constexpr std::uint32_t kLightPoints = 8;

/// One sample of the links of a shooter in one half.
struct Measurement {
  std::uint32_t shooter = 0;
  std::size_t half = 0;
  std::uint32_t points = 1;
  std::uint32_t index = 0;  ///< which sample of that column: fixes its points
};

/// The relative error that samples cause, and what it should become.
struct ErrorGoal {
  double sampling = 0.0;  ///< root of the samples' variance
  double target = 0.0;
};

/// Target errors from which on a pixel of the planner's resolution suffices, and one half as wide.
inline constexpr double kCoarsePixels = 0.015, kMiddlePixels = 0.003;

class LinkPlanner {
 public:
  LinkPlanner(const scene::PatchScene& patches, const std::vector<Side>& sides, const NodeShots& shots,
              const PlannerSettings& settings, std::uint64_t seed)
      : sides_(sides), shots_(shots), settings_(settings), draws_(patches, sides, seed) {}

  /// After an edit of geometry: who plays roulette, and wins, is as it was where the side still is.
  void inherit(const LinkPlanner& former, const std::vector<std::uint32_t>& side_after) {
    draws_.inherit(former.draws_, side_after);
    share_ = former.share_;
    counters_ = former.counters_;
  }

  /// Of the item buffers of shooters to come. Pixels blur the shadows of what is near to where they fall, in all
  /// samples alike: a bias that a finer target would show, and 32 is a fifth cheaper where it does not.
  void setTarget(double error) {
    resolution_ = settings_.node_resolution * (error >= kCoarsePixels ? 1U : error >= kMiddlePixels ? 2U : 4U);
  }

  /// The power of one shooter, all channels; nodes are split until they have less.
  void setShare(double share) { share_ = share; }
  [[nodiscard]] double share() const { return share_; }

  /// By side. Nodes of less radiosity, all channels, are no shooters: rays bring their light. Empty: all may be.
  void setLeastRadiosity(std::vector<double> radiosity) { least_radiosity_ = std::move(radiosity); }

  /// After a restore: what is known by side is of so many.
  [[nodiscard]] bool fits() const { return least_radiosity_.empty() || least_radiosity_.size() == sides_.size(); }

  /// Mean reflectance of the scene: what roulette creates or loses by chance is reflected so often, so that in bright
  /// rooms fewer nodes play.
  void setReflectance(double mean);

  /// Samples of the lights that have none yet, shared out by power.
  [[nodiscard]] std::vector<Measurement> firstLight(const LinkSystem& system) const;

  /// Makes the strongest unshot nodes shooters, up to `limit` of them and as long as there is memory, and says what to
  /// measure. Empty: what is left is below a shooter's worth, or stood for by others, or there is no room for more.
  [[nodiscard]] std::vector<Measurement> grow(LinkSystem& system, const UnshotPyramid& unshot,
                                              const scene::PatchScene& patches, std::size_t limit, LinkMemory& memory);

  /// Further samples of shooters whose halves differ, those first that lower the error most for their cost: at most as
  /// many as there are, as far as there is memory, and until the error is likely to be what it should.
  [[nodiscard]] std::vector<Measurement> improve(const LinkSystem& system, LinkMemory& memory,
                                                 const ErrorGoal& goal) const;

  /// Russian roulette: weights of weak shooters, so that those which play stand for all. Returns the part of all
  /// power whose weight that changed.
  double weigh(LinkSystem& system);

  /// Flux of the shooters whose links are forgotten or not measured yet, all channels.
  [[nodiscard]] double unlinked(const LinkSystem& system) const;

  [[nodiscard]] const PlannerCounters& counters() const { return counters_; }

  /// What its choices depend on, beside the system and the settings.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.counters_, self.share_, self.least_radiosity_);
  }

 private:
  struct Node {
    double power = 0.0, net = 0.0;
    NodePlace place;
    bool beside_edge = false;  ///< of the node above, a part is empty or buried
  };
  [[nodiscard]] Node nodeAt(const NodePlace& place, const UnshotPyramid& unshot) const;
  [[nodiscard]] bool mayShoot(std::uint32_t side, const LinkSystem& system, const UnshotPyramid& unshot,
                              const scene::PatchScene& patches) const;
  [[nodiscard]] bool mustSplit(const Node& node, const LinkSystem& system) const;
  [[nodiscard]] bool isPartial(const Node& node) const;
  struct FurtherSample {
    std::uint32_t points;
    double cost;  ///< in a node's samples from one point
  };
  [[nodiscard]] std::vector<FurtherSample> furtherSamples(const Shooter& shooter) const;
  struct Gain {
    double gain;
    std::uint32_t shooter, points;
    double less;  ///< of the square of the error
  };
  struct Gains {
    std::vector<Gain> all;   ///< the greatest first
    double variances = 0.0;  ///< of all samples
    double waits = 0.0;      ///< the greatest of those samples that the wave may not bring
  };
  [[nodiscard]] Gains findGains(const LinkSystem& system) const;
  [[nodiscard]] double chance(double power) const;
  [[nodiscard]] bool plays(const NodePlace& place, std::size_t half, double power) const;
  void wantFirst(std::uint32_t index, std::size_t half, const LinkSystem& system,
                 std::vector<Measurement>& wanted) const;
  void addShooter(const Node& node, LinkSystem& system, const UnshotPyramid& unshot, const scene::PatchScene& patches,
                  LinkMemory& memory, std::vector<Measurement>& wanted);

  const std::vector<Side>& sides_;
  const NodeShots& shots_;
  const PlannerSettings& settings_;
  RouletteDraws draws_;
  std::uint32_t resolution_ = 32;
  PlannerCounters counters_;
  double share_ = 0.0;
  std::vector<double> least_radiosity_;  // by side
  double roulette_share_ = 0.0;          ///< nodes weaker than this part of a share play
};

}  // namespace radiosity::solver
