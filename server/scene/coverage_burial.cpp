// The part of a surface that lies inside another solid (the floor under a block, a wall behind a cupboard) receives no
// light and must not count as area. A solid is what single-sided surfaces bound: from inside, one meets backs first.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "server/scene/bvh.h"
#include "server/scene/coverage.h"

namespace radiosity::scene {
namespace {

/// Rays start this far from the surface (unit box): well above the rounding of 32-bit positions (6e-8), well below
/// anything modelled.
constexpr double kLift = 2e-5;
constexpr std::uint32_t kFewSamples = 16, kManySamples = 64;
constexpr std::uint64_t kMaxSamples = 2'000'000;  ///< a scene; beyond it leaves get fewer

struct Bounds {
  glm::vec3 min{std::numeric_limits<float>::infinity()}, max{-std::numeric_limits<float>::infinity()};
  void add(const glm::vec3& p) {
    min = glm::min(min, p);
    max = glm::max(max, p);
  }
  void add(const Bounds& b) {
    min = glm::min(min, b.min);
    max = glm::max(max, b.max);
  }
  [[nodiscard]] bool empty() const { return min.x > max.x; }
};

glm::vec3 positionAt(const TriangleFrame& frame, const glm::dvec2& texel) {
  return glm::vec3(glm::dvec3(frame.origin) + texel.x * glm::dvec3(frame.du) + texel.y * glm::dvec3(frame.dv));
}

/// The triangles that bound solids, and the question whether a point lies inside one.
class Solids {
 public:
  Solids(const PatchScene& patches, const std::vector<bool>& solid) {
    std::vector<Bvh::Triangle> triangles;
    for (std::uint32_t t = 0; t < patches.triangles.size(); ++t) {
      if (!solid[patches.triangle_surface[t]]) continue;
      Bvh::Triangle triangle;
      for (std::size_t c = 0; c < 3; ++c)
        triangle[c] = patches.vertices[patches.indices[std::size_t{3} * t + c]].position;
      triangles.push_back(triangle);
      surface_.push_back(patches.triangle_surface[t]);
    }
    tree_ = Bvh(std::move(triangles));
  }

  [[nodiscard]] bool empty() const { return tree_.empty(); }

  /// True when a solid's surface, other than `surface` itself, passes through or touches the box.
  [[nodiscard]] bool near(const Bounds& box, std::uint32_t surface) const {
    const glm::vec3 margin(static_cast<float>(2.0 * kLift));
    return tree_.touches(box.min - margin, box.max + margin, surface_, surface);
  }

  /// Buried when rays into the whole hemisphere leave more solids than they enter. One odd face that is turned the
  /// wrong way, or a room whose roof was modelled from outside, does not bury what can be seen from elsewhere.
  [[nodiscard]] bool buries(const glm::vec3& position, const glm::vec3& normal) {
    const glm::dvec3 n(normal);
    const glm::dvec3 reference = std::abs(n.x) < 0.8 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    const glm::dvec3 u = glm::normalize(glm::cross(reference, n));
    const glm::dvec3 v = glm::cross(n, u);
    const glm::dvec3 origin = glm::dvec3(position) + n * kLift;
    // irrational-looking angles, so that no ray runs along modelled edges
    if (!leavesSolid(origin, n + 0.0713 * u + 0.0427 * v)) return false;
    for (int i = 0; i < 5; ++i) {
      const double angle = 0.3217 + 2.0 * M_PI * i / 5.0;
      if (!leavesSolid(origin, 0.6 * n + 0.8 * (std::cos(angle) * u + std::sin(angle) * v))) return false;
    }
    return true;
  }

 private:
  /// Walks a ray to the end: +1 for every solid entered (front), -1 for every one left (back); below zero, the origin
  /// was inside.
  bool leavesSolid(const glm::dvec3& origin, const glm::dvec3& direction) {
    hits_.clear();
    tree_.collectHits(origin, direction, 0.0, 8.0, hits_);
    std::ranges::sort(hits_, [](const RayHit& a, const RayHit& b) { return a.t < b.t; });
    int depth = 0;
    double last = -1.0;
    bool last_front = false;
    for (const RayHit& hit : hits_) {
      if (last_front == hit.front && hit.t - last < 1e-9) continue;  // the edge between two triangles
      last = hit.t;
      last_front = hit.front;
      depth += hit.front ? 1 : -1;
      if (depth < 0) return true;
    }
    return false;
  }

