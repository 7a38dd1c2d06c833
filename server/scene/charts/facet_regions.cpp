#include "server/scene/charts/facet_regions.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

#include "common/task.h"
#include "common/union_find.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {
namespace {

/// Each region is a chart, with texels of its own around it; what is hidden has but one.
constexpr std::uint32_t kMostRegions = 256, kMostHidden = 1024;
/// Pairs of pieces to be kept apart: each is asked of for each edge.
constexpr std::size_t kMostApart = 2'000;
/// Pieces that are narrower, in texels, hold no texel that bilinear lookups around it would leave alone.
constexpr double kNarrowPiece = 1.5;

/// Pieces joined to regions, step by step.
class RegionFinder {
 public:
  RegionFinder(std::span<const PieceEdge> edges, std::span<const glm::dvec2> points, const std::vector<double>& areas,
               const CutScale& scale)
      : edges_(edges), points_(points), areas_(areas), scale_(scale), groups_(areas.size()) {
    findOpenParts();
    for (std::uint32_t i = 0; i < edges.size(); ++i)
      if (edges[i].piece[0] != kNone && edges[i].piece[1] != kNone) by_length_.push_back(i);
    std::ranges::stable_sort(by_length_, [&](auto a, auto b) { return edges[a].length > edges[b].length; });
  }

  [[nodiscard]] std::vector<bool> partingEdges() const {
    const double least = scale_.least * scale_.least;
    const auto isSeen = [&](std::uint32_t piece) { return !isHidden(piece) && partOf(piece).area >= least; };
    std::vector<std::uint32_t> beside(areas_.size(), kNone);  // by hidden part: a part that is seen
    std::vector<bool> lies_between(areas_.size(), false);
    const auto eachSide = [&](const auto& visit) {
      for (const auto i : by_length_)
        for (std::size_t side = 0; side < 2 && edges_[i].blocked; ++side)
          visit(i, edges_[i].piece[side], edges_[i].piece[1 - side]);
    };
    eachSide([&](std::uint32_t, std::uint32_t under, std::uint32_t other) {
      if (!isHidden(under) || !isSeen(other)) return;
      auto& first = beside[part_of_[under]];
      if (first == kNone) first = part_of_[other];
      if (first != part_of_[other]) lies_between[part_of_[under]] = true;
    });
    std::vector<bool> parting(edges_.size(), false);
    eachSide([&](std::uint32_t i, std::uint32_t one, std::uint32_t other) {
      const bool both_seen = isSeen(one) && isSeen(other);
      if (lies_between[part_of_[one]] || (both_seen && (part_of_[one] != part_of_[other] || edges_[i].parts)) ||
          (edges_[i].parts && isNarrow(one)))
        parting[i] = true;
    });
    return parting;
  }

  /// Of more regions than there may be, all are one.
  FacetRegions run() {
    keepWallsSidesApart();
    joinInTheOpen();
    constexpr int kDoublings = 8;  // of the least area
    double least = scale_.least * scale_.least;
    for (int i = 0; i < kDoublings; ++i, least *= 2.0) {
      joinSmall(least);
      if (auto found = number()) return *found;
    }
    return {std::vector<std::uint32_t>(areas_.size(), 0), std::vector<bool>(areas_.size(), false)};
  }

 private:
  /// What hangs together without a wall between.
  struct Part {
    double area = 0.0, border = 0.0;
    double sees_backs = 0.0;  ///< so much of the border
    /// Most of what is around it are backs: it lies under a solid. Where another one touches that, its front shows.
    [[nodiscard]] bool hidden() const { return 2.0 * sees_backs > border; }
    [[nodiscard]] double width() const { return border > 0.0 ? 2.0 * area / border : 0.0; }
  };

  void findOpenParts() {
    UnionFind open(areas_.size());
    for (const auto& edge : edges_)
      if (!edge.blocked && edge.piece[0] != kNone && edge.piece[1] != kNone) open.join(edge.piece[0], edge.piece[1]);
    parts_.resize(areas_.size());
    part_of_.resize(areas_.size());
    for (std::uint32_t i = 0; i < areas_.size(); ++i) {
      part_of_[i] = open.find(i);
      parts_[part_of_[i]].area += areas_[i];
    }
    for (const auto& edge : edges_) {
      for (std::size_t side = 0; side < 2; ++side) {
        if (edge.piece[side] == kNone || (!edge.blocked && edge.piece[1 - side] != kNone)) continue;
        auto& part = parts_[part_of_[edge.piece[side]]];
        part.border += edge.length;
        if (edge.blocked && !edge.sees_front[side]) part.sees_backs += edge.length;
      }
    }
  }

  [[nodiscard]] const Part& partOf(std::uint32_t piece) const { return parts_[part_of_[piece]]; }
  [[nodiscard]] bool isHidden(std::uint32_t piece) const { return partOf(piece).hidden(); }
  [[nodiscard]] bool isNarrow(std::uint32_t piece) const {
    return isHidden(piece) && partOf(piece).width() < kNarrowPiece * scale_.texel;
  }
  /// Of an edge, away from the piece on one of its sides.
  [[nodiscard]] glm::dvec2 outward(const PieceEdge& edge, std::size_t side) const {
    const glm::dvec2 along = (points_[edge.to] - points_[edge.from]) / edge.length;
    return (side == 0 ? 1.0 : -1.0) * glm::dvec2(along.y, -along.x);
  }

