#include "server/solver/link_planner.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

#include "server/solver/sampling.h"

namespace radiosity::solver {
namespace {

/// Nodes weaker than this part of a share play Russian roulette.
constexpr double kRouletteShare = 0.05;
/// A node that plays counts at most this often. Below, its light is left out (and stays in the residual): in a dark
/// corner larger weights would feed on themselves.
constexpr double kMaxWeight = 20.0;
/// Nodes of less than this part of a share may shoot as a polygon though a part of it is empty or buried.
constexpr double kPartialShare = 1.2 * kRouletteShare;
/// Light that only differs between the leaves of a node cancels at a distance and counts near by.
constexpr double kVariationWorth = 0.1;
/// Points of one sample of a light: enough for the ratio of weighted visibilities to have little bias.
constexpr std::uint32_t kLightPoints = 8;
/// A light's item buffers cost about so many times those of a node, for their resolution.
constexpr double kLightCost = 3.0;

}  // namespace

LinkPlanner::Node LinkPlanner::nodeAt(const NodePlace& place, const UnshotPyramid& unshot) const {
  const auto id = nodeId(sides_[place.side], place);
  Node node;
  node.place = place;
  node.net = static_cast<double>(channelSum(unshot.flux(id)));
  node.power = node.net + kVariationWorth * std::max(0.0, static_cast<double>(unshot.rough(id)) - node.net);
  return node;
}

double LinkPlanner::chance(double power) const { return std::min(1.0, power / (kRouletteShare * share_)); }

/// A node keeps its draw: as its power grows, or the share shrinks, it joins sooner or later.
bool LinkPlanner::plays(const NodePlace& place, std::size_t half, double power) const {
  const double p = chance(power);
  if (p < 1.0 / kMaxWeight) return false;
  return p >= 1.0 || uniformFromKey(mixKeys(mixKeys(shots_.key(place), half), 77)) < p;
}

void LinkPlanner::weigh(LinkSystem& system) {
  for (auto& shooter : system.shooters()) {
    if (shooter.isLight()) continue;
    const double power = shooter.power();
    for (std::size_t half = 0; half < 2; ++half) {
      const bool in = shooter.column[half].points() > 0.0 && plays(shooter.place, half, power);
      shooter.weight[half] = in ? 1.0 / chance(power) : 0.0;
    }
  }
}

std::vector<Measurement> LinkPlanner::firstLight(const LinkSystem& system) const {
  double total = 0.0;
  for (const auto& shooter : system.shooters()) {
    if (shooter.isLight()) total += shooter.power();
  }
  std::vector<Measurement> wanted;
  for (std::uint32_t n = 0; n < system.shooters().size(); ++n) {
    const auto& shooter = system.shooters()[n];
    if (!shooter.isLight() || shooter.power() <= 0.0 || shooter.column[0].points() > 0.0) continue;
    const auto share = static_cast<std::uint32_t>(std::lround(settings_.light_points * shooter.power() / total));
    const std::uint32_t points = std::clamp(share, 2U, kLightPoints);
    for (std::uint32_t k = 0; k < std::max(1U, (share + kLightPoints - 1) / kLightPoints); ++k) {
      for (std::size_t half = 0; half < 2; ++half) wanted.push_back({n, half, points, k});
    }
  }
  return wanted;
}

bool LinkPlanner::mustSplit(const Node& node, const LinkSystem& system) const {
  if (node.place.level == 0) return false;
  const auto id = nodeId(sides_[node.place.side], node.place);
  if (system.hasBelow(id)) return true;
  const bool varies = node.power - node.net > settings_.variation_share * share_;
  if (system.at(id) != scene::kNone) return varies;
  if (node.power > share_) return true;
  // A node that is partly empty or buried is no polygon, until it is too weak for that to be seen.
  if (node.power > kPartialShare * share_ && shots_.gathers(node.place) && !shots_.isWhole(node.place)) return true;
  // What varies inside the node would be blurred: worth a split when the children do not fall to roulette.
  return node.power > 4.0 * kRouletteShare * share_ && varies;
}

void LinkPlanner::addShooter(const Node& node, LinkSystem& system, const UnshotPyramid& unshot,
                             const scene::PatchScene& patches, std::vector<Measurement>& wanted) {
  const auto id = nodeId(sides_[node.place.side], node.place);
  if (patches.node_area[id] <= 0.0F || node.net <= 0.0) return;
  const std::array<bool, 2> in{plays(node.place, 0, node.power), plays(node.place, 1, node.power)};
  counters_.roulette_kills += static_cast<std::uint64_t>(!in[0]) + static_cast<std::uint64_t>(!in[1]);
  if (!in[0] && !in[1]) return;
  Shooter shooter;
  shooter.place = node.place;
  shooter.area = static_cast<double>(patches.node_area[id]);
  shooter.sent.fill(unshot.flux(id) / patches.node_area[id]);
  const auto index = system.add(shooter);
  ++counters_.shooters;
  if (shots_.gathers(node.place)) ++counters_.gathered_nodes;
  if (node.place.level > 0) ++counters_.whole_subtrees;
  for (std::size_t half = 0; half < 2; ++half) {
    if (in[half]) wanted.push_back({index, half, 1, 0});
  }
}

std::vector<Measurement> LinkPlanner::grow(LinkSystem& system, const UnshotPyramid& unshot,
                                           const scene::PatchScene& patches, std::size_t limit) {
  const auto weaker = [](const Node& a, const Node& b) {
    if (a.power != b.power) return a.power < b.power;
    return std::tie(a.place.side, a.place.level, a.place.y, a.place.x) >
           std::tie(b.place.side, b.place.level, b.place.y, b.place.x);
  };
  std::priority_queue<Node, std::vector<Node>, decltype(weaker)> queue(weaker);
  const auto push = [&](const NodePlace& place) {
    const Node node = nodeAt(place, unshot);
    if (node.power > 0.0) queue.push(node);
  };
  for (std::uint32_t s = 0; s < sides_.size(); ++s) push({s, sides_[s].level_count - 1, 0, 0});
  std::vector<Measurement> wanted;
  while (!queue.empty() && wanted.size() < 2 * limit) {
    const Node node = queue.top();
    queue.pop();
    const NodePlace& place = node.place;
    if (mustSplit(node, system)) {
      const Side& side = sides_[place.side];
      const auto grid = scene::levelGrid(side.width, side.height, place.level - 1);
      for (std::uint32_t y = 2 * place.y; y < std::min(2 * place.y + 2, grid.height); ++y) {
        for (std::uint32_t x = 2 * place.x; x < std::min(2 * place.x + 2, grid.width); ++x)
          push({place.side, place.level - 1, x, y});
      }
      continue;
    }
    const auto there = system.at(nodeId(sides_[place.side], place));
    if (there == scene::kNone) {
      addShooter(node, system, unshot, patches, wanted);
      continue;
    }
    const auto& shooter = system.shooters()[there];  // one of its halves may join late
    for (std::size_t half = 0; half < 2; ++half) {
      if (shooter.column[half].points() == 0.0 && plays(place, half, shooter.power()))
        wanted.push_back({there, half, 1, 0});
    }
  }
  return wanted;
}

std::vector<Measurement> LinkPlanner::sample(const LinkSystem& system) const {
  const auto& shooters = system.shooters();
  double spread = 0.0, squares = 0.0;
  for (const auto& shooter : shooters) spread += shooter.spread(), squares += shooter.power() * shooter.power();
  struct Gain {
    double gain;
    std::uint32_t shooter, points;
  };
  std::vector<Gain> gains;
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    const auto& shooter = shooters[n];
    if (shooter.column[0].points() == 0.0 || shooter.column[1].points() == 0.0) continue;
    const std::uint32_t points = shooter.isLight() ? kLightPoints : 1;
    const double taken = shooter.column[0].points();
    // The spread of few samples is itself uncertain: half a sample's worth of what is usual for such power is mixed in.
    const double usual = spread / squares * shooter.power() * shooter.power();
    const double variance = (shooter.spread() * taken + 0.5 * usual) / (taken + 0.5);
    gains.push_back({variance / (taken + points) / (shooter.isLight() ? kLightCost : 1.0), n, points});
  }
  const std::size_t count =
      std::min(std::max<std::size_t>(settings_.pairs_a_wave, shooters.size() / 8), gains.size());
  std::partial_sort(gains.begin(), gains.begin() + static_cast<std::ptrdiff_t>(count), gains.end(),
                    [](const Gain& a, const Gain& b) { return std::tie(b.gain, a.shooter) < std::tie(a.gain, b.shooter); });
  std::vector<Measurement> wanted;
  for (std::size_t i = 0; i < count; ++i) {
    const auto& column = shooters[gains[i].shooter].column;
    for (std::size_t half = 0; half < 2; ++half)
      wanted.push_back({gains[i].shooter, half, gains[i].points, column[half].samples()});
  }
  return wanted;
}

}  // namespace radiosity::solver