  Bvh tree_;
  std::vector<std::uint32_t> surface_;  ///< by triangle of the tree
  std::vector<RayHit> hits_;
};

/// Boxes around the nodes of one surface, for the question where other solids come near.
class NodeBoxes {
 public:
  NodeBoxes(const PatchScene& patches, std::uint32_t id, const std::vector<LeafPiece>& pieces,
            const std::vector<std::size_t>& first_piece)
      : patches_(patches), surface_(patches.surfaces[id]) {
    if (!surface_.planar) fillCurved(pieces, first_piece);
  }

  [[nodiscard]] Bounds box(std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
    if (!surface_.planar) {
      const LevelGrid grid = levelGrid(surface_.width, surface_.height, level);
      return boxes_[grid.offset + y * grid.width + x];
    }
    const TriangleFrame& frame = patches_.triangles[surface_.first_triangle];
    return cornersBox(frame, {x << level, y << level},
                      {std::min((x + 1) << level, surface_.width), std::min((y + 1) << level, surface_.height)});
  }

 private:
  static Bounds cornersBox(const TriangleFrame& frame, const glm::uvec2& low, const glm::uvec2& high) {
    Bounds box;
    for (const std::uint32_t x : {low.x, high.x})
      for (const std::uint32_t y : {low.y, high.y}) box.add(positionAt(frame, {x, y}));
    return box;
  }

  void fillCurved(const std::vector<LeafPiece>& pieces, const std::vector<std::size_t>& first_piece) {
    const LevelGrid top = levelGrid(surface_.width, surface_.height, surface_.level_count - 1);
    boxes_.resize(top.offset + 1);
    for (std::uint32_t i = 0; i < surface_.width * surface_.height; ++i) {
      const std::uint32_t leaf = surface_.first_leaf + i;
      if (patches_.leaves[leaf].triangle == kNone) continue;
      const glm::uvec2 low(i % surface_.width, i / surface_.width);
      boxes_[i] = cornersBox(patches_.triangles[patches_.leaves[leaf].triangle], low, low + 1U);
      for (std::size_t p = first_piece[leaf]; p < first_piece[leaf + 1]; ++p)
        boxes_[i].add(cornersBox(patches_.triangles[pieces[p].triangle], low, low + 1U));
    }
    LevelGrid below = levelGrid(surface_.width, surface_.height, 0);
    for (std::uint32_t level = 1; level < surface_.level_count; ++level) {
      const LevelGrid grid = levelGrid(surface_.width, surface_.height, level);
      for (std::uint32_t y = 0; y < below.height; ++y)
        for (std::uint32_t x = 0; x < below.width; ++x)
          boxes_[grid.offset + (y / 2) * grid.width + x / 2].add(boxes_[below.offset + y * below.width + x]);
      below = grid;
    }
  }

  const PatchScene& patches_;
  const Surface& surface_;
  std::vector<Bounds> boxes_;
};

class Burial {
 public:
  Burial(PatchScene& patches, const std::vector<LeafPiece>& pieces, const std::vector<bool>& solid)
      : patches_(patches), pieces_(pieces), solids_(patches, solid) {}

  void run() {
    if (solids_.empty()) return;
    first_piece_.assign(patches_.leaves.size() + 1, 0);
    for (const LeafPiece& piece : pieces_) ++first_piece_[piece.leaf + 1];
    for (std::size_t i = 1; i < first_piece_.size(); ++i) first_piece_[i] += first_piece_[i - 1];
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) classify(s);
    const std::uint64_t wanted = std::uint64_t{kFewSamples} * contacts_.size();
    few_ = wanted <= kMaxSamples ? kFewSamples
                                 : static_cast<std::uint32_t>(std::max<std::uint64_t>(
                                       1, kMaxSamples / std::max<std::size_t>(1, contacts_.size())));
    for (const Contact& contact : contacts_) measure(contact, few_);
    refineBorders();
    settleSides();
  }

