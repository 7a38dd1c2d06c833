#include "server/scene/burial/coverage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "common/check.h"
#include "common/give_back.h"
#include "common/parallel.h"

namespace radiosity::scene {
namespace {

/// Leaves that a thread is worth.
constexpr std::size_t kLeavesAThread = 4096;

/// Convex polygon of at most a triangle's corners plus one for each of four clips.
struct Polygon {
  std::array<glm::dvec2, 8> points;
  int count = 0;
  void add(const glm::dvec2& p) {
    RAD_CHECK_LT(count, 8);
    points[static_cast<std::size_t>(count++)] = p;
  }
  [[nodiscard]] const glm::dvec2& operator[](int i) const { return points[static_cast<std::size_t>(i)]; }
};

/// Keeps the side where sign * (p[axis] - bound) >= 0.
Polygon clip(const Polygon& in, int axis, double bound, double sign) {
  Polygon out;
  for (int i = 0; i < in.count; ++i) {
    const glm::dvec2& a = in[i];
    const glm::dvec2& b = in[(i + 1) % in.count];
    const double da = sign * (a[axis] - bound), db = sign * (b[axis] - bound);
    if (da >= 0.0) out.add(a);
    if ((da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0)) {
      glm::dvec2 p = a + (b - a) * (da / (da - db));
      p[axis] = bound;
      out.add(p);
    }
  }
  return out;
}

double areaOf(const Polygon& p) {
  double twice = 0.0;
  for (int i = 2; i < p.count; ++i) {
    const glm::dvec2 a = p[i - 1] - p[0], b = p[i] - p[0];
    twice += a.x * b.y - a.y * b.x;
  }
  return 0.5 * std::abs(twice);
}

glm::dvec2 centroidOf(const Polygon& p) {
  glm::dvec2 sum(0.0);
  double twice = 0.0;
  for (int i = 2; i < p.count; ++i) {
    const glm::dvec2 a = p[i - 1] - p[0], b = p[i] - p[0];
    const double cross = a.x * b.y - a.y * b.x;
    sum += (p[0] + p[i - 1] + p[i]) * (cross / 3.0);
    twice += cross;
  }
  return twice != 0.0 ? sum / twice : p[0];
}

bool holds(const std::array<glm::dvec2, 3>& t, const glm::dvec2& p, double slack) {
  const auto cross = [](const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; };
  const double orientation = cross(t[1] - t[0], t[2] - t[0]) < 0.0 ? -1.0 : 1.0;
  for (std::size_t e = 0; e < 3; ++e) {
    const glm::dvec2 edge = t[(e + 1) % 3] - t[e];
    const double length = glm::length(edge);
    if (orientation * cross(edge, p - t[e]) < -slack * length) return false;
  }
  return true;
}

std::array<glm::dvec2, 3> texelsOf(const PatchScene& patches, std::uint32_t triangle) {
  std::array<glm::dvec2, 3> corners;
  for (std::size_t c = 0; c < 3; ++c)
    corners[c] = glm::dvec2(patches.vertices[patches.indices[std::size_t{3} * triangle + c]].texel);
  return corners;
}

double worldArea(const PatchScene& patches, std::uint32_t triangle) {
  std::array<glm::dvec3, 3> p;
  for (std::size_t c = 0; c < 3; ++c)
    p[c] = glm::dvec3(patches.vertices[patches.indices[std::size_t{3} * triangle + c]].position);
  return 0.5 * glm::length(glm::cross(p[1] - p[0], p[2] - p[0]));
}

/// What has been found out about one leaf of the current band.
struct Tally {
  double covered = 0.0;  ///< fraction of the texel
  double area = 0.0;     ///< unit box squared
  double best = 0.0;     ///< rank of the point chosen so far
  bool by_one = false;   ///< a single triangle covers it
  std::uint32_t pieces = 0;
};

class SurfaceCoverage {
 public:
  SurfaceCoverage(PatchScene& patches, const Surface& surface, std::vector<LeafPiece>& pieces)
      : patches_(patches), surface_(surface), pieces_(pieces) {}

  void run() {
    constexpr std::uint32_t kBandTexels = 1U << 21;
    const std::uint32_t rows = std::max(1U, kBandTexels / surface_.width);
    for (std::uint32_t top = 0; top < surface_.height; top += rows) runBand(top, std::min(rows, surface_.height - top));
  }

