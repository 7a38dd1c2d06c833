#include "server/solver/links/link_planner.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Nodes weaker than this part of a share play Russian roulette, where half of all light is reflected or less.
constexpr double kRouletteShare = 0.05;
/// A node that plays counts at most this often. Below, its light is left out (see leftOut()): in a dark corner larger
/// weights would feed on themselves.
constexpr double kMaxWeight = 20.0;
/// Nodes of less than this part of a share may shoot as a polygon though a part of it is empty or buried.
constexpr double kPartialShare = 0.06;
/// Light that only differs between the leaves of a node cancels at a distance and counts near by.
constexpr double kVariationWorth = 0.1;
/// First samples of a scattered node.
constexpr std::uint32_t kScatteredPoints = 4;
/// Points on all lights together in the first wave and half, where some have fewer than kLightPoints.
constexpr std::uint32_t kMostFirstPoints = 128;
/// A point on a light costs this part of a node's sample from one: its image has more pixels, but the receivers are
/// found and weighed once for all points, and expanded and averaged once. A further point of a node.
constexpr double kLightCost = 0.7, kPointCost = 0.65;
/// So many samples' worth of what is usual is mixed into what is found of a shooter.
constexpr double kPrior = 1.0;
/// A wave brings a light at most so many samples, and a node so many points. It doubles what there is, since the
/// equation over all rays, which follows, takes longer than most waves.
constexpr std::uint32_t kMostOfWave = 512;

/// A wave ends where it is likely to bring the error to this part of the target: the spreads that it goes by are
/// uncertain themselves, and the largest are rather too large.
constexpr double kSurelyBelow = 0.85;
/// So much of a wave is worth solving all bounces for.
constexpr std::size_t kLeastPartOfWave = 8;
/// Sums of so many single numbers are that near.
constexpr float kRounded = 0.999F;

/// What a wave of improvement is likely to do to the error.
class Forecast {
 public:
  /// `variance` of all samples, as the gains of a wave count it.
  Forecast(const ErrorGoal& goal, double variance) : goal_(goal), variance_(variance) {}
  void sample(double less) { less_ += less; }
  [[nodiscard]] bool isReached() const {
    const double left = variance_ > 0.0 ? std::sqrt(std::max(0.0, 1.0 - less_ / variance_)) : 1.0;
    return goal_.sampling * left <= kSurelyBelow * goal_.target;
  }

 private:
  ErrorGoal goal_;
  double variance_;
  double less_ = 0.0;
};

}  // namespace

LinkPlanner::Node LinkPlanner::nodeAt(const NodePlace& place, const UnshotPyramid& unshot) const {
  const auto id = nodeId(sides_[place.side], place);
  Node node;
  node.place = place;
  node.net = static_cast<double>(channelSum(unshot.flux(id)));
  node.power = node.net + kVariationWorth * std::max(0.0, static_cast<double>(unshot.rough(id)) - node.net);
  return node;
}

void LinkPlanner::setReflectance(double mean) {
  roulette_share_ = kRouletteShare * std::clamp(2.0 * (1.0 - mean), 1e-4, 1.0);
}

double LinkPlanner::chance(double power) const { return std::min(1.0, power / (roulette_share_ * share_)); }

/// A node keeps its draw: as its power grows, or the share shrinks, it joins sooner or later.
bool LinkPlanner::plays(const NodePlace& place, std::size_t half, double power) const {
  const double p = chance(power);
  if (p < 1.0 / kMaxWeight) return false;
  return p >= 1.0 || draws_.draw(place, half) < p;
}

double LinkPlanner::weigh(LinkSystem& system) {
  double changed = 0.0, all = 0.0;
  for (auto& shooter : system.shooters()) {
    if (shooter.isLight()) continue;
    const double power = shooter.power();
    for (std::size_t half = 0; half < 2; ++half) {
      const bool in = shooter.column[half].points() > 0.0 && (shooter.certain || plays(shooter.place, half, power));
      const double weight = !in ? 0.0 : shooter.certain ? 1.0 : 1.0 / chance(power);
      changed += power * std::abs(weight - shooter.weight[half]);
      all += power;
      shooter.weight[half] = weight;
    }
  }
  return all > 0.0 ? changed / all : 0.0;
}