 private:
  struct Contact {
    std::uint32_t surface, side, x, y;
  };
  /// A leaf that lost area, and the visible point found on it.
  struct Change {
    std::uint32_t leaf, side;
    LeafPoint point;
    std::vector<LeafSpot> places;  ///< where it is visible
  };

  [[nodiscard]] std::uint32_t leafOf(const Contact& c) const {
    const Surface& surface = patches_.surfaces[c.surface];
    return surface.first_leaf + c.y * surface.width + c.x;
  }
  [[nodiscard]] std::uint32_t nodeOf(const Contact& c) const {
    const Surface& surface = patches_.surfaces[c.surface];
    return surface.first_node[c.side] + c.y * surface.width + c.x;
  }
  [[nodiscard]] glm::vec3 facing(std::uint32_t triangle, std::uint32_t side) const {
    const glm::vec3& n = patches_.triangles[triangle].normal;
    return side == 0 ? n : -n;
  }
  [[nodiscard]] bool buried(std::uint32_t triangle, const glm::dvec2& texel, std::uint32_t side) {
    return solids_.buries(positionAt(patches_.triangles[triangle], texel), facing(triangle, side));
  }

  /// Splits a surface into nodes that no other solid comes near (all visible or all buried: one test) and single leaves
  /// in contact with one.
  void classify(std::uint32_t s) {
    const NodeBoxes boxes(patches_, s, pieces_, first_piece_);
    const Surface& surface = patches_.surfaces[s];
    for (std::uint32_t side = 0; side < 2; ++side)
      if (surface.first_node[side] != kNone) descend(boxes, s, side, surface.level_count - 1, 0, 0);
  }

  void descend(const NodeBoxes& boxes, std::uint32_t s, std::uint32_t side, std::uint32_t level, std::uint32_t x,
               std::uint32_t y) {
    const Surface& surface = patches_.surfaces[s];
    const Bounds box = boxes.box(level, x, y);
    if (box.empty()) return;
    if (!solids_.near(box, s)) {
      settleUniform(s, side, level, x, y);
      return;
    }
    if (level == 0) {
      if (patches_.leaves[surface.first_leaf + y * surface.width + x].triangle != kNone)
        contacts_.push_back({s, side, x, y});
      return;
    }
    const LevelGrid below = levelGrid(surface.width, surface.height, level - 1);
    for (std::uint32_t cy = 2 * y; cy < std::min(2 * y + 2, below.height); ++cy)
      for (std::uint32_t cx = 2 * x; cx < std::min(2 * x + 2, below.width); ++cx)
        descend(boxes, s, side, level - 1, cx, cy);
  }

  void settleUniform(std::uint32_t s, std::uint32_t side, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
    const Surface& surface = patches_.surfaces[s];
    const std::uint32_t x_end = std::min((x + 1) << level, surface.width);
    const std::uint32_t y_end = std::min((y + 1) << level, surface.height);
    bool known = false;
    for (std::uint32_t ly = y << level; ly < y_end; ++ly)
      for (std::uint32_t lx = x << level; lx < x_end; ++lx) {
        const Contact leaf{s, side, lx, ly};
        const LeafPoint& point = patches_.leaves[leafOf(leaf)];
        if (point.triangle == kNone) continue;
        if (!known && !buried(point.triangle, glm::dvec2(point.texel), side)) return;
        known = true;
        patches_.node_area[nodeOf(leaf)] = 0.0F;
        changes_.push_back({leafOf(leaf), side, {}, {}});
      }
  }

