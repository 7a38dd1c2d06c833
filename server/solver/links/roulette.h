// Whose turn it is to stand for many weak nodes: low-discrepancy draws for Russian roulette (Arvo and Kirk, "Particle
// transport and image synthesis", SIGGRAPH 1990).
#pragma once

#include <cstdint>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// A fixed draw for every node and half. Along a space-filling curve through nodes that face the same way the draws are
/// a Sobol sequence: of any few neighbours of equal power as many win as should, to within one, so that what they send
/// far away hardly depends on chance. Immutable but for inherit(); any thread. 4 bytes a side.
class RouletteDraws {
 public:
  RouletteDraws(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed);

  /// After an edit of geometry: sides that are still there keep their draws. `side_after`: by side of `former`, or
  /// kNone.
  void inherit(const RouletteDraws& former, const std::vector<std::uint32_t>& side_after);

  /// In [0, 1), uniform over seeds; the halves are independent.
  [[nodiscard]] double draw(const NodePlace& node, std::size_t half) const;

 private:
  const std::vector<Side>& sides_;
  std::uint64_t seed_;
  std::vector<std::uint32_t> rank_;  // of a side, along the curve; after edits those that came follow
  std::uint32_t rank_end_ = 0;       // no rank was ever as large
};

}  // namespace radiosity::solver