 private:
  void runBand(std::uint32_t top, std::uint32_t rows) {
    top_ = top;
    bottom_ = top + rows;
    tallies_.assign(std::size_t{rows} * surface_.width, Tally{});
    const std::size_t first_piece = pieces_.size();
    for (std::uint32_t i = 0; i < surface_.triangle_count; ++i) addTriangle(surface_.first_triangle + i);
    finish(first_piece);
  }

  void addTriangle(std::uint32_t triangle) {
    const std::array<glm::dvec2, 3> corners = texelsOf(patches_, triangle);
    const double low = std::min({corners[0].y, corners[1].y, corners[2].y});
    const double high = std::max({corners[0].y, corners[1].y, corners[2].y});
    if (high <= top_ || low >= bottom_) return;
    Polygon whole;
    for (const auto& c : corners) whole.add(c);
    const double texel_area = areaOf(whole);
    if (!(texel_area > 0.0)) return;
    triangle_ = triangle;
    corners_ = corners;
    factor_ = worldArea(patches_, triangle) / texel_area;
    const auto first = std::max(static_cast<std::int64_t>(top_), static_cast<std::int64_t>(std::floor(low)));
    const auto end = std::min(static_cast<std::int64_t>(bottom_), static_cast<std::int64_t>(std::ceil(high)));
    for (std::int64_t y = first; y < end; ++y) {
      interruptionPoint();
      const auto row = static_cast<double>(y);
      addRow(y, clip(clip(whole, 1, row, 1.0), 1, row + 1.0, -1.0));
    }
  }

  void addRow(std::int64_t y, const Polygon& band) {
    if (band.count < 3) return;
    double low = band[0].x, high = band[0].x;
    for (int i = 1; i < band.count; ++i) {
      low = std::min(low, band[i].x);
      high = std::max(high, band[i].x);
    }
    const auto last_texel = static_cast<std::int64_t>(surface_.width) - 1;
    const auto first = std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(low)), 0, last_texel);
    const auto last = std::clamp<std::int64_t>(static_cast<std::int64_t>(std::ceil(high)) - 1, 0, last_texel);
    const auto [full_first, full_end] = fullRun(static_cast<double>(y), band, first, last);
    for (std::int64_t x = first; x <= last; ++x) {
      if (x >= full_first && x < full_end) {
        addFull(x, y);
      } else {
        addPartial(x, y, clip(clip(band, 0, static_cast<double>(x), 1.0), 0, static_cast<double>(x + 1), -1.0));
      }
    }
  }

