// Where on a leaf that is not full one may stand, several times over: its irradiance is the mean over what is left of
// it.
#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <utility>
#include <vector>

#include "common/parallel.h"
#include "server/geometry/bvh.h"
#include "server/scene/burial/burial_budget.h"
#include "server/scene/burial/coverage.h"

namespace radiosity::scene {
namespace {

/// Coordinates on two triangles mean the same place, to the bit: what lies behind a surface by less than anybody sees
/// has its light hidden by it.
bool isOneFrame(const TriangleFrame& one, const TriangleFrame& other) {
  return one.origin == other.origin && one.du == other.du && one.dv == other.dv && one.normal == other.normal;
}

std::vector<LeafSpots::Place> listOf(const LeafPlaces& places) {
  std::vector<LeafSpots::Place> list;
  for (std::size_t i = 0; i < places.numbers.size(); ++i)
    list.push_back({places.numbers[i], places.triangles.size() == 1 ? places.triangles.front() : places.triangles[i]});
  return list;
}

}  // namespace

void LeafPlaces::add(std::uint16_t number, std::uint32_t triangle) {
  numbers.push_back(number);
  if (triangles.empty() || (triangles.size() == 1 && triangles.front() == triangle)) {
    triangles.assign(1, triangle);
    return;
  }
  triangles.resize(numbers.size() - 1, triangles.front());
  triangles.push_back(triangle);
}

void LeafPlaces::order() {
  auto places = listOf(*this);
  LeafSpots::order(lattice.points, places);
  for (std::size_t i = 0; i < places.size(); ++i) {
    numbers[i] = places[i].number;
    if (triangles.size() > 1) triangles[i] = places[i].triangle;
  }
}

void keepSpots(PatchScene& patches, LeafPoint& leaf, const LeafPlaces& places) {
  if (places.numbers.empty()) return;
  const bool in_one_frame = std::ranges::all_of(places.triangles, [&](std::uint32_t triangle) {
    return isOneFrame(patches.triangles[leaf.triangle], patches.triangles[triangle]);
  });
  leaf.spot_list = patches.spots.add(places.lattice, listOf(places), in_one_frame);
}

namespace {

/// Points of the lattice over what is covered of a leaf; where fewer than the first of them lie on it, of a finer one.
constexpr std::array<std::uint32_t, 3> kPlacesTried{64, 256, 1024};

/// Of a leaf, what pieces cover of it, in texels.
LeafSpots::Lattice boxAround(const PatchScene& patches, std::span<const LeafPiece> pieces, const glm::dvec2& corner) {
  glm::dvec2 low = corner + 1.0, high = corner;
  for (const auto& piece : pieces) {
    interruptionPoint();
    const std::size_t first = 3 * std::size_t{piece.triangle};
    const auto texel = [&](std::size_t k) { return glm::dvec2(patches.vertices[patches.indices[first + k]].texel); };
    low = glm::min(low, glm::min(texel(0), glm::min(texel(1), texel(2))));
    high = glm::max(high, glm::max(texel(0), glm::max(texel(1), texel(2))));
  }
  low = glm::clamp(low, corner, corner + 1.0);
  return {glm::vec2(low), glm::vec2(glm::clamp(high, low, corner + 1.0) - low)};
}

/// Evenly over what is covered: a sliver of a leaf of which all places were drawn would have one or two of them, and
/// these would stand for all of it in every sample.
LeafPlaces findPlaces(const PatchScene& patches, std::span<const LeafPiece> pieces, const glm::dvec2& corner) {
  LeafPlaces found{boxAround(patches, pieces, corner), {}, {}};
  for (const auto count : kPlacesTried) {
    found.lattice.points = count;
    found.numbers.clear();
    found.triangles.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
      const glm::dvec2 texel(found.lattice.at(i));
      const auto holds = [&](const LeafPiece& piece) { return triangleHolds(patches, piece.triangle, texel, 0.0); };
      const auto at = std::ranges::find_if(pieces, holds);
      if (at != pieces.end()) found.add(static_cast<std::uint16_t>(i), at->triangle);
    }
    if (found.numbers.size() >= kPlacesTried.front()) break;
  }
  found.order();
  return found;
}

}  // namespace

