// From a scene to patches: charts, pages, coverage and burial (charts.h tells the steps). Pure functions of values; any
// thread.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "common/result.h"
#include "server/scene/burial/burial_record.h"
#include "server/scene/shading/lit_sides.h"
#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// Texels that differ from surface to surface, as wanted by whoever solved the same scene before.
struct TexelLayout {
  std::vector<float> detail;                  ///< by surface: Surface::detail
  double texel_m = 0.0, rough_texel_m = 0.0;  ///< metres: that PatchScene's texel and rough_texel

  [[nodiscard]] bool empty() const { return detail.empty(); }
};

struct ChartOptions {
  std::uint64_t texel_budget = 24'000;  ///< leaf patches in all, about; used when texel_size_m is 0
  double texel_size_m = 0.0;
  std::uint32_t max_page_size = 4096;
  std::uint32_t gutter = 2;       ///< empty texels between charts
  Sky sky;                        ///< of a scene that names none
  double curve_angle_deg = 15.0;  ///< normal spread of a curved chart
  TexelLayout layout = {};        ///< empty: all texels are alike, as many as the budget says
};

/// A scene as it was before an edit. Refers to its parts.
struct FormerScene {
  const Scene& scene;
  const PatchScene& patches;
};

inline constexpr std::uint64_t kMaxLeaves = std::uint64_t{1} << 28;  ///< some 6 GiB of patches

/// How many leaves a scene will have, about. O(triangles).
[[nodiscard]] std::uint64_t expectedLeaves(const Scene& scene, const ChartOptions& options);

/// Flattens instances, drops degenerate triangles (counted), makes charts or takes a valid TEXCOORD_1, packs pages,
/// measures coverage and burial. kTooLarge when a limit of leaves (2^28) or pages (1024) is passed.
///
/// With a `former` self, unit box, texel size and the places of charts on pages stay as they were, so that whatever the
/// edit left alone is the same, bit by bit. Other charts get what is free on the pages, or pages of their own. When the
/// unit box or the texel size no longer suit the scene (half as large, or half as large again; a quarter too fine or
/// too coarse), all is made anew; when less than half of the pages is in use, places are.
[[nodiscard]] Result<PatchScene> buildPatchScene(const Scene& scene, const ChartOptions& options,
                                                 const FormerScene* former = nullptr);

/// As buildPatchScene(), and how burial was found, for edits. `record`: that of the former scene, if it was kept: what
/// is built is the same without it, later.
struct BuiltScene {
  PatchScene patches;
  std::shared_ptr<const BurialRecord> burial;  ///< null: not kept
  std::shared_ptr<const ShadingNormals> normals;
};
[[nodiscard]] Result<BuiltScene> buildWithRecord(const Scene& scene, const ChartOptions& options,
                                                 const FormerScene* former = nullptr,
                                                 const BurialRecord* record = nullptr);
/// As the scene was built once, whatever its lamps were then. `sides`: sidesOf() it; kBadInput where it cannot have had
/// them.
[[nodiscard]] Result<BuiltScene> buildAgain(const Scene& scene, const ChartOptions& options, const SideBits& sides);

}  // namespace radiosity::scene