  /// Texels of the row that lie wholly inside: a convex shape holds a square if it holds its top and bottom sides.
  static std::pair<std::int64_t, std::int64_t> fullRun(double row, const Polygon& band, std::int64_t first,
                                                       std::int64_t last) {
    double left = -std::numeric_limits<double>::infinity(), right = -left;
    for (const double y : {row, row + 1.0}) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (int i = 0; i < band.count; ++i) {
        if (band[i].y != y) continue;
        low = std::min(low, band[i].x);
        high = std::max(high, band[i].x);
      }
      left = std::max(left, low);
      right = std::min(right, high);
    }
    if (!(left < right) || !std::isfinite(left) || !std::isfinite(right)) return {0, 0};
    return {std::max(first, static_cast<std::int64_t>(std::ceil(left))),
            std::min(last + 1, static_cast<std::int64_t>(std::floor(right)))};
  }

  Tally& tallyAt(std::int64_t x, std::int64_t y) {
    return tallies_[static_cast<std::size_t>(y - top_) * surface_.width + static_cast<std::size_t>(x)];
  }
  [[nodiscard]] std::uint32_t leafAt(std::int64_t x, std::int64_t y) const {
    return surface_.first_leaf + static_cast<std::uint32_t>(y) * surface_.width + static_cast<std::uint32_t>(x);
  }

  void addFull(std::int64_t x, std::int64_t y) {
    Tally& tally = tallyAt(x, y);
    tally.covered += 1.0;
    tally.area += factor_;
    tally.by_one = true;
    tally.best = 4.0;
    patches_.leaves[leafAt(x, y)] = {glm::vec2(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F), triangle_,
                                     true};
  }

  void addPartial(std::int64_t x, std::int64_t y, const Polygon& part) {
    if (part.count < 3) return;
    const double area = areaOf(part);
    if (!(area > 1e-13)) return;
    Tally& tally = tallyAt(x, y);
    tally.covered += area;
    tally.area += area * factor_;
    ++tally.pieces;
    const std::uint32_t leaf = leafAt(x, y);
    pieces_.push_back({leaf, triangle_, static_cast<float>(area * factor_)});
    const glm::dvec2 centre(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
    // The centre where it is covered, and not just grazed by a sliver; otherwise the middle of the largest piece.
    const bool central = holds(corners_, centre, 0.0);
    const double rank = area + (central ? 2.0 : 0.0);
    if (rank <= tally.best) return;
    tally.best = rank;
    patches_.leaves[leaf] = {glm::vec2(central ? centre : centroidOf(part)), triangle_, false};
  }

  /// Writes the band's areas; pieces of leaves that turned out whole are forgotten.
  void finish(std::size_t first_piece) {
    const auto side = surface_.first_node[0];
    const auto back = surface_.first_node[1];
    for (std::size_t i = 0; i < tallies_.size(); ++i) {
      Tally& tally = tallies_[i];
      if (tally.best == 0.0) continue;
      const std::size_t in_surface = std::size_t{top_} * surface_.width + i;
      LeafPoint& point = patches_.leaves[surface_.first_leaf + in_surface];
      point.full = tally.by_one || (surface_.planar && tally.covered > 1.0 - 1e-6);
      tally.by_one = point.full;
      const auto area = static_cast<float>(tally.area);
      if (side != kNone) patches_.node_area[side + in_surface] = area;
      if (back != kNone) patches_.node_area[back + in_surface] = area;
    }
    const std::size_t offset = std::size_t{surface_.first_leaf} + std::size_t{top_} * surface_.width;
    const auto whole = [&](const LeafPiece& piece) { return tallies_[piece.leaf - offset].by_one; };
    pieces_.erase(std::remove_if(pieces_.begin() + static_cast<std::ptrdiff_t>(first_piece), pieces_.end(), whole),
                  pieces_.end());
    std::sort(pieces_.begin() + static_cast<std::ptrdiff_t>(first_piece), pieces_.end(),
              [](const LeafPiece& a, const LeafPiece& b) {
                return a.leaf != b.leaf ? a.leaf < b.leaf : a.triangle < b.triangle;
              });
  }

  PatchScene& patches_;
  const Surface& surface_;
  std::vector<LeafPiece>& pieces_;
  std::uint32_t top_ = 0, bottom_ = 0;
  std::vector<Tally> tallies_;
  std::uint32_t triangle_ = 0;
  std::array<glm::dvec2, 3> corners_{};
  double factor_ = 0.0;
};

}  // namespace

std::vector<LeafPiece> measureCoverage(PatchScene& patches) {
  const auto& surfaces = patches.surfaces;
  std::vector<std::vector<LeafPiece>> of_surface(surfaces.size());
  const auto measure = [&](std::size_t s) { SurfaceCoverage(patches, surfaces[s], of_surface[s]).run(); };
  inTurns(surfaces.size(), measure, patches.leaves.size() / kLeavesAThread);
  if (surfaces.size() == 1) return std::move(of_surface.front());  // it may be large
  std::vector<LeafPiece> pieces;
  for (auto& some : of_surface) {
    pieces.insert(pieces.end(), some.begin(), some.end());
    giveBack(some);
  }
  return pieces;
}

void sumAncestors(PatchScene& patches) {
  for (const Surface& surface : patches.surfaces)
    for (const std::uint32_t first : surface.first_node) {
      if (first == kNone) continue;
      LevelGrid below = levelGrid(surface.width, surface.height, 0);
      for (std::uint32_t level = 1; level < surface.level_count; ++level) {
        const LevelGrid grid = levelGrid(surface.width, surface.height, level);
        for (std::uint32_t y = 0; y < grid.height; ++y)
          for (std::uint32_t x = 0; x < grid.width; ++x) {
            double sum = 0.0;
            for (std::uint32_t cy = 2 * y; cy < std::min(2 * y + 2, below.height); ++cy)
              for (std::uint32_t cx = 2 * x; cx < std::min(2 * x + 2, below.width); ++cx)
                sum += patches.node_area[first + below.offset + cy * below.width + cx];
            patches.node_area[first + grid.offset + y * grid.width + x] = static_cast<float>(sum);
          }
        below = grid;
      }
    }
}

bool triangleHolds(const PatchScene& patches, std::uint32_t triangle, const glm::dvec2& texel, double slack) {
  return holds(texelsOf(patches, triangle), texel, slack);
}

}  // namespace radiosity::scene
