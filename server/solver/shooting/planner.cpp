#include "server/solver/shooting/planner.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <queue>
#include <tuple>

#include "server/solver/math/sampling.h"
#include "server/solver/transport/node_shots.h"
#include "server/solver/transport/shot_cost.h"

namespace radiosity::solver {
namespace {

/// Nodes weaker than this part of a shot's share play Russian roulette: they shoot a full part, or nothing.
constexpr double kRouletteShare = 0.05;
/// Nodes of less than this part of a share may shoot as a polygon though a part of it is empty or buried. Not below the
/// roulette's share: what is right beside a buried edge would see single leaves come and go.
constexpr double kPartialShare = 1.2 * kRouletteShare;

/// A leaf under a node chosen with probability proportional to its unshot power; (u, v) are uniform again on return.
std::uint32_t leafByUnshot(const RadiosityState& state, const Side& side, std::uint32_t level, std::uint32_t x,
                           std::uint32_t y, double& u, double& v) {
  return warpToLeaf(
      side, {0, level, x, y}, [&](std::uint32_t id) { return state.nodeRough(id); }, u, v);
}

}  // namespace

std::uint32_t Planner::resolutionFor(double power) const {
  // Unshot power steers resolution (paper, section 3): a shot with a quarter of the power needs half the hemicube.
  std::uint32_t n = settings_.resolution;
  for (double p = power; p < 0.25 * share_ && n > 32; p *= 4.0) n /= 2;
  for (double p = power; p > 4.0 * share_ && n < 256; p *= 0.25) n *= 2;
  return n;
}

void Planner::addShot(const RadiosityState& state, const Side& side, const Node& node, double weight,
                      std::uint32_t half, std::uint64_t node_key, ShotBatch& batch) {
  const auto& patches = state.patches();
  // Later waves of a round may come back to a node: each has a sequence of its own, which goes on from round to round.
  const std::uint64_t wave_key = mixKeys(node_key, 0x100 + wave_);
  const glm::dvec4 point = sobol4(2 * (state.rounds() - 1) + half, wave_key);
  double u = point.x, v = point.y;
  const std::uint32_t leaf = leafByUnshot(state, side, node.level, node.x, node.y, u, v);
  const auto& place = patches.leaves[patches.surfaces[side.surface].first_leaf + leaf];
  const glm::dvec3 unshot(state.unshot(side, leaf));
  const double sum = std::abs(unshot.x) + std::abs(unshot.y) + std::abs(unshot.z);
  if (place.triangle == scene::kNone || sum <= 0.0) return;
  const auto [texel, triangle_index] =
      patches.spotAt(place, leaf % side.width, leaf / side.width, glm::vec2(glm::dvec2(u, v)));
  const auto& triangle = patches.triangles[triangle_index];
  const auto grid = scene::levelGrid(side.width, side.height, node.level);
  const auto rough = static_cast<double>(state.nodeRough(side.first_node + grid.offset + node.y * grid.width + node.x));
  ScatterShot shot;
  shot.frame = hemicubeAt(triangle.origin + texel.x * triangle.du + texel.y * triangle.dv,
                          side.side == 0 ? triangle.normal : -triangle.normal, point.z,
                          mixKeys(node_key, shots_planned_ * 2 + half));
  shot.resolution = resolutionFor(node.power * weight);
  shot.level_bias = settings_.level_bias + static_cast<float>(point.w);
  shot.half = half;
  for (int c = 0; c < 3; ++c) {
    const double flux = 0.5 * weight * rough * unshot[c] / sum;
    shot.flux[static_cast<std::size_t>(c)] = flux;
  }
  batch.scatter.push_back(shot);
}

bool Planner::isWhole(const RadiosityState& state, const Side& side, const Node& node) const {
  const auto& surface = state.patches().surfaces[side.surface];
  const auto polygon = outlines_.node(side.surface, node.level, node.x, node.y);
  const auto grid = scene::levelGrid(side.width, side.height, node.level);
  const auto area =
      static_cast<double>(state.patches().node_area[side.first_node + grid.offset + node.y * grid.width + node.x]);
  const double whole = polygon.area() * static_cast<double>(surface.texel_area);
  return std::abs(area - whole) <= 2e-3 * whole;
}

bool Planner::mustSplit(const RadiosityState& state, const Side& side, const Node& node) const {
  if (node.level == 0) return false;
  if (node.power > share_) return true;
  if (!canGather(state, side)) return false;
  // A node that is partly empty or buried is no polygon, until it is too weak for that to be seen.
  if (node.power > kPartialShare * share_ && !isWhole(state, side, node)) return true;
  const auto grid = scene::levelGrid(side.width, side.height, node.level);
  const std::uint32_t id = side.first_node + grid.offset + node.y * grid.width + node.x;
  const glm::vec3 flux = glm::abs(state.nodeFlux(id));
  const auto net = static_cast<double>(flux.x + flux.y + flux.z);
  // What varies inside the node would be blurred: worth a split when it weighs as much as a weak shot of its own, and
  // when the children do not fall to roulette.
  return node.power > 4.0 * kRouletteShare * share_ && node.power - net > settings_.variation_share * share_;
}

bool Planner::isSpent(const RadiosityState& state, const Side& side, const Node& node) const {
  if (!canGather(state, side)) return false;
  const auto grid = scene::levelGrid(side.width, side.height, node.level);
  const glm::vec3 flux = glm::abs(state.nodeFlux(side.first_node + grid.offset + node.y * grid.width + node.x));
  return static_cast<double>(flux.x + flux.y + flux.z) < 0.1 * node.power;
}

glm::dvec2 Planner::openPoint(const RadiosityState& state, const Side& side, const Node& node, double u, double v) {
  const std::uint32_t leaf = leafByUnshot(state, side, node.level, node.x, node.y, u, v);
  const auto& place = state.patches().leaves[state.patches().surfaces[side.surface].first_leaf + leaf];
  return state.patches().spotAt(place, leaf % side.width, leaf / side.width, glm::vec2(glm::dvec2(u, v))).texel;
}

void Planner::addNodeGather(const RadiosityState& state, const Side& side, const Node& node, double weight,
                            const std::array<bool, 2>& plays, std::uint64_t node_key, ShotBatch& batch) {
  const auto& patches = state.patches();
  const auto& surface = patches.surfaces[side.surface];
  const auto& frame = patches.triangles[surface.first_triangle];
  const auto grid = scene::levelGrid(side.width, side.height, node.level);
  const std::uint32_t id = side.first_node + grid.offset + node.y * grid.width + node.x;
  const bool whole = isWhole(state, side, node);
  const auto polygon = outlines_.node(side.surface, node.level, node.x, node.y);
  const auto at = [&](const glm::dvec2& texel) {
    return frame.origin + static_cast<float>(texel.x) * frame.du + static_cast<float>(texel.y) * frame.dv;
  };
  GatherShot shot;
  shot.normal = side.side == 0 ? frame.normal : -frame.normal;
  shot.corner_count = polygon.count;
  const bool turned = glm::dot(glm::cross(frame.du, frame.dv), shot.normal) < 0.0F;
  for (std::uint32_t k = 0; k < polygon.count; ++k) {
    shot.corners[turned ? polygon.count - 1 - k : k] = at(polygon.corner[k]);
  }
  const double area = polygon.area() * static_cast<double>(surface.texel_area);
  if (polygon.count < 3 || area <= 0.0) return;
  const auto node_area = static_cast<double>(patches.node_area[id]);
  shot.fill = whole ? 1.0F : static_cast<float>(std::min(1.0, node_area / area));
  const glm::dvec3 radiosity = glm::dvec3(state.nodeFlux(id)) * (weight / (area * static_cast<double>(shot.fill)));
  for (int c = 0; c < 3; ++c) shot.radiosity[static_cast<std::size_t>(c)] = radiosity[c];
  shot.resolution = settings_.node_resolution;
  shot.half = plays[0] && plays[1] ? kBothHalves : plays[0] ? 0 : 1;
  if (shot.half != kBothHalves) {
    for (auto& channel : shot.radiosity) channel *= 0.5;  // each half carries half
  }
  shot.first_point = static_cast<std::uint32_t>(batch.points.size());
  const std::uint64_t wave_key = mixKeys(node_key, 0x100 + wave_);
  const glm::dvec4 jitter = sobol4(state.rounds() - 1, mixKeys(wave_key, 2));
  shot.receiver_jitter = glm::vec2(jitter.x, jitter.y);
  shot.spots = scene::SpotDraw::from(jitter.z);
  for (std::uint32_t p = 0; p < 2; ++p) {
    if (!plays[p]) continue;
    const glm::dvec4 sample = sobol4(2 * (state.rounds() - 1) + p, wave_key);
    const glm::dvec2 texel =
        whole ? polygon.point(sample.x, sample.y) : openPoint(state, side, node, sample.x, sample.y);
    batch.points.push_back(hemicubeAt(at(texel), shot.normal, sample.z, mixKeys(node_key, shots_planned_ * 2 + p)));
  }
  shot.point_count = static_cast<std::uint32_t>(batch.points.size()) - shot.first_point;
  batch.gather.push_back(shot);
}

void Planner::shoot(RadiosityState& state, Side& side, const Node& node, ShotBatch& batch) {
  const std::uint64_t place = (std::uint64_t{node.level} << 58) ^ (std::uint64_t{node.y} << 29) ^ std::uint64_t{node.x};
  const std::uint64_t node_key = mixKeys(mixKeys(settings_.seed, side.first_node), place);
  const double floor = kRouletteShare * share_;
  const double chance = std::min(1.0, node.power / floor);
  const bool gather = canGather(state, side);
  ++shots_planned_;
  // Each half plays on its own, so that the difference between the halves shows what roulette costs.
  std::array<bool, 2> plays{};
  for (std::uint32_t half = 0; half < 2; ++half) {
    plays[half] = chance >= 1.0 || uniformFromKey(mixKeys(node_key, shots_planned_ * 2 + half)) < chance;
  }
  if (gather && (plays[0] || plays[1])) {
    addNodeGather(state, side, node, 1.0 / chance, plays, node_key, batch);
    ++counters_.gathered_nodes;
  }
  for (std::uint32_t half = 0; half < 2; ++half) {
    if (!gather && plays[half]) addShot(state, side, node, 1.0 / chance, half, node_key, batch);
    if (!plays[half]) ++counters_.roulette_kills;
  }
  if (plays[0] || plays[1]) {
    ++counters_.shooters;
    if (node.level > 0) ++counters_.whole_subtrees;
  }
  const glm::dvec3 shot =
      gather ? state.markMeanShot(side, node.level, node.x, node.y) : state.markShot(side, node.level, node.x, node.y);
  for (int c = 0; c < 3; ++c) intended_[static_cast<std::size_t>(c)] += shot[c];
}

ShotBatch Planner::scatterWave(RadiosityState& state, double remainder) {
  ShotBatch batch;
  batch.mode = settings_.mode;
  batch.flux_scale = state.fluxScale();
  const auto weaker = [](const Node& a, const Node& b) {
    if (a.power != b.power) return a.power < b.power;
    return std::tie(a.side, a.level, a.y, a.x) > std::tie(b.side, b.level, b.y, b.x);
  };
  std::priority_queue<Node, std::vector<Node>, decltype(weaker)> queue(weaker);
  auto& sides = state.sides();
  double total = 0.0;
  for (std::uint32_t s = 0; s < sides.size(); ++s) {
    total += sides[s].unshot_power;
    if (sides[s].unshot_power > 0.0) queue.push({sides[s].unshot_power, s, sides[s].level_count - 1, 0, 0});
  }
  const std::size_t most_points = pointsAWave(state.patches().leaves.size());
  while (!queue.empty() && batch.scatter.size() / 2 + batch.gather.size() < settings_.pairs_a_wave &&
         batch.points.size() < most_points && total > remainder) {
    const Node node = queue.top();
    queue.pop();
    Side& side = sides[node.side];
    if (side.dirty) {  // its power was an estimate
      state.pushPull(side);
      ++counters_.push_pulls;
      total += side.unshot_power - node.power;
      if (side.unshot_power > 0.0) queue.push({side.unshot_power, node.side, node.level, 0, 0});
      continue;
    }
    if (mustSplit(state, side, node)) {
      const auto grid = scene::levelGrid(side.width, side.height, node.level - 1);
      for (std::uint32_t y = 2 * node.y; y < std::min(2 * node.y + 2, grid.height); ++y) {
        for (std::uint32_t x = 2 * node.x; x < std::min(2 * node.x + 2, grid.width); ++x) {
          const float power = state.nodePower(side.first_node + grid.offset + y * grid.width + x);
          if (power > 0.0F) queue.push({static_cast<double>(power), node.side, node.level - 1, x, y});
        }
      }
      continue;
    }
    total -= node.power;
    if (!isSpent(state, side, node)) shoot(state, side, node, batch);
  }
  ++wave_;
  exhausted_ = queue.empty() || total <= remainder;
  return batch;
}

}  // namespace radiosity::solver