  /// Of a long wall, and of one with something hidden beneath it that a lookup reaches across.
  void keepWallsSidesApart() {
    struct Rim {
      std::uint32_t beside;
      glm::dvec2 to;
    };
    std::vector<std::vector<Rim>> rims(areas_.size());  // by piece of what is hidden
    for (const auto i : by_length_) {
      const PieceEdge& edge = edges_[i];
      if (!edge.parts) continue;
      if (!isHidden(edge.piece[0]) && !isHidden(edge.piece[1]) && apart_.size() < kMostApart)
        apart_.emplace_back(edge.piece[0], edge.piece[1]);
      for (std::size_t side = 0; side < 2; ++side)
        if (isNarrow(edge.piece[side]) && !isHidden(edge.piece[1 - side]))
          rims[edge.piece[side]].push_back({edge.piece[1 - side], outward(edge, side)});
    }
    constexpr double kOpposite = -0.5;
    for (const auto& around : rims)
      for (const auto& one : around)
        for (const auto& other : around)
          if (one.beside < other.beside && glm::dot(one.to, other.to) < kOpposite && apart_.size() < kMostApart)
            apart_.emplace_back(one.beside, other.beside);
  }

  /// What is hidden hangs together, and so does what is not, unless a wall is to part it.
  void joinInTheOpen() {
    for (std::uint32_t i = 0; i < areas_.size(); ++i)
      if (isHidden(i)) groups_.join(i, part_of_[i]);
    for (const auto i : by_length_) {
      const PieceEdge& edge = edges_[i];
      if (!edge.blocked && !isHidden(edge.piece[0]) && !isHidden(edge.piece[1]))
        joinIfAllowed(edge.piece[0], edge.piece[1]);
    }
  }

  void joinIfAllowed(std::uint32_t a, std::uint32_t b) {
    interruptionPoint();
    const auto one = groups_.find(a), other = groups_.find(b);
    if (one == other) return;
    for (const auto& [c, d] : apart_) {
      const auto p = groups_.find(c), q = groups_.find(d);
      if ((p == one && q == other) || (p == other && q == one)) return;
    }
    groups_.join(one, other);
  }

  /// With what it shares its longest edge with.
  void joinSmall(double least) {
    std::vector<double> sums(areas_.size(), 0.0);
    for (std::uint32_t i = 0; i < areas_.size(); ++i) sums[groups_.find(i)] += areas_[i];
    for (const auto i : by_length_) {
      interruptionPoint();
      const auto a = groups_.find(edges_[i].piece[0]), b = groups_.find(edges_[i].piece[1]);
      if (a == b || isHidden(a) || isHidden(b) || std::min(sums[a], sums[b]) >= least) continue;
      groups_.join(a, b);
      sums[groups_.find(a)] = sums[a] + sums[b];
    }
  }

  /// What is hidden beside one region alone is of it. None: they are too many.
  [[nodiscard]] std::optional<FacetRegions> number() {
    std::vector<std::uint32_t> beside(areas_.size(), kNone);  // by hidden group
    std::vector<bool> parts(areas_.size(), false);
    for (const auto i : by_length_)
      for (std::size_t side = 0; side < 2; ++side) {
        const auto under = groups_.find(edges_[i].piece[side]), other = groups_.find(edges_[i].piece[1 - side]);
        if (!isHidden(under) || isHidden(other)) continue;
        if (beside[under] == kNone) beside[under] = other;
        parts[under] = parts[under] || beside[under] != other;
      }
    std::vector<std::uint32_t> number(areas_.size(), kNone);
    FacetRegions found;
    std::uint32_t count = 0, hidden = 0;
    for (std::uint32_t i = 0; i < areas_.size(); ++i) {
      const auto group = groups_.find(i);
      const bool of_other = isHidden(group) && !parts[group] && beside[group] != kNone;
      auto& region = number[of_other ? beside[group] : group];
      if (region == kNone) {
        region = count++;
        hidden += isHidden(group) ? 1 : 0;
      }
      found.of_piece.push_back(region);
      found.hidden.push_back(isNarrow(group) && !of_other);
    }
    return count - hidden <= kMostRegions && hidden <= kMostHidden ? std::optional(std::move(found)) : std::nullopt;
  }

  std::span<const PieceEdge> edges_;
  std::span<const glm::dvec2> points_;
  const std::vector<double>& areas_;
  CutScale scale_;
  UnionFind groups_;
  std::vector<std::uint32_t> part_of_;                          ///< by piece: the first of its part
  std::vector<Part> parts_;                                     ///< by first piece
  std::vector<std::uint32_t> by_length_;                        ///< edges between two pieces, longest first
  std::vector<std::pair<std::uint32_t, std::uint32_t>> apart_;  ///< to be kept
};

}  // namespace

std::vector<bool> findPartingEdges(std::span<const PieceEdge> edges, std::span<const glm::dvec2> points,
                                   const std::vector<double>& areas, const CutScale& scale) {
  return RegionFinder(edges, points, areas, scale).partingEdges();
}

FacetRegions findRegions(std::span<const PieceEdge> edges, std::span<const glm::dvec2> points,
                         const std::vector<double>& areas, const CutScale& scale) {
  return RegionFinder(edges, points, areas, scale).run();
}

}  // namespace radiosity::scene
