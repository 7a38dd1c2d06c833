// Turns the image of a hemicube into flux at nodes: runs of equal ids are weighed with two table look-ups, summed per
// node as integers, and rounded to flux once per node and shot. One thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/gpu/cull/hemicube_weights.h"
#include "server/gpu/gather/flux_sink.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// Positions where a new run begins, and the end: ids[starts[k] .. starts[k + 1]) are equal.
/// `starts` must hold ids.size() + 1 entries. Returns the number of runs.
std::size_t findRuns(std::span<const std::uint32_t> ids, std::span<std::uint32_t> starts);

class ScatterAccumulator {
 public:
  /// Ids are nodes, then `nodes` = escaped, `nodes` + 1 = absorbed by an unlit side.
  explicit ScatterAccumulator(std::size_t nodes = 0) : weight_(nodes + 2) {}

  void accumulate(std::span<const std::uint32_t> ids, const HemicubeWeights& weights, const solver::ScatterShot& shot,
                  double flux_scale, const FluxSink& sink, solver::TransportCounters& counters);

 private:
  void weigh(std::span<const std::uint32_t> ids, const HemicubeWeights& weights);

  std::vector<std::uint32_t> weight_;   ///< of the current shot, by id; all zero between shots
  std::vector<std::uint32_t> touched_;  ///< ids with weight, in the order first seen
  std::size_t touched_count_ = 0;
  std::vector<std::uint32_t> starts_;
};

}  // namespace radiosity::gpu
