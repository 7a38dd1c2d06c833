// Pieces of assemblePages (lightmap.h): leaf values onto pages, fills, and stitching of seams. Plain values; solve
// thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/scene/lightmap/lightmap.h"

namespace radiosity::scene {

/// A side of a surface, as PageOwners name it.
[[nodiscard]] inline std::uint32_t ownerOf(std::uint32_t surface, std::size_t side) {
  return 2 * surface + static_cast<std::uint32_t>(side);
}

/// By leaf of a side: whether enough of it is seen for its own value, a quarter or as much as of any.
[[nodiscard]] std::vector<bool> trustedLeaves(const PatchScene& patches, const Surface& surface, std::size_t side);

/// Which side of which surface a page texel belongs to, gutters included, and how far it is from that side's own
/// texels.
struct PageOwners {
  std::vector<std::uint32_t> owner;  ///< kNone: nobody's
  std::vector<std::uint8_t> ring;    ///< 0: a value of its own; 1, 2, ...: filled from neighbours, that far away
};

/// Changes texels as little as possible so that bilinear lookups on both sides of each seam agree. Least-norm
/// projections (Kaczmarz 1937) over points along the seams, as in Iwanicki, "Lighting technology of The Last of Us"
/// (2013), which solves the same least-squares problem. Gutter texels give way more easily than visible ones, and
/// small ones than those beside them.
void stitchSeams(const PatchScene& patches, const std::vector<PageOwners>& owners, std::vector<LightmapPage>& pages);

}  // namespace radiosity::scene
