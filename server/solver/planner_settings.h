// How much is shot at a time, and what was skipped. Plain values.
#pragma once

#include <cstdint>

#include "server/solver/transport/transport.h"

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

}  // namespace radiosity::solver
