// What the light transport sees: triangles in a unit box, charts with mip pyramids of patches, and where each leaf
// patch lies. Built once per geometry; immutable; shared by const pointer between solve thread and workers.
//
// Leaf patch == lightmap texel. A chart ("surface") is a width x height grid of leaves. Level l has
// ceil(width / 2^l) x ceil(height / 2^l) nodes; node (x, y) of level l covers leaves [x 2^l, (x+1) 2^l) x [y 2^l, ...),
// so the ancestor of leaf (x, y) at level l is (x >> l, y >> l). The last level is 1 x 1. A surface side's nodes lie
// consecutively, level 0 first, row-major. Front and back of a double-sided surface are two surfaces in all but their
// geometry: each has nodes and texels of its own wherever light may reach it (lit_sides.h).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/ext/vector_uint3_sized.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <tuple>
#include <vector>

#include "common/result.h"
#include "server/scene/values/closed_solids.h"
#include "server/scene/values/glass_face.h"
#include "server/scene/values/leaf_spots.h"
#include "server/scene/values/scene.h"
#include "server/scene/values/side_colours.h"
#include "server/scene/values/wall_cuts.h"

namespace radiosity::scene {

/// A corner of a triangle as drawn. Corners are shared only between triangles of the same plane and chart, so `normal`
/// (the triangle's geometric normal, front side) is constant over a triangle.
struct PatchVertex {
  glm::vec3 position;  ///< unit box
  std::uint32_t surface;
  glm::vec2 texel;  ///< chart coordinates in leaf texels: leaf (x, y) covers [x, x+1) x [y, y+1)
  glm::vec3 normal;
};

/// Affine map of a triangle: position(texel) = origin + texel.x du + texel.y dv (unit box). normal = front side.
struct TriangleFrame {
  glm::vec3 origin, du, dv, normal;
};

/// LeafPoint::spot_list of full leaves: that of kSpotsOfFull.
inline constexpr std::uint32_t kFullSpots = kNone - 1;

/// Where a leaf is: a point (texel coordinates) on the part of the leaf that is covered and not buried inside another
/// solid, and the triangle that holds it. `full`: wholly covered by coplanar triangles and wholly unburied, so any
/// point of the texel may be used with the triangle's frame.
struct LeafPoint {
  glm::vec2 texel;
  std::uint32_t triangle = kNone;  ///< kNone: the leaf is empty
  bool full = false;
  bool cut = false;                 ///< something passes through the leaf, or right before it
  bool beneath = false;             ///< another surface lies in its plane and covers some of it
  std::uint32_t spot_list = kNone;  ///< of PatchScene::spots, or kFullSpots; kNone: any point stands for all

  [[nodiscard]] bool hasSpots() const { return spot_list != kNone; }
};

/// Where texel (0, 0) of something lies on the lightmap pages.
struct PagePlace {
  std::uint32_t page = kNone;  ///< kNone: it has no texels
  std::uint32_t x = 0, y = 0;

  bool operator==(const PagePlace&) const = default;
};

struct Surface {
  std::uint32_t instance = kNone;
  std::uint32_t material = kNone;
  std::uint32_t width = 0, height = 0, level_count = 0;
  std::array<std::uint32_t, 2> first_node{kNone, kNone};  ///< front, back; kNone: that side only absorbs
  std::uint32_t first_leaf = 0;                           ///< into PatchScene::leaves; shared by both sides
  std::array<PagePlace, 2> place;                         ///< of leaf (0, 0); front, back: each side with nodes has one
  /// The front is the back of the file's triangles, where light reaches only that side of a double-sided surface.
  bool flipped = false;
  bool shows_back = false;  ///< one can see the back: it has texels, or else is dark (PatchScene::black)
  std::uint32_t first_triangle = 0, triangle_count = 0;
  glm::vec3 bounds_min{0.0F}, bounds_max{0.0F};
  bool planar = false;
  bool see_through =
      false;           ///< some of it is cut out, blends or transmits: PatchScene::opacity says where and how much
  bool emits = false;  ///< some of it does (emitters.h): of surfaces in one place it is seen
  GlassFace glass;     ///< how what PatchScene::opacity says for light straight at it depends on the angle
  std::uint32_t opacity_scale = 1;        ///< cells of the opacity grid across a leaf
  std::uint32_t first_opacity = 0;        ///< of width x opacity_scale by height x opacity_scale cells, row-major
  std::uint32_t first_tint_cell = kNone;  ///< of PatchScene::tints, as many cells; kNone: it may not tint
  std::uint32_t first_tint = kNone;       ///< of PatchScene::leaf_tints; kNone: what passes keeps its colour
  float texel_area = 0.0F;                ///< area of a full leaf, unit box squared
  float detail = 1.0F;                    ///< its texels are about so many times as fine as PatchScene::texel
};

struct Page {
  std::uint32_t width = 0, height = 0;
};

struct PatchScene {
  // unit = (world - centre) / scale; areas in the unit box times scale^2 are m^2
  glm::dvec3 centre{0.0};
  double scale = 1.0;

