// Where on a leaf that is not full one may stand, several times over: its irradiance is the mean over what is left of
// it.
#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "common/parallel.h"
#include "server/scene/bvh.h"
#include "server/scene/coverage.h"

namespace radiosity::scene {

glm::dvec2 latticePoint(std::uint32_t i, std::uint32_t count) {
  if (count < 16) {  // no generator spreads so few; these are Hammersley's
    std::uint32_t reversed = 0;
    for (std::uint32_t bit = 1; bit < count; bit *= 2) reversed = 2 * reversed + ((i & bit) != 0 ? 1 : 0);
    return {(i + 0.5) / count, (reversed + 0.5) / count};
  }
  const std::uint32_t generator = count == 1024 ? 275 : count == 256 ? 75 : count == 64 ? 19 : 5;
  return {(i + 0.5) / count, static_cast<double>((std::uint64_t{i} * generator) % count + 0.5) / count};
}

namespace {

/// Halves them, across and up in turn, so that each part of the order is a part of the leaf.
void orderByPlace(std::span<LeafSpot> places, int axis) {
  if (places.size() < 2) return;
  std::sort(places.begin(), places.end(), [axis](const LeafSpot& a, const LeafSpot& b) {
    return a.texel[axis] != b.texel[axis] ? a.texel[axis] < b.texel[axis] : a.texel[1 - axis] < b.texel[1 - axis];
  });
  const std::size_t half = places.size() / 2;
  orderByPlace(places.first(half), 1 - axis);
  orderByPlace(places.subspan(half), 1 - axis);
}

/// At even steps, so that what is a tenth of the leaf has a tenth of the spots, to one of them.
std::array<LeafSpot, kLeafSpots> chooseSpots(std::span<LeafSpot> places) {
  orderByPlace(places, 0);
  std::array<LeafSpot, kLeafSpots> spots;
  for (std::size_t k = 0; k < kLeafSpots; ++k) {
    const std::size_t place = k % kSpotQuarters * std::size_t{kSpotRows} + k / kSpotQuarters;
    spots[k] = places[(2 * place + 1) * places.size() / (2 * std::size_t{kLeafSpots})];
  }
  return spots;
}

std::array<glm::vec2, kLeafSpots> spotsOfFull() {
  std::array<LeafSpot, kLeafSpots> places;
  for (std::uint32_t i = 0; i < kLeafSpots; ++i) places[i].texel = glm::vec2(latticePoint(i, kLeafSpots));
  std::array<glm::vec2, kLeafSpots> spots;
  std::ranges::transform(chooseSpots(places), spots.begin(), &LeafSpot::texel);
  return spots;
}

}  // namespace

const std::array<glm::vec2, kLeafSpots> kSpotsOfFull = spotsOfFull();

void keepSpots(PatchScene& patches, LeafPoint& leaf, std::span<LeafSpot> places) {
  if (places.size() < 2) return;
  leaf.first_spot = static_cast<std::uint32_t>(patches.spots.size());
  const auto chosen = chooseSpots(places);
  patches.spots.insert(patches.spots.end(), chosen.begin(), chosen.end());
}

namespace {

/// Places on a leaf are drawn from so many, and where fewer than there are spots lie on it, from more of them.
constexpr std::array<std::uint32_t, 3> kPlacesTried{kLeafSpots, 256, 1024};

/// Of a leaf, what pieces cover of it, in texels.
struct CoveredBox {
  glm::dvec2 low, size;
};

CoveredBox boxAround(const PatchScene& patches, std::span<const LeafPiece> pieces, const glm::dvec2& corner) {
  glm::dvec2 low = corner + 1.0, high = corner;
  for (const auto& piece : pieces) {
    const std::size_t first = 3 * std::size_t{piece.triangle};
    const auto texel = [&](std::size_t k) { return glm::dvec2(patches.vertices[patches.indices[first + k]].texel); };
    low = glm::min(low, glm::min(texel(0), glm::min(texel(1), texel(2))));
    high = glm::max(high, glm::max(texel(0), glm::max(texel(1), texel(2))));
  }
  low = glm::clamp(low, corner, corner + 1.0);
  return {low, glm::clamp(high, low, corner + 1.0) - low};
}

/// Evenly over what is covered: a sliver of a leaf of which all places were drawn would have one or two of them, and
/// these would stand for all of it in every sample.
void findPlaces(const PatchScene& patches, std::span<const LeafPiece> pieces, const glm::dvec2& corner,
                std::vector<LeafSpot>& places) {
  const auto box = boxAround(patches, pieces, corner);
  for (const auto count : kPlacesTried) {
    places.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
      const glm::dvec2 texel = box.low + latticePoint(i, count) * box.size;
      const auto holds = [&](const LeafPiece& piece) { return triangleHolds(patches, piece.triangle, texel, 0.0); };
      const auto found = std::ranges::find_if(pieces, holds);
      if (found != pieces.end()) places.push_back({glm::vec2(texel), found->triangle});
    }
    if (places.size() >= kLeafSpots) return;
  }
}

}  // namespace

