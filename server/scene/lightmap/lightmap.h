// From leaf irradiance to lightmap pages: fills, stitches and dilates, so that a bilinear lookup anywhere on a surface
// is right. Pure functions of values; run on the solve thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "common/bytes.h"
#include "common/image.h"
#include "server/scene/document/document.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// One page's irradiance (lux) with, per texel, the fraction of it that is covered by visible surface (0: gutter).
struct LightmapPage {
  Image irradiance;
  std::vector<float> coverage;
};

enum class Seams { kStitched, kLeft };

/// `node_values`: by node of level 0 (index = node id; other levels ignored). Each side of a surface fills texels of
/// its own. Texels less than a quarter visible are filled from neighbours of the same chart; seams between charts that
/// share an edge are stitched (irradiance is continuous there; other values need not be: kLeft); gutters are dilated.
[[nodiscard]] std::vector<LightmapPage> assemblePages(const PatchScene& patches, std::span<const glm::vec3> node_values,
                                                      Seams seams = Seams::kStitched);

/// As engines look it up, bilinearly: at `texel` of the chart of a side, which has texels.
[[nodiscard]] glm::vec3 lookUp(const PatchScene& patches, std::span<const LightmapPage> pages, std::uint32_t surface,
                               std::size_t side, const glm::vec2& texel);

/// Next coarser mip: coverage-weighted mean of 2x2, so that charts do not bleed into gutters.
[[nodiscard]] LightmapPage coarserMip(const LightmapPage& page);

/// The input document plus TEXCOORD_1 on every lit primitive and "lightmap": page in its extras. Primitives whose
/// instances need different UVs are split (a mesh per instance); vertices are split along chart borders. A double-sided
/// primitive becomes its front and, where one can see its back, a flipped copy ("lightmapSide": "back"), both
/// single-sided, with texels of their own. Where faces lie on each other, what its emissive texture leaves dark is
/// split off and has "lightmapEmits": false: of such faces those that emit are seen.
[[nodiscard]] Result<Document> withLightmapUvs(const Document& document, const Scene& scene, const PatchScene& patches);

/// A GLB for any glTF viewer: withLightmapUvs plus KHR_materials_unlit materials whose base colour texture is the
/// tone-mapped result (one PNG a page, `display` in [0, 1] already encoded as sRGB by the caller), with alpha where one
/// can see through what lies on the page: MASK and BLEND stay what they are.
[[nodiscard]] Result<Bytes> writeUnlitGlb(const Document& document, const Scene& scene, const PatchScene& patches,
                                          std::span<const Image> display_pages);

}  // namespace radiosity::scene