  std::vector<PatchVertex> vertices;
  std::vector<std::uint32_t> indices;    ///< 3 a triangle; triangles of a surface lie together
  std::vector<TriangleFrame> triangles;  ///< one for each triangle
  std::vector<std::uint32_t> triangle_surface;
  std::vector<std::uint32_t> triangle_source;  ///< by triangle: which one of its instance's primitive it was
  WallCuts cuts;                               ///< primitives of which these are numbers, where they are cut
  std::vector<Surface> surfaces;
  ClosedSolids solids;  ///< findClosedSolids(); empty: none is known
  std::vector<LeafPoint> leaves;
  /// Of each leaf that is neither empty nor full: spread evenly over the covered and unburied part. Full ones in narrow
  /// gaps, or right beside what hovers before them, have kFullSpots.
  LeafSpots spots;
  /// Unit box squared: covered and unburied part, times its opacity; parent = sum of children; 0 = empty. What a leaf
  /// catches of the light is irradiance times this, so irradiance needs no opacity anywhere.
  std::vector<float> node_area;
  std::vector<std::uint8_t> opacity;  ///< grids of the surfaces that one can see through; 255: lets nothing through
  /// Of coloured glass `opacity` is that of the channel that passes best; of the others these parts pass of that, in
  /// steps of 1/kTintSteps, by cell from Surface::first_tint_cell on; empty: nothing is coloured. Of whole leaves: by
  /// leaf of surfaces with Surface::first_tint.
  static constexpr std::uint16_t kTintSteps = 65535;
  std::vector<glm::u16vec3> tints;
  std::vector<glm::vec3> leaf_tints;
  std::vector<Page> pages;

  /// A few black texels, which all sides share that are seen and never lit. page kNone: there is no such side.
  PagePlace black;
  static constexpr std::uint32_t kBlackSide = 4;  ///< so many by so many, for mips and bilinear lookups

  /// Lightmap coordinates of the imported vertices, for each side of the file's triangles: one for each corner of each
  /// instance's triangles (as cut), in page UV [0, 1] (v down, row 0 = v 0), and the page of each triangle (kNone: it
  /// is dropped, or nobody sees that side). For the exporter and the viewer.
  struct SideUv {
    std::vector<std::array<glm::vec2, 3>> corners;  ///< by triangle of the primitive; empty: as if all pages were kNone
    std::vector<std::uint32_t> page;                ///< by triangle of the primitive

    [[nodiscard]] bool shows(std::size_t triangle) const { return triangle < page.size() && page[triangle] != kNone; }
    bool operator==(const SideUv&) const = default;
  };
  struct InstanceUv {
    std::array<SideUv, 2> side;  ///< front and back of the triangle in the file

    bool operator==(const InstanceUv&) const = default;
  };
  std::vector<InstanceUv> instance_uvs;  ///< one for each Scene::instances entry

  /// An edge two charts share where the surface is smooth across it (so irradiance is continuous): its ends in the
  /// texel coordinates of both. assemblePages makes bilinear lookups agree along it.
  struct Seam {
    std::array<std::uint32_t, 2> surface;
    std::array<std::array<glm::vec2, 2>, 2> texel;  ///< by side, by end
  };
  std::vector<Seam> seams;