void placeSpots(PatchScene& patches, const std::vector<LeafPiece>& pieces) {
  std::size_t surface = 0;
  for (std::size_t first = 0, end = 0; first < pieces.size(); first = end) {
    interruptionPoint();
    const std::uint32_t index = pieces[first].leaf;
    while (end < pieces.size() && pieces[end].leaf == index) ++end;
    auto& leaf = patches.leaves[index];
    if (leaf.triangle == kNone || leaf.full || leaf.hasSpots()) continue;
    if (leaf.cut) continue;  // what is left of it is too small to hold any
    while (surface + 1 < patches.surfaces.size() && patches.surfaces[surface + 1].first_leaf <= index) ++surface;
    const std::uint32_t local = index - patches.surfaces[surface].first_leaf, width = patches.surfaces[surface].width;
    const glm::dvec2 corner(local % width, local / width);
    keepSpots(patches, leaf, findPlaces(patches, std::span(pieces).subspan(first, end - first), corner));
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
constexpr float kHoverReach = 2.0F;
/// What changed counts as so much larger (unit box): well above the rounding of boxes.
constexpr float kChangeMargin = 1e-4F;
/// Surfaces: fewer are not worth a thread.
constexpr std::size_t kFewestAShare = 32;

class Gaps {
 public:
  explicit Gaps(PatchScene& patches, const PatchScene* before = nullptr,
                std::span<const std::uint32_t> surface_before = {})
      : patches_(patches),
        looks_(affordableLooks(patches.leaves.size())),
        before_(before),
        surface_before_(surface_before) {
    std::vector<Bvh::Triangle> triangles(patches.triangles.size());
    for (std::size_t i = 0; i < patches.indices.size(); ++i)
      triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
    tree_ = Bvh(std::move(triangles));
    if (before_ != nullptr) findChanged();
  }

  /// Found side by side, kept in the order of the surfaces.
  void run() {
    std::vector<std::vector<Found>> found(patches_.surfaces.size());
    inShares(found.size() / kFewestAShare, [&](std::size_t share, std::size_t shares) {
      for (auto s = static_cast<std::uint32_t>(share); s < found.size(); s += static_cast<std::uint32_t>(shares)) {
        interruptionPoint();
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
  [[nodiscard]] static bool mayHave(const LeafPoint& leaf) { return leaf.full && !leaf.hasSpots(); }
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

  /// Around surfaces that are not where they were, in either scene.
  void findChanged() {
    std::vector<bool> stayed(before_->surfaces.size(), false);
    const auto add = [&](const Surface& surface) {
      changed_.push_back({surface.bounds_min - kChangeMargin, surface.bounds_max + kChangeMargin});
    };
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
      if (surface_before_[s] == kNone) {
        add(patches_.surfaces[s]);
      } else {
        stayed[surface_before_[s]] = true;
      }
    }
    for (std::uint32_t s = 0; s < stayed.size(); ++s)
      if (!stayed[s]) add(before_->surfaces[s]);
    joinBoxes(changed_);
  }

  /// What is asked of a node may have another answer than before the edit, on one of its sides: of both it is kept
  /// together.
  [[nodiscard]] bool mayDiffer(std::uint32_t s, std::uint32_t level, glm::uvec2 at) const {
    if (before_ == nullptr || surface_before_[s] == kNone) return true;
    const auto &sides = patches_.surfaces[s].first_node, &former = before_->surfaces[surface_before_[s]].first_node;
    for (std::size_t side = 0; side < 2; ++side) {
      if ((sides[side] == kNone) != (former[side] == kNone)) return true;
      if (sides[side] != kNone && isNearChanged(boxBefore(s, side == 0 ? 1.0F : -1.0F, level, at, 2.0F * kHoverReach)))
        return true;
    }
    return false;
  }

  [[nodiscard]] bool isNearChanged(const Bvh::OrientedBox& box) const {
    const glm::vec3 half =
        glm::abs(box.axes[0]) * box.half.x + glm::abs(box.axes[1]) * box.half.y + glm::abs(box.axes[2]) * box.half.z;
    return std::ranges::any_of(changed_, [&](const ChangedBox& changed) {
      return glm::all(glm::lessThanEqual(box.centre - half, changed.high)) &&
             glm::all(glm::lessThanEqual(changed.low, box.centre + half));
    });
  }

  /// Of a node that nothing changed near to. Of leaves that were not full it is not known.
  void inherit(std::uint32_t s, float side, std::uint32_t level, glm::uvec2 at, std::vector<Found>& found) const {
    const Surface &surface = patches_.surfaces[s], &former = before_->surfaces[surface_before_[s]];
    const glm::uvec2 end = glm::min((at + 1U) << level, glm::uvec2(surface.width, surface.height));
    for (auto y = at.y << level; y < end.y; ++y) {
      interruptionPoint();
      for (auto x = at.x << level; x < end.x; ++x) {
        const auto leaf = y * surface.width + x;
        if (!mayHave(patches_.leaves[surface.first_leaf + leaf])) continue;
        const auto& was = before_->leaves[former.first_leaf + leaf];
        if (!was.full) {
          ask(s, side, 0, {x, y}, found);
        } else if (was.spot_list == kFullSpots) {
          found.push_back({{x, y}, was.cut});
        }
      }
    }
  }

  /// Whether a leaf of the node may have spots for lying in a gap. Where solids lie through each other hardly any may.
  [[nodiscard]] bool anyMayHave(const Surface& surface, std::uint32_t level, glm::uvec2 at) const {
    const glm::uvec2 end = glm::min((at + 1U) << level, glm::uvec2(surface.width, surface.height));
    for (auto y = at.y << level; y < end.y; ++y)
      for (auto x = at.x << level; x < end.x; ++x)
        if (mayHave(patches_.leaves[surface.first_leaf + y * surface.width + x])) return true;
    return false;
  }

  void descend(std::uint32_t s, float side, std::uint32_t level, glm::uvec2 at, std::vector<Found>& found) const {
    if (!anyMayHave(patches_.surfaces[s], level, at)) return;
    if (mayDiffer(s, level, at)) {
      ask(s, side, level, at, found);
    } else {
      inherit(s, side, level, at, found);
    }
  }

  void ask(std::uint32_t s, float side, std::uint32_t level, glm::uvec2 at, std::vector<Found>& found) const {
    const Surface& surface = patches_.surfaces[s];
    const auto touches = [&](const Bvh::OrientedBox& box) {
      return tree_.touches(box, patches_.triangle_surface, s, looks_);
    };
    if (!touches(boxBefore(s, side, level, at, kInterior - 1.0F)) &&
        !tree_.hoversIn(boxBefore(s, side, level, at, 2.0F * kHoverReach), patches_.triangle_surface, s, looks_))
      return;
    if (level == 0) {
      found.push_back({at, touches(boxBefore(s, side, 0, at, kInterior - 1.0F, kCut))});
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
    if (!mayHave(leaf)) return;
    leaf.spot_list = kFullSpots;
    leaf.cut = found.cut;
  }

  PatchScene& patches_;
  const std::size_t looks_;
  const PatchScene* before_;  ///< null: no edit
  std::span<const std::uint32_t> surface_before_;
  std::vector<ChangedBox> changed_;
  Bvh tree_;
};

}  // namespace

void placeSpotsInGaps(PatchScene& patches) { Gaps(patches).run(); }

void placeSpotsInGaps(PatchScene& patches, const PatchScene& before, std::span<const std::uint32_t> surface_before) {
  Gaps(patches, &before, surface_before).run();
}

}  // namespace radiosity::scene