std::vector<Measurement> LinkPlanner::firstLight(const LinkSystem& system) const {
  double total = 0.0;
  std::uint32_t lights = 0;
  for (const auto& shooter : system.shooters()) {
    if (!shooter.isLight() || shooter.power() <= 0.0) continue;
    total += shooter.power();
    ++lights;
  }
  const std::uint32_t all = std::max(settings_.light_points, std::min(kLightPoints * lights, kMostFirstPoints));
  std::vector<Measurement> wanted;
  for (std::uint32_t n = 0; n < system.shooters().size(); ++n) {
    const auto& shooter = system.shooters()[n];
    if (!shooter.isLight() || shooter.power() <= 0.0) continue;
    if (shooter.light == scene::kNone) {  // a sample of it is a whole sequence of images, or of draws
      for (std::size_t half = 0; half < 2; ++half) {
        if (shooter.column[half].points() == 0.0) wanted.push_back({n, half, 1, 0});
      }
      continue;
    }
    const auto share = static_cast<std::uint32_t>(std::lround(all * shooter.power() / total));
    const std::uint32_t points = std::clamp(share, 2U, kLightPoints);
    for (std::uint32_t k = 0; k < std::max(1U, (share + kLightPoints - 1) / kLightPoints); ++k) {
      for (std::size_t half = 0; half < 2; ++half) {
        if (shooter.column[half].points() == 0.0) wanted.push_back({n, half, points, k});
      }
    }
  }
  return wanted;
}

bool LinkPlanner::mustSplit(const Node& node, const LinkSystem& system) const {
  if (node.place.level == 0) return false;
  const auto id = nodeId(sides_[node.place.side], node.place);
  if (system.hasBelow(node.place.side, id)) return true;
  if (system.at(node.place.side, id) != scene::kNone) return false;
  if (node.power > share_) return true;
  return isPartial(node);
}

/// A node that is partly empty or buried, or folded, is no polygon, until it is too weak for that to be seen.
bool LinkPlanner::isPartial(const Node& node) const {
  if (node.power <= kPartialShare * share_) return false;
  return shots_.gathers(node.place) ? !shots_.isWhole(node.place) : shots_.isFolded(node.place);
}

void LinkPlanner::addShooter(const Node& node, LinkSystem& system, const UnshotPyramid& unshot,
                             const scene::PatchScene& patches, LinkMemory& memory, std::vector<Measurement>& wanted) {
  const auto id = nodeId(sides_[node.place.side], node.place);
  if (patches.node_area[id] <= 0.0F || node.net <= 0.0) return;
  const double least = least_radiosity_.empty() ? 0.0 : least_radiosity_[node.place.side];
  if (node.net < least * static_cast<double>(patches.node_area[id])) return;
  // Right beside a buried edge one would see single leaves come and go, and each of them is most of the light of one
  // texel: there nobody plays.
  const bool certain = node.beside_edge && chance(node.power) >= 1.0 / kMaxWeight;
  const std::array<bool, 2> in{certain || plays(node.place, 0, node.power),
                               certain || plays(node.place, 1, node.power)};
  counters_.roulette_kills += static_cast<std::uint64_t>(!in[0]) + static_cast<std::uint64_t>(!in[1]);
  if (!in[0] && !in[1]) return;
  Shooter shooter;
  shooter.place = node.place;
  shooter.area = static_cast<double>(patches.node_area[id]);
  shooter.sent.fill(unshot.flux(id) / patches.node_area[id]);
  shooter.certain = certain;
  shooter.resolution = resolution_;
  shooter.most_bytes = memory.mostBytes(node.place.side);
  const std::size_t columns = static_cast<std::size_t>(in[0]) + static_cast<std::size_t>(in[1]);
  if (memory.isFull() || !memory.takeShooter(shooter, columns, system)) return;
  const auto index = system.add(shooter);
  ++counters_.shooters;
  if (shots_.gathers(node.place)) ++counters_.gathered_nodes;
  if (node.place.level > 0) ++counters_.whole_subtrees;
  for (std::size_t half = 0; half < 2; ++half) {
    if (in[half]) wantFirst(index, half, system, wanted);
  }
}

