// Pieces of assemblePages (lightmap.h): leaf values onto pages, fills, and stitching of seams. Plain values; solve
// thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/scene/lightmap.h"

namespace radiosity::scene {

/// Which surface a page texel belongs to, gutters included, and how far it is from that surface's own texels.
struct PageOwners {
  std::vector<std::uint32_t> surface;  ///< kNone: nobody's
  std::vector<std::uint8_t> ring;      ///< 0: a value of its own; 1, 2, ...: filled from neighbours, that far away
};

/// Changes texels as little as possible so that bilinear lookups on both sides of each seam agree. Least-norm
/// projections (Kaczmarz 1937) over points along the seams, as in Iwanicki, "Lighting technology of The Last of Us"
/// (2013), which solves the same least-squares problem. Gutter texels give way more easily than visible ones, and
/// small ones than those beside them.
void stitchSeams(const PatchScene& patches, const std::vector<PageOwners>& owners, std::vector<LightmapPage>& pages);

}  // namespace radiosity::scene