  /// A side of a leaf right behind that of another surface which faces the same way and is lit in its place, and where
  /// on that: what comes first by seenOrder(). Lightmaps show that light in both: who draws them sees now one, now the
  /// other.
  struct Covered {
    std::uint32_t leaf, side;
    std::uint32_t surface, surface_side;  ///< that covers it
    glm::vec2 texel;
  };
  std::vector<Covered> covered;  ///< leaves ascending, sides of each likewise

  /// Edge of a texel where nothing asks for another (unit box): as charts were laid out, and as a first guess decided
  /// which facets are charts of their own.
  double texel = 0.0, rough_texel = 0.0;

  std::vector<std::string> warnings;
  std::uint64_t polygons = 0;  ///< coplanar facets (what the paper calls polygons)
  std::uint64_t triangles_dropped = 0;

  /// How much a place of a surface that one can see through holds back; 255: all.
  [[nodiscard]] std::uint8_t opacityAt(const Surface& surface, const glm::vec2& texel) const {
    return opacity[opacityCell(surface, texel)];
  }
  /// Which of the cells a place lies in.
  [[nodiscard]] std::size_t opacityCell(const Surface& surface, const glm::vec2& texel) const {
    const auto cell = [&](float place, std::uint32_t leaves) {
      const auto scaled =
          static_cast<std::uint32_t>((place > 0.0F ? place : 0.0F) * static_cast<float>(surface.opacity_scale));
      return scaled < leaves * surface.opacity_scale ? scaled : leaves * surface.opacity_scale - 1;
    };
    const auto row = std::size_t{cell(texel.y, surface.height)} * surface.width * surface.opacity_scale;
    return surface.first_opacity + row + cell(texel.x, surface.width);
  }
  /// Of what passes there, by chance or in part, what is left.
  [[nodiscard]] glm::vec3 tintAt(const Surface& surface, const glm::vec2& texel) const {
    if (surface.first_tint == kNone) return glm::vec3(1.0F);
    const auto cell = opacityCell(surface, texel) - surface.first_opacity + surface.first_tint_cell;
    return glm::vec3(tints[cell]) / static_cast<float>(kTintSteps);
  }
  /// Part of the light travelling along `direction`, of whatever length, that a surface one can see through stops at a
  /// place of a triangle.
  [[nodiscard]] float stoppedAt(std::uint32_t triangle, const glm::vec2& texel, const glm::vec3& direction) const {
    const Surface& surface = surfaces[triangle_surface[triangle]];
    const float opacity = static_cast<float>(opacityAt(surface, texel)) / 255.0F;
    if (!surface.glass.isGlass()) return opacity;
    const float along = glm::dot(triangles[triangle].normal, direction);
    return surface.glass.stopped(opacity, GlassFace::edgeOf(std::abs(along) / glm::length(direction)));
  }

  /// Whether any surface is glass: what it stops depends on the angle, while its leaves' area is that of light from all
  /// around, so that what leaves are delivered does not add up to what is sent. O(surfaces).
  [[nodiscard]] bool hasGlass() const {
    return std::any_of(surfaces.begin(), surfaces.end(),
                       [](const Surface& surface) { return surface.glass.isGlass(); });
  }

  /// Of triangles that lie in one place and face the same way that of least order is seen: what emits first, so that no
  /// lamp is lost, then what is opaque, and then as in the file, since charts of a mesh lie in any order. Once
  /// Surface::see_through and Surface::emits are known.
  [[nodiscard]] auto seenOrder(std::uint32_t triangle) const {
    const Surface& surface = surfaces[triangle_surface[triangle]];
    return std::tuple(!surface.emits, surface.see_through, surface.instance, triangle_source[triangle], triangle);
  }

  [[nodiscard]] std::size_t nodeCount() const { return node_area.size(); }