/// A node that is scattered shines from single points: what is beside one of few would stand out as a blot.
void LinkPlanner::wantFirst(std::uint32_t index, std::size_t half, const LinkSystem& system,
                            std::vector<Measurement>& wanted) const {
  const auto& shooter = system.shooters()[index];
  const auto samples = shots_.gathers(shooter.place) ? 1U : kScatteredPoints;
  for (std::uint32_t k = 0; k < samples; ++k) wanted.push_back({index, half, 1, k});
}

/// It has shooters, or may get some: no node is brighter than all of its leaves.
bool LinkPlanner::mayShoot(std::uint32_t s, const LinkSystem& system, const UnshotPyramid& unshot,
                           const scene::PatchScene& patches) const {
  const Side& side = sides_[s];
  const auto root = side.first_node + side.node_count - 1;
  if (least_radiosity_.empty() || system.hasBelow(s, root) || system.at(s, root) != scene::kNone) return true;
  const auto least = static_cast<float>(least_radiosity_[s]);
  bool is_bright = false;
  for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node)
    is_bright = is_bright ||
                (patches.node_area[node] > 0.0F && unshot.rough(node) >= kRounded * least * patches.node_area[node]);
  return is_bright;
}

std::vector<Measurement> LinkPlanner::grow(LinkSystem& system, const UnshotPyramid& unshot,
                                           const scene::PatchScene& patches, std::size_t limit, LinkMemory& memory) {
  const auto weaker = [](const Node& a, const Node& b) {
    if (a.power != b.power) return a.power < b.power;
    return std::tie(a.place.side, a.place.level, a.place.y, a.place.x) >
           std::tie(b.place.side, b.place.level, b.place.y, b.place.x);
  };
  std::priority_queue<Node, std::vector<Node>, decltype(weaker)> queue(weaker);
  const auto push = [&](const NodePlace& place, bool beside_edge) {
    Node node = nodeAt(place, unshot);
    node.beside_edge = beside_edge;
    if (node.power > 0.0) queue.push(node);
  };
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    if (mayShoot(s, system, unshot, patches)) push({s, sides_[s].level_count - 1, 0, 0}, false);
  }
  std::vector<Measurement> wanted;
  while (!queue.empty() && wanted.size() < 2 * limit) {
    const Node node = queue.top();
    queue.pop();
    const NodePlace& place = node.place;
    if (mustSplit(node, system)) {
      const bool beside_edge = node.beside_edge || isPartial(node);
      const Side& side = sides_[place.side];
      const auto grid = scene::levelGrid(side.width, side.height, place.level - 1);
      for (std::uint32_t y = 2 * place.y; y < std::min(2 * place.y + 2, grid.height); ++y) {
        for (std::uint32_t x = 2 * place.x; x < std::min(2 * place.x + 2, grid.width); ++x)
          push({place.side, place.level - 1, x, y}, beside_edge);
      }
      continue;
    }
    const auto there = system.at(place.side, nodeId(sides_[place.side], place));
    if (there == scene::kNone) {
      addShooter(node, system, unshot, patches, memory, wanted);
      continue;
    }
    const auto& shooter = system.shooters()[there];  // one of its halves may join late
    for (std::size_t half = 0; half < 2; ++half) {
      const bool joins =
          shooter.column[half].points() == 0.0 && (shooter.certain || plays(place, half, shooter.power()));
      if (joins && memory.takeSample(shooter, half)) wantFirst(there, half, system, wanted);
    }
  }
  return wanted;
}

double LinkPlanner::unlinked(const LinkSystem& system) const {
  double flux = 0.0;
  for (const auto& shooter : system.shooters()) {
    for (std::size_t half = 0; half < 2 && !shooter.isLight(); ++half) {
      const bool plays_here = shooter.certain || plays(shooter.place, half, shooter.power());
      if (shooter.column[half].points() == 0.0 && plays_here) flux += 0.5 * shooter.power();
    }
  }
  return flux;
}

