// Where shots put what they deliver: integer accumulators in memory that someone else owns (a vector, or memory shared
// with a worker process), with a mark for each block of nodes that was written, so that merging costs what was touched.
// One writer at a time.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// Nodes a mark covers.
inline constexpr std::size_t kMarkNodes = 64;

[[nodiscard]] constexpr std::size_t markCount(std::size_t nodes) { return (nodes + kMarkNodes - 1) / kMarkNodes; }

struct FluxTotals {
  solver::Flux3 escaped{}, backface{}, scattered{}, gathered{};
};

struct FluxSink {
  std::array<std::span<solver::Flux3>, 2> node;
  std::array<std::span<std::uint8_t>, 2> mark;  ///< markCount(nodes) each
  FluxTotals* totals = nullptr;

  void add(std::uint32_t half, std::uint32_t id, const solver::Flux3& flux) const {
    auto& into = node[half][id];
    for (int channel = 0; channel < 3; ++channel) into[channel] += flux[channel];
    mark[half][id / kMarkNodes] = 1;
  }

  /// Adds everything to `into` and leaves the sink empty.
  void drainInto(solver::FluxAccumulators& into) const;
  /// The same into another sink for as many nodes.
  void drainInto(const FluxSink& into) const;
  /// Forgets everything.
  void clear() const;
};

/// Memory for a sink in this process.
class FluxStore {
 public:
  explicit FluxStore(std::size_t nodes = 0);
  [[nodiscard]] FluxSink sink();

 private:
  std::array<std::vector<solver::Flux3>, 2> node_;
  std::array<std::vector<std::uint8_t>, 2> mark_;
  FluxTotals totals_;
};

}  // namespace radiosity::gpu