void placeSpots(PatchScene& patches, const std::vector<LeafPiece>& pieces) {
  std::vector<LeafSpot> places;
  std::size_t surface = 0;
  for (std::size_t first = 0, end = 0; first < pieces.size(); first = end) {
    const std::uint32_t index = pieces[first].leaf;
    while (end < pieces.size() && pieces[end].leaf == index) ++end;
    auto& leaf = patches.leaves[index];
    if (leaf.triangle == kNone || leaf.full || leaf.first_spot != kNone) continue;
    while (surface + 1 < patches.surfaces.size() && patches.surfaces[surface + 1].first_leaf <= index) ++surface;
    const std::uint32_t local = index - patches.surfaces[surface].first_leaf, width = patches.surfaces[surface].width;
    findPlaces(patches, std::span(pieces).subspan(first, end - first), glm::dvec2(local % width, local / width),
               places);
    keepSpots(patches, leaf, places);
  }
}

namespace {

/// Leaves are looked at in so many leaf widths before them, ...
constexpr float kGap = 0.5F;
/// What is so near cuts them.
constexpr float kCut = 0.25F;
/// ... starting well above the rounding of positions, and without their rims: walls that meet a floor are no gap.
constexpr float kLift = 2e-5F, kInterior = 0.9F;
/// What hovers beside a leaf counts so many leaf widths away, a pixel or two of an item buffer: a lamp in front of a
/// hole in the ceiling, whose shadow there falls on nothing that could make up for what pixels give it of the rim.
constexpr float kBeside = 2.0F;
/// Surfaces: fewer are not worth a thread.
constexpr std::size_t kFewestAShare = 32;

class Gaps {
 public:
  explicit Gaps(PatchScene& patches) : patches_(patches) {
    std::vector<Bvh::Triangle> triangles(patches.triangles.size());
    for (std::size_t i = 0; i < patches.indices.size(); ++i)
      triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
    tree_ = Bvh(std::move(triangles));
  }

  /// Found side by side, kept in the order of the surfaces.
  void run() {
    std::vector<std::vector<Found>> found(patches_.surfaces.size());
    inShares(found.size() / kFewestAShare, [&](std::size_t share, std::size_t shares) {
      for (auto s = static_cast<std::uint32_t>(share); s < found.size(); s += static_cast<std::uint32_t>(shares)) {
        const Surface& surface = patches_.surfaces[s];
        for (std::size_t side = 0; side < 2 && surface.planar; ++side) {
          if (surface.first_node[side] == kNone) continue;
          descend(s, side == 0 ? 1.0F : -1.0F, surface.level_count - 1, {0, 0}, found[s]);
        }
      }
    });
    for (std::size_t s = 0; s < found.size(); ++s) {
      for (const auto& leaf : found[s]) place(patches_.surfaces[s], leaf);
    }
  }

 private:
  struct Found {
    glm::uvec2 at;
    bool cut;
  };
  /// Space right before a node, on one side, wider than the node by so many leaf widths.
  [[nodiscard]] Bvh::OrientedBox boxBefore(std::uint32_t s, float side, std::uint32_t level, glm::uvec2 at, float wider,
                                           float gap = kGap) const {
    const Surface& surface = patches_.surfaces[s];
    const TriangleFrame& frame = patches_.triangles[surface.first_triangle];
    const glm::vec2 low(at << level);
    const glm::vec2 high(glm::min((at + 1U) << level, glm::uvec2(surface.width, surface.height)));
    const glm::vec2 middle = 0.5F * (low + high), extent = 0.5F * (high - low + wider);
    const float across = glm::length(frame.du), up = glm::length(frame.dv), depth = gap * std::min(across, up);
    const glm::vec3 normal = side * frame.normal, u = frame.du / across;
    Bvh::OrientedBox box;
    box.centre = frame.origin + middle.x * frame.du + middle.y * frame.dv + (kLift + 0.5F * depth) * normal;
    box.axes = {u, glm::normalize(glm::cross(normal, u)), normal};
    box.half = {extent.x * across, extent.y * up, 0.5F * depth};
    return box;
  }

  void descend(std::uint32_t s, float side, std::uint32_t level, glm::uvec2 at, std::vector<Found>& found) const {
    const Surface& surface = patches_.surfaces[s];
    if (!tree_.touches(boxBefore(s, side, level, at, kInterior - 1.0F), patches_.triangle_surface, s) &&
        !tree_.hoversIn(boxBefore(s, side, level, at, 2.0F * kBeside), patches_.triangle_surface, s))
      return;
    if (level == 0) {
      found.push_back(
          {at, tree_.touches(boxBefore(s, side, 0, at, kInterior - 1.0F, kCut), patches_.triangle_surface, s)});
      return;
    }
    const LevelGrid below = levelGrid(surface.width, surface.height, level - 1);
    for (std::uint32_t y = 2 * at.y; y < std::min(2 * at.y + 2, below.height); ++y)
      for (std::uint32_t x = 2 * at.x; x < std::min(2 * at.x + 2, below.width); ++x)
        descend(s, side, level - 1, {x, y}, found);
  }

  void place(const Surface& surface, const Found& found) {
    const auto at = found.at;
    auto& leaf = patches_.leaves[surface.first_leaf + at.y * surface.width + at.x];
    if (!leaf.full || leaf.first_spot != kNone) return;
    leaf.first_spot = kFullSpots;
    leaf.cut = found.cut;
  }

  PatchScene& patches_;
  Bvh tree_;
};

}  // namespace

void placeSpotsInGaps(PatchScene& patches) { Gaps(patches).run(); }

}  // namespace radiosity::scene