/// Those that a wave may bring a shooter, in order: about as many points as it has, and no more than a wave brings.
std::vector<LinkPlanner::FurtherSample> LinkPlanner::furtherSamples(const Shooter& shooter) const {
  const auto taken = shooter.column[0].samples();
  const auto most = std::min(kMostOfWave, std::max(1U, taken));
  if (shooter.sample_cost > 0.0) return std::vector<FurtherSample>(most, {1, shooter.sample_cost});
  std::vector<FurtherSample> samples;
  for (std::uint32_t k = 0; shooter.isLight() && k < most; ++k)
    samples.push_back({kLightPoints, kLightCost * settings_.lightCost(taken + k) * kLightPoints});
  if (shooter.isLight()) return samples;
  const auto most_points = std::min(kMostOfWave, static_cast<std::uint32_t>(shooter.column[0].points()));
  for (std::uint32_t k = 0, all = 0; k == 0 || all < most_points; ++k) {
    const auto points = shots_.pointsOf(shooter.place, taken + k);
    samples.push_back({points, 1.0 + kPointCost * (points - 1)});
    all += points;
  }
  return samples;
}

LinkPlanner::Gains LinkPlanner::findGains(const LinkSystem& system) const {
  double spread = 0.0, squares = 0.0;
  for (const auto& shooter : system.shooters()) {
    spread += shooter.spread();
    squares += shooter.power() * shooter.power();
  }
  Gains gains;
  for (std::uint32_t n = 0; n < system.shooters().size(); ++n) {
    const auto& shooter = system.shooters()[n];
    if (shooter.column[0].points() == 0.0 || shooter.column[1].points() == 0.0) {
      gains.variances += 0.25 * shooter.spread();  // of roulette: no sample lowers it
      continue;
    }
    const double taken = shooter.column[0].points();
    // The spread of few samples is itself uncertain: a sample's worth of what is usual for such power is mixed in.
    const double usual = squares > 0.0 ? spread / squares * shooter.power() * shooter.power() : 0.0;
    const double variance = 0.25 * (shooter.spread() * taken + kPrior * usual) / (taken + kPrior);
    // Of each further sample, were those before it taken. At most as many as there are: their worth is only guessed.
    gains.variances += variance;
    double before = taken;
    const auto gainOf = [&](const FurtherSample& sample) {
      const double less = variance * taken * (1.0 / before - 1.0 / (before + sample.points));
      return Gain{less / (2.0 * sample.cost), n, sample.points, less};
    };
    const auto samples = furtherSamples(shooter);
    for (const auto& sample : samples) {
      gains.all.push_back(gainOf(sample));
      before += sample.points;
    }
    gains.waits = std::max(gains.waits, gainOf(samples.back()).gain);
  }
  std::sort(gains.all.begin(), gains.all.end(), [](const Gain& a, const Gain& b) {
    return std::tie(b.gain, a.shooter, a.points) < std::tie(a.gain, b.shooter, b.points);
  });
  return gains;
}

std::vector<Measurement> LinkPlanner::improve(const LinkSystem& system, LinkMemory& memory,
                                              const ErrorGoal& goal) const {
  const auto gains = findGains(system);
  const std::size_t usual = 2 * std::max<std::size_t>(settings_.pairs_a_wave, system.shooters().size() / 8);
  std::vector<Measurement> wanted;
  std::vector<std::uint32_t> further(system.shooters().size(), 0);
  Forecast forecast(goal, gains.variances);
  std::size_t planned = 0;  // samples of lights, points of nodes
  for (const auto& gain : gains.all) {
    if (gain.gain <= 0.0) break;
    if (planned >= usual / kLeastPartOfWave && forecast.isReached()) break;
    if (planned >= usual && gain.gain < gains.waits) break;  // what waits for the next wave is worth more
    const auto& shooter = system.shooters()[gain.shooter];
    // Its columns grow once, whatever the number of samples.
    if (further[gain.shooter] == 0 && (!memory.takeSample(shooter, 0) || !memory.takeSample(shooter, 1))) continue;
    forecast.sample(gain.less);
    for (std::size_t half = 0; half < 2; ++half) {
      const auto index = shooter.column[half].samples() + further[gain.shooter];
      wanted.push_back(
          {gain.shooter, half, shooter.isLight() ? gain.points : shots_.pointsOf(shooter.place, index), index});
    }
    ++further[gain.shooter];
    // A crowd's sample takes as long as many of others.
    const auto worth = shooter.crowd != scene::kNone ? static_cast<std::size_t>(std::ceil(shooter.sample_cost)) : 1;
    planned += 2 * (shooter.isLight() ? worth : gain.points);
  }
  return wanted;
}

}  // namespace radiosity::solver