  /// Visible area of one leaf and side from `count` samples.
  void measure(const Contact& contact, std::uint32_t count) {
    const std::uint32_t leaf = leafOf(contact);
    const LeafPoint point = patches_.leaves[leaf];
    const std::size_t first = first_piece_[leaf], end = first_piece_[leaf + 1];
    const glm::dvec2 corner(contact.x, contact.y);
    parts_.assign(std::max<std::size_t>(1, end - first), Part{});
    LeafPoint visible;
    std::vector<LeafSpot> places;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::uint32_t i = 0; i < count; ++i) {
      const glm::dvec2 texel = corner + latticePoint(i, count);
      std::uint32_t triangle = point.triangle;
      std::size_t part = 0;
      if (first != end) {
        const auto found = std::find_if(
            pieces_.begin() + static_cast<std::ptrdiff_t>(first), pieces_.begin() + static_cast<std::ptrdiff_t>(end),
            [&](const LeafPiece& p) { return triangleHolds(patches_, p.triangle, texel, 0.0); });
        part = static_cast<std::size_t>(found - pieces_.begin()) - first;
        if (part == end - first) continue;  // not covered here
        triangle = found->triangle;
      }
      ++parts_[part].samples;
      if (buried(triangle, texel, contact.side)) {
        ++parts_[part].buried;
        continue;
      }
      places.push_back({glm::vec2(texel), triangle});
      const double distance = glm::distance(texel, corner + 0.5);
      if (distance >= nearest) continue;
      nearest = distance;
      visible = {glm::vec2(texel), triangle, false};
    }
    const Outcome outcome = sumParts(point, contact, first, end);
    if (outcome.buried == 0) return;
    if (count != kManySamples && outcome.buried < outcome.samples) return measure(contact, kManySamples);
    patches_.node_area[nodeOf(contact)] = static_cast<float>(outcome.visible_area);
    if (outcome.visible_area <= 0.0) {
      visible = {};
    } else if (visible.triangle == kNone) {
      visible = {point.texel, point.triangle, false};
    }
    changes_.push_back({leaf, contact.side, visible, std::move(places)});
    touched_.push_back(contact);
  }

  struct Part {
    std::uint32_t samples = 0, buried = 0;
  };
  struct Outcome {
    std::uint32_t samples = 0, buried = 0;
    double visible_area = 0.0;
  };

  /// Pieces too small to hold a sample go the way of the leaf's own point.
  Outcome sumParts(const LeafPoint& point, const Contact& contact, std::size_t first, std::size_t end) {
    Outcome outcome;
    for (std::size_t part = 0; part < parts_.size(); ++part) {
      Part& p = parts_[part];
      if (p.samples == 0) {
        p.samples = 1;
        p.buried = buried(point.triangle, glm::dvec2(point.texel), contact.side) ? 1 : 0;
      }
      const double area = first == end ? patches_.node_area[nodeOf(contact)] : pieces_[first + part].area;
      outcome.samples += p.samples;
      outcome.buried += p.buried;
      outcome.visible_area += area * (p.samples - p.buried) / p.samples;
    }
    return outcome;
  }

  /// A few samples may all miss a narrow strip: look closer beside leaves where something was buried.
  void refineBorders() {
    if (few_ != kFewSamples) return;
    std::vector<bool> done(patches_.leaves.size() * 2, false);
    const auto slot = [&](const Contact& c) { return std::size_t{2} * leafOf(c) + c.side; };
    for (const Change& change : changes_) done[std::size_t{2} * change.leaf + change.side] = true;
    const std::vector<Contact> buried = std::exchange(touched_, {});
    std::vector<bool> in_contact(patches_.leaves.size() * 2, false);
    for (const Contact& c : contacts_) in_contact[slot(c)] = true;
    for (const Contact& c : buried) {
      const Surface& surface = patches_.surfaces[c.surface];
      for (std::uint32_t y = c.y == 0 ? 0 : c.y - 1; y < std::min(c.y + 2, surface.height); ++y)
        for (std::uint32_t x = c.x == 0 ? 0 : c.x - 1; x < std::min(c.x + 2, surface.width); ++x) {
          const Contact neighbour{c.surface, c.side, x, y};
          if (done[slot(neighbour)] || !in_contact[slot(neighbour)]) continue;
          done[slot(neighbour)] = true;
          measure(neighbour, kManySamples);
        }
    }
  }

