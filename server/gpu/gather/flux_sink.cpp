#include "server/gpu/gather/flux_sink.h"

#include <algorithm>

#include "common/check.h"

namespace radiosity::gpu {
namespace {

void addTo(solver::Flux3& into, const solver::Flux3& flux) {
  for (std::size_t channel = 0; channel < 3; ++channel) into[channel] += flux[channel];
}

/// `into`: FluxTotals, or FluxAccumulators, which have the same.
template <typename Into>
void takeTotals(FluxTotals& from, Into& into) {
  addTo(into.escaped, from.escaped);
  addTo(into.backface, from.backface);
  addTo(into.scattered, from.scattered);
  addTo(into.gathered, from.gathered);
  from = {};
}

/// Calls visit(half, first node, node count) for each marked block and removes the mark.
template <typename Visit>
void takeMarked(const FluxSink& sink, Visit visit) {
  for (std::size_t half = 0; half < 2; ++half) {
    for (std::size_t block = 0; block < sink.mark[half].size(); ++block) {
      if (sink.mark[half][block] == 0) continue;
      sink.mark[half][block] = 0;
      const auto first = block * kMarkNodes;
      visit(half, first, std::min(kMarkNodes, sink.node[half].size() - first));
    }
  }
}

}  // namespace

void FluxSink::drainInto(solver::FluxAccumulators& into) const {
  takeMarked(*this, [&](std::size_t half, std::size_t first, std::size_t count) {
    RAD_CHECK_LE(first + count, into.node[half].size());
    for (std::size_t i = first; i < first + count; ++i) {
      addTo(into.node[half][i], node[half][i]);
      node[half][i] = {};
    }
  });
  takeTotals(*totals, into);
}

void FluxSink::drainInto(const FluxSink& into) const {
  takeMarked(*this, [&](std::size_t half, std::size_t first, std::size_t count) {
    RAD_CHECK_LE(first + count, into.node[half].size());
    for (std::size_t i = first; i < first + count; ++i) {
      addTo(into.node[half][i], node[half][i]);
      node[half][i] = {};
    }
    into.mark[half][first / kMarkNodes] = 1;
  });
  takeTotals(*totals, *into.totals);
}

void FluxSink::clear() const {
  takeMarked(*this, [&](std::size_t half, std::size_t first, std::size_t count) {
    std::fill_n(node[half].begin() + static_cast<std::ptrdiff_t>(first), count, solver::Flux3{});
  });
  *totals = {};
}

FluxStore::FluxStore(std::size_t nodes) {
  for (std::size_t half = 0; half < 2; ++half) {
    node_[half].resize(nodes);
    mark_[half].resize(markCount(nodes));
  }
}

FluxSink FluxStore::sink() { return {{node_[0], node_[1]}, {mark_[0], mark_[1]}, &totals_}; }

}  // namespace radiosity::gpu
