// How a scene becomes patches (buildPatchScene, patch_scene.h). Plain values, any thread; used only inside this folder.
//
//   flatten.h    instances -> welded triangles in the unit box, degenerate ones dropped and counted
//   wall_cutter.h  flat faces cut along the walls that stand on them, so that no texel lies in two rooms
//                  wall_finder.h       where walls meet a face
//                  facet_cutter.h      the face cut there into convex pieces
//                  facet_regions.h     which of these hang together
//   charts.h     triangles -> charts: groups of triangles with a plane map each
//                  charts_facets.cpp   coplanar connected triangles = facets ("polygons"); large ones are charts
//                  charts_curved.cpp   small facets grown into curved charts by normal spread
//                  charts_uv.cpp       the file's own TEXCOORD_1 where it is a valid lightmap layout
//                  charts_uv_gutters.cpp  whether its islands keep apart
//                  charts_fit.cpp      plane maps, minimum-area rectangles, no overlap inside a chart
//                  charts_seams.cpp    edges shared by charts, for stitching
//   lit_sides.h  which sides of double-sided charts light can reach
//                  charts_sides.cpp    what that makes of the charts
//   atlas.h      texel size from the budget, grid of each chart, packing into pages
//   coverage.h   exact clipped area of every leaf, points on leaves, burial inside other solids
//   charts.cpp   puts it together
//
// Then shade.cpp gives emission and reflectance, and pages.cpp brings solved irradiance back onto the pages.
//
// Why rectangles: a wall is a rectangle nearly always. Its grid is stretched so that whole texels span it exactly:
// no partly covered leaves, no fill, no seams inside a wall.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/charts/build.h"
#include "server/scene/charts/flatten.h"
#include "server/scene/shading/lit_sides.h"
#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// Triangles that share a texel grid. `corners` are plane coordinates: unit-box lengths from the rectangle's corner for
/// charts of our own, TEXCOORD_1 for the file's.
struct Chart {
  std::uint32_t instance = kNone;
  std::vector<std::uint32_t> triangles;              ///< into FlatScene::triangles
  std::vector<std::array<glm::dvec2, 3>> corners;    ///< one for each triangle
  bool planar = false;                               ///< coplanar and one affine map
  bool from_file = false;                            ///< TEXCOORD_1; all charts of such an instance keep their layout
  glm::dvec3 axis_u{0.0}, axis_v{0.0}, normal{0.0};  ///< own charts: the plane's frame, right-handed
  glm::dvec2 size{0.0};                              ///< own charts: the rectangle's sides
  double area = 0.0;                                 ///< of the triangles, unit box squared
  bool flipped = false;                              ///< Surface::flipped
  bool back_lit = false;                             ///< the back has patches, too
  bool shows_back = false;                           ///< Surface::shows_back
  double detail = 1.0;  ///< Surface::detail; the same of all charts of an instance that keep their layout
  bool dark = false;    ///< no light reaches either side: one texel is enough (isLeftCoarse)
};

/// Facet (coplanar connected triangles of one instance) of each triangle.
struct Facets {
  std::vector<std::uint32_t> of_triangle;
  struct Facet {
    std::vector<std::uint32_t> triangles;  ///< seed (largest) first
    glm::dvec3 normal{0.0};                ///< the seed's
    double area = 0.0;
  };
  std::vector<Facet> facets;
};

/// Triangles for which `wanted` holds; the others get facet kNone.
[[nodiscard]] Facets findFacets(const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                                const std::vector<bool>& wanted);

/// Groups facets that are narrower than `planar_side` (unit box) with smooth neighbours; each list is one chart's
/// facets. Normals within `angle_deg` of the group's mean; up to 45 degrees while the group is smaller than
/// `small_area`.
[[nodiscard]] std::vector<std::vector<std::uint32_t>> groupFacets(const FlatScene& flat,
                                                                  const std::vector<std::uint32_t>& neighbours,
                                                                  const Facets& facets, double planar_side,
                                                                  double small_area, double angle_deg);

/// Charts of the groups: projected on the mean plane, split where a projection would fold or overlap, and fitted with
/// the rectangle of least area.
[[nodiscard]] std::vector<Chart> fitCharts(const FlatScene& flat, const Facets& facets,
                                           const std::vector<std::vector<std::uint32_t>>& groups);

/// Sides of the smallest rectangle around the triangles in their plane: (longer, shorter).
[[nodiscard]] glm::dvec2 rectangleSides(const FlatScene& flat, const std::vector<std::uint32_t>& triangles,
                                        const glm::dvec3& normal);

/// True when no two triangles overlap by more than rounding. Near-linear for meshes.
[[nodiscard]] bool overlapFree(const std::vector<std::array<glm::dvec2, 3>>& triangles);

/// Distributes triangles over layers so that none overlaps another of its layer; 0 is the largest.
[[nodiscard]] std::vector<std::uint32_t> overlapLayers(const std::vector<std::array<glm::dvec2, 3>>& triangles);

/// Why an instance's TEXCOORD_1 cannot be a lightmap layout; empty: it can.
[[nodiscard]] std::string lightmapUvFault(const Scene& scene, const FlatScene& flat, std::uint32_t instance);

/// Islands of an instance's TEXCOORD_1.
[[nodiscard]] std::vector<Chart> uvCharts(const Scene& scene, const FlatScene& flat,
                                          const std::vector<std::uint32_t>& neighbours, std::uint32_t instance);

/// Instances whose TEXCOORD_1 has islands so close that bilinear lookups on one read texels of another, at the texels
/// (of edge `texel`, unit box) that the layout will have. Islands that continue each other, in UV as in space, may
/// meet.
[[nodiscard]] std::vector<std::uint32_t> bleedingLayouts(const Scene& scene, const FlatScene& flat,
                                                         const std::vector<Chart>& charts, double texel,
                                                         const ChartOptions& options);

/// Charts of a file's own layout get texels alike, as many in all as if each had its own Chart::detail. None get
/// coarser ones: islands would come nearer to each other. `charts`: those of an instance lie together.
void shareDetailOfLayouts(std::vector<Chart>& charts);

/// Charts whose sides are chosen, and what they are made of. Refers to its parts; those that are turned around are
/// turned in `flat`, too.
struct SidedCharts {
  const Scene& scene;
  Sky sky;       ///< black: none
  double texel;  ///< edge, unit box
  const WallCuts& cuts;
  FlatScene& flat;
  std::vector<Chart>& charts;
};

/// Gives the sides of double-sided charts patches where light can reach them. Where light, or else a look, comes to the
/// back alone, the chart is turned around. `before`: null, or the scene before an edit, and `former` by chart its
/// surface there, or null: what had patches keeps them. Cost: lightOnSides().
void litSides(const SidedCharts& of, const FormerScene* before, const std::vector<const Surface*>& former);

/// The same as it was decided before. kBadInput: `sides` are none of these charts; these are of no use then.
[[nodiscard]] Result<void> takeSides(const SidedCharts& of, const SideBits& sides);

/// Fills patches.seams. `sources`: flat triangle of each patch triangle. Edges are matched by position, so also between
/// instances (tiles of a floor), where the angle between the faces is below `smooth_deg`, or both have normals from the
/// file that are the same along the edge.
void findSeams(const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
               const std::vector<std::uint32_t>& sources, double smooth_deg, const ShadingNormals& normals,
               PatchScene& patches);

}  // namespace radiosity::scene
