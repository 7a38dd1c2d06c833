// Leaves so small that what the pixels of a hemicube bring to them is chance, and the leaf beside each that it shares
// with. Pure functions of values.
#pragma once

#include <cstdint>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

struct Sliver {
  std::uint32_t leaf, leaf_side;      ///< leaf value it shares with, and that one's side
  std::uint32_t sliver, sliver_side;  ///< its own leaf value and side

  friend auto operator<=>(const Sliver&, const Sliver&) = default;
};

/// Ascending by leaf: every leaf of less than a quarter of the area that leaves of its instance have (the mean over the
/// instance's area), if it is as small beside a full one of its chart, too, or all of its chart is smaller than that
/// mean; with the nearest leaf that is larger, belongs to the same instance, faces about the same way, about in the
/// same plane, and lies within one and a half of their edges. What has no such neighbour is left out. Cost: of looking
/// at every leaf, and for each sliver at all that are larger within about one and a half edges.
[[nodiscard]] std::vector<Sliver> findSlivers(const scene::PatchScene& patches, const std::vector<Side>& sides);

}  // namespace radiosity::solver
