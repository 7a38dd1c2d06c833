// How much of each leaf is covered by triangles, how much of that is buried inside other solids, and where on the leaf
// one may stand. Last step of buildPatchScene (charts.h). Areas in unit box squared.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

class BurialRecord;
class FormerBurial;

/// What a surface is to what lies behind it.
enum class Hides : std::uint8_t {
  kNothing,  ///< one can see through it
  kSheet,    ///< opaque and seen from both sides: bounds no solid, but one does not see beyond it either
  kSolid,    ///< opaque and seen from one side: bounds a solid
};

/// The part of a leaf that one triangle covers; kept only for leaves that no single triangle covers wholly.
struct LeafPiece {
  std::uint32_t leaf;  ///< into PatchScene::leaves
  std::uint32_t triangle;
  float area;
};

/// Fills leaves and level 0 of node_area (both sides) for every surface: each triangle clipped against the texels it
/// touches (Sutherland and Hodgman 1974), in double, in bands of rows so that memory stays bounded. Needs surfaces,
/// vertices and frames; sizes leaves and node_area. Returns the pieces, sorted by leaf.
[[nodiscard]] std::vector<LeafPiece> measureCoverage(PatchScene& patches);

using FindFormerBurial = std::function<std::unique_ptr<const FormerBurial>()>;
/// Takes the part of each leaf that lies inside another solid out of node_area and moves leaf points to what is left.
/// `hides`: by surface. Needs Surface::see_through and emits. Adds warnings about coincident faces.
/// Returns how it was found, or null where that is too much to keep. `find_former`: makes what is known of the scene
/// before an edit, if anything, while other things are made; leaves that it answers for are not looked at again, and
/// get the same bits.
std::shared_ptr<const BurialRecord> removeBuried(PatchScene& patches, const std::vector<LeafPiece>& pieces,
                                                 const std::vector<Hides>& hides, const FindFormerBurial& find_former);

/// Places on a leaf, which lie evenly over what is left of it. Small, since edits remember those of many leaves.
struct LeafPlaces {
  LeafSpots::Lattice lattice;
  std::vector<std::uint16_t> numbers;
  std::vector<std::uint32_t> triangles;  ///< by place; or one, of all

  void add(std::uint16_t number, std::uint32_t triangle);
  /// As LeafSpots::order has them.
  void order();
  [[nodiscard]] std::size_t bytes() const { return numbers.size() * 2 + triangles.size() * 4; }
};

/// Of a leaf that is not full, in order; without any it keeps its point.
void keepSpots(PatchScene& patches, LeafPoint& leaf, const LeafPlaces& places);

/// Places on every leaf that is neither empty nor full and has none yet.
void placeSpots(PatchScene& patches, const std::vector<LeafPiece>& pieces);

/// The same for full leaves of planes right before which something else stands (a lamp close under a ceiling): there,
/// light changes within a leaf. Both sides.
void placeSpotsInGaps(PatchScene& patches);
/// The same after an edit of `before`, with the same result: of surfaces that it left alone only what is near to others
/// is looked at. `surface_before`: as of matchSurfaces().
void placeSpotsInGaps(PatchScene& patches, const PatchScene& before, std::span<const std::uint32_t> surface_before);

/// Sums level 0 of node_area up all pyramids.
void sumAncestors(PatchScene& patches);

/// Barycentric test in texel coordinates, borders included within `slack` texels.
[[nodiscard]] bool triangleHolds(const PatchScene& patches, std::uint32_t triangle, const glm::dvec2& texel,
                                 double slack = 1e-6);

}  // namespace radiosity::scene