  /// A place on a leaf that is not empty, by two uniform numbers in [0, 1); leaf (x, y) of its surface.
  [[nodiscard]] LeafSpot spotAt(const LeafPoint& leaf, std::uint32_t x, std::uint32_t y, const glm::vec2& at) const {
    if (leaf.full) return {glm::vec2(x, y) + at, leaf.triangle};
    if (!leaf.hasSpots()) return {leaf.texel, leaf.triangle};
    const auto count = spotCount(leaf);
    const auto wanted = static_cast<std::uint32_t>(at.x * static_cast<float>(count));
    return spot(leaf, wanted < count ? wanted : count - 1);
  }
  /// Of a leaf that has spots.
  [[nodiscard]] std::uint32_t spotCount(const LeafPoint& leaf) const {
    return leaf.spot_list == kFullSpots ? kLeafLattice : spots.countOf(leaf.spot_list);
  }
  /// Spot k < spotCount(leaf); any part of them in a row is a part of the leaf.
  [[nodiscard]] LeafSpot spot(const LeafPoint& leaf, std::uint32_t k) const {
    if (leaf.spot_list == kFullSpots) return {glm::floor(leaf.texel) + kSpotsOfFull[k], leaf.triangle};
    return spots.at(leaf.spot_list, k, leaf.triangle);
  }
};

/// Grid size and first node of one level, relative to a surface side's first node.
struct LevelGrid {
  std::uint32_t width, height, offset;
};

[[nodiscard]] inline LevelGrid levelGrid(std::uint32_t width, std::uint32_t height, std::uint32_t level) {
  std::uint32_t offset = 0;
  for (std::uint32_t l = 0; l < level; ++l) {
    const auto round = (1U << l) - 1;
    offset += ((width + round) >> l) * ((height + round) >> l);
  }
  const auto round = (1U << level) - 1;
  return {(width + round) >> level, (height + round) >> level, offset};
}

[[nodiscard]] inline std::uint32_t levelCount(std::uint32_t width, std::uint32_t height) {
  std::uint32_t levels = 1;
  for (auto size = width > height ? width : height; size > 1; size = (size + 1) >> 1) ++levels;
  return levels;
}

/// An axis-parallel box, unit box coordinates.
struct ChangedBox {
  glm::vec3 low, high;
};
/// Whether a ray of such a length, in lengths of its direction, from somewhere in a box of this half size about `from`
/// meets the other box.
[[nodiscard]] bool sweeps(const glm::dvec3& from, const glm::dvec3& half, const glm::dvec3& direction, double length,
                          const ChangedBox& box);

/// Charts keep their identity where they have the same grid on the same instance.
struct PatchMap {
  std::vector<std::uint32_t> surface_before;  ///< by surface: its former number, or kNone: it is new
  std::vector<bool> moved;                    ///< by surface: new, or elsewhere, or of another shape, than it was
  /// By leaf: of a moved surface, or what is left of it, or where one stands on it, is not what it was.
  std::vector<bool> leaf_altered;
  /// Around all that was or is now where something else is or was, one for each part of an instance or fewer.
  std::vector<ChangedBox> boxes;
  std::vector<ChangedBox> came;  ///< likewise, of what is there now alone

  [[nodiscard]] bool nothingKept() const;
};

/// Boxes that are hardly larger together than apart become one, and others until there are 16 at most.
void joinBoxes(std::vector<ChangedBox>& boxes);

/// Emission (exitance E = pi L_e, lm/m^2) and reflectance of every node (shadePatches).
struct PatchMaterials {
  SideColours emission;
  SideColours reflectance;  ///< diffuse
  /// Of the irradiance of a node's other side the part that leaves on this one: B = E + rho H + tau H_other. rho + tau
  /// is at most 0.999. Empty (no sides): nothing in the scene is translucent.
  SideColours transmittance;
  /// Where `transmittance` is not black: reflectance as the material would have it without diffuse transmission, by
  /// which renderers that do not know the extension multiply lightmaps. Empty likewise.
  SideColours base_reflectance;
  /// Where surfaces reflect as mirrors do (specular.h): by how much of what comes straight at them, and, of `lobe`, x
  /// the roughness, y the reflectance at a grazing angle, and z how much of what glass does not reflect passes (there
  /// Surface::glass has the law of angles). No sides: nothing does.
  SideColours specular, lobe;
  std::vector<std::string> warnings;
};
}  // namespace radiosity::scene