  /// Both sides share a leaf's point: the front's visible point, or the back's where the front is buried.
  void settleSides() {
    std::ranges::stable_sort(changes_, [](const Change& a, const Change& b) {
      return a.leaf != b.leaf ? a.leaf < b.leaf : a.side < b.side;
    });
    for (std::size_t i = 0; i < changes_.size(); ++i) {
      Change& change = changes_[i];
      const bool both = i + 1 < changes_.size() && changes_[i + 1].leaf == change.leaf;
      const bool two_sided = isTwoSided(change.leaf);
      LeafPoint& point = patches_.leaves[change.leaf];
      point.full = false;
      Change& open = both && change.point.triangle == kNone ? changes_[i + 1] : change;
      if (both) ++i;
      if (open.point.triangle != kNone) {
        point = open.point;
        keepSpots(patches_, point, open.places);
      } else if (both || !two_sided) {
        point = {};
      }
    }
  }

  [[nodiscard]] bool isTwoSided(std::uint32_t leaf) const {
    const auto after = std::ranges::upper_bound(patches_.surfaces, leaf, {}, &Surface::first_leaf);
    return std::prev(after)->first_node[1] != kNone;
  }

  PatchScene& patches_;
  const std::vector<LeafPiece>& pieces_;
  Solids solids_;
  std::vector<std::size_t> first_piece_;
  std::vector<Contact> contacts_, touched_;
  std::vector<Change> changes_;
  std::vector<Part> parts_;
  std::uint32_t few_ = kFewSamples;
};

/// Pairs of surfaces that lie on each other and face the same way: which of them is seen is decided by their order.
class Coincidence {
 public:
  explicit Coincidence(PatchScene& patches) : patches_(patches) {
    std::vector<Bvh::Triangle> triangles;
    for (std::size_t t = 0; t < patches.triangles.size(); ++t)
      triangles.push_back({patches.vertices[patches.indices[3 * t]].position,
                           patches.vertices[patches.indices[3 * t + 1]].position,
                           patches.vertices[patches.indices[3 * t + 2]].position});
    tree_ = Bvh(std::move(triangles));
  }

  void run() {
    std::uint64_t count = 0;
    std::pair<std::uint32_t, std::uint32_t> first{kNone, kNone};
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
      const std::uint32_t other = coveredBy(s);
      if (other == kNone) continue;
      if (count++ == 0) first = {other, s};
    }
    if (count == 0) return;
    patches_.warnings.push_back(
        fmt::format("{} surfaces lie exactly on an earlier one that faces the same way and is seen instead (the first: "
                    "surface {} of instance {} on surface {} of instance {})",
                    count, first.second, patches_.surfaces[first.second].instance, first.first,
                    patches_.surfaces[first.first].instance));
  }

 private:
  /// An earlier surface found right at some of this surface's leaf points.
  std::uint32_t coveredBy(std::uint32_t s) {
    const Surface& surface = patches_.surfaces[s];
    const std::uint32_t leaves = surface.width * surface.height;
    const std::uint32_t step = std::max(1U, leaves / 16);
    for (std::uint32_t i = step / 2; i < leaves; i += step) {
      const LeafPoint& point = patches_.leaves[surface.first_leaf + i];
      if (point.triangle == kNone) continue;
      const TriangleFrame& frame = patches_.triangles[point.triangle];
      const glm::dvec3 n(frame.normal);
      hits_.clear();
      tree_.collectHits(glm::dvec3(positionAt(frame, glm::dvec2(point.texel))) + n * 1e-6, -n, 0.0, 2e-6, hits_);
      for (const RayHit& hit : hits_) {
        const std::uint32_t other = patches_.triangle_surface[hit.triangle];
        if (other < s && glm::dot(patches_.triangles[hit.triangle].normal, frame.normal) > 0.9999F) return other;
      }
    }
    return kNone;
  }

  PatchScene& patches_;
  Bvh tree_;
  std::vector<RayHit> hits_;
};

}  // namespace

void removeBuried(PatchScene& patches, const std::vector<LeafPiece>& pieces, const std::vector<bool>& solid) {
  Coincidence(patches).run();
  Burial(patches, pieces, solid).run();
}

}  // namespace radiosity::scene
