#include "server/scene/charts/facet_cutter.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "common/task.h"
#include "server/scene/charts/flatten.h"

namespace radiosity::scene {
namespace {

/// A building's floor meets fewer walls, and is cut in fewer pieces: what has more stays whole, since the work grows
/// with their product.
constexpr std::size_t kMostWalls = 1024, kMostPieces = 4096;
/// Rounding adds up: of corners that are cut twice, and of lines through them.
constexpr double kNear = 4.0;
/// Light goes around a wall, and over it, that is not so many texels long and high.
constexpr double kLongWall = 4.0, kHighWall = 2.0;
/// Of the least size: a lower wall hides little of the light beyond.
constexpr double kLowWall = 0.5;

double cross(const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; }

/// A wall's line.
struct Line {
  glm::dvec2 from, along;
  double length;

  explicit Line(const WallSegment& wall)
      : from(wall.from), along(glm::normalize(wall.to - wall.from)), length(glm::distance(wall.from, wall.to)) {}
  /// To its left.
  [[nodiscard]] double distance(const glm::dvec2& p) const { return cross(along, p - from); }
  [[nodiscard]] double place(const glm::dvec2& p) const { return glm::dot(along, p - from); }
};

}  // namespace

FacetCutter::FacetCutter(std::vector<Triangle> triangles, std::vector<WallSegment> walls, const CutScale& scale)
    : triangles_(std::move(triangles)), all_walls_(std::move(walls)), scale_(scale) {
  const auto length = [](const WallSegment& wall) { return glm::distance(wall.from, wall.to); };
  std::erase_if(all_walls_, [&](const auto& wall) { return length(wall) <= kNear * scale_.rounding; });
  std::ranges::stable_sort(all_walls_, [&](const auto& a, const auto& b) { return length(a) > length(b); });
  if (all_walls_.size() > kMostWalls) all_walls_.resize(kMostWalls);
}

bool FacetCutter::cut() {
  if (all_walls_.empty() || triangles_.size() > kMostPieces || !cutAlong(all_walls_)) return false;
  const auto parting = findPartingEdges(edges_, points_, areas(), scale_);
  const auto needed = wallsOn(parting);
  // Others leave no trace, so that what stands on a face and moves there changes nothing.
  if (needed.empty() || (needed.size() < walls_.size() && !cutAlong(needed))) return false;
  findRegions();
  if (regions_ < 2) return false;
  std::vector<bool> border;
  for (const auto& edge : edges_)
    border.push_back(edge.piece[0] != kNone && edge.piece[1] != kNone &&
                     pieces_[edge.piece[0]].region != pieces_[edge.piece[1]].region);
  const auto useful = wallsOn(border);
  if (useful.size() == walls_.size()) return true;
  const FacetCutter with_all = *this;
  if (cutAlong(useful)) findRegions();
  if (regions_ != with_all.regions_) *this = with_all;
  return true;
}

/// False: they are not cut, or in too many pieces.
bool FacetCutter::cutAlong(const std::vector<WallSegment>& walls) {
  walls_ = walls;
  regions_ = 0;
  pieces_.clear();
  for (std::uint32_t t = 0; t < triangles_.size(); ++t)
    pieces_.push_back({{triangles_[t].begin(), triangles_[t].end()}, {}, t});
  const auto whole = pieces_.size();
  for (const auto& wall : walls_) {
    interruptionPoint();
    splitBy(wall);
    if (pieces_.size() > kMostPieces) return false;
  }
  if (pieces_.size() == whole && whole == 1) return false;
  numberPoints();
  addToEdges();
  findEdges();
  return !pieces_.empty();
}

std::vector<double> FacetCutter::areas() const {
  std::vector<double> areas;
  for (const auto& piece : pieces_) areas.push_back(areaOf(piece));
  return areas;
}

void FacetCutter::findRegions() {
  const auto regions = scene::findRegions(edges_, points_, areas(), scale_);
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    pieces_[i].region = regions.of_piece[i];
    pieces_[i].hidden = regions.hidden[i];
  }
  regions_ = *std::ranges::max_element(regions.of_piece) + 1;
}

/// Pieces that the wall stands on, by all of its line.
void FacetCutter::splitBy(const WallSegment& wall) {
  const Line line(wall);
  const double rounding = scale_.rounding;
  const glm::dvec2 low = glm::min(wall.from, wall.to) - rounding, high = glm::max(wall.from, wall.to) + rounding;
  const auto count = pieces_.size();
  for (std::size_t i = 0; i < count; ++i) {
    const auto& outline = pieces_[i].outline;
    glm::dvec2 box_low = outline[0], box_high = outline[0];
    for (const auto& p : outline) {
      box_low = glm::min(box_low, p);
      box_high = glm::max(box_high, p);
    }
    if (box_low.x > high.x || box_low.y > high.y || box_high.x < low.x || box_high.y < low.y) continue;
    std::vector<glm::dvec2> left, right;
    double first = line.length, last = 0.0, most_left = 0.0, most_right = 0.0;
    const auto onLine = [&](const glm::dvec2& p) {
      left.push_back(p);
      right.push_back(p);
      first = std::min(first, line.place(p));
      last = std::max(last, line.place(p));
    };
    for (std::size_t k = 0; k < outline.size(); ++k) {
      const auto &p = outline[k], &q = outline[(k + 1) % outline.size()];
      const double d = line.distance(p), e = line.distance(q);
      most_left = std::max(most_left, d);
      most_right = std::max(most_right, -d);
      if (std::abs(d) <= rounding) {
        onLine(p);
      } else {
        (d > 0.0 ? left : right).push_back(p);
      }
      if ((d > rounding && e < -rounding) || (d < -rounding && e > rounding)) onLine(p + (q - p) * (d / (d - e)));
    }
    if (most_left <= rounding || most_right <= rounding) continue;
    if (std::min(last, line.length) - std::max(first, 0.0) <= kNear * rounding) continue;
    const auto triangle = pieces_[i].triangle;
    pieces_[i].outline = std::move(left);
    pieces_.push_back({std::move(right), {}, triangle, 0});
  }
}

void FacetCutter::numberPoints() {
  std::vector<glm::dvec3> places;
  for (const auto& piece : pieces_)
    for (const auto& p : piece.outline) places.emplace_back(p, 0.0);
  for (const auto& wall : walls_) {  // an edge is under a wall, or it is not
    places.emplace_back(wall.from, 0.0);
    places.emplace_back(wall.to, 0.0);
  }
  const auto ids = weldPoints(places, scale_.rounding);
  points_.clear();
  std::size_t next = 0;
  for (auto& piece : pieces_) {
    piece.corners.clear();
    for (std::size_t k = 0; k < piece.outline.size(); ++k, ++next) {
      if (ids[next] == points_.size()) points_.emplace_back(places[next]);
      if (piece.corners.empty() || piece.corners.back() != ids[next]) piece.corners.push_back(ids[next]);
    }
    while (piece.corners.size() > 1 && piece.corners.back() == piece.corners.front()) piece.corners.pop_back();
  }
  for (; next < places.size(); ++next)
    if (ids[next] == points_.size()) points_.emplace_back(places[next]);
  std::erase_if(pieces_, [](const Piece& piece) { return piece.corners.size() < 3; });
}

/// What lies in the middle of an edge is a corner there, too, so that pieces share whole edges.
void FacetCutter::addToEdges() {
  std::vector<std::uint32_t> by_x(points_.size());
  for (std::uint32_t i = 0; i < by_x.size(); ++i) by_x[i] = i;
  std::ranges::stable_sort(by_x, {}, [&](std::uint32_t i) { return points_[i].x; });
  const double margin = 2.0 * scale_.rounding;
  for (auto& piece : pieces_) {
    interruptionPoint();
    std::vector<std::uint32_t> corners;
    for (std::size_t k = 0; k < piece.corners.size(); ++k) {
      const auto from = piece.corners[k], to = piece.corners[(k + 1) % piece.corners.size()];
      corners.push_back(from);
      const glm::dvec2 &a = points_[from], &b = points_[to];
      const double length = glm::distance(a, b);
      if (!(length > 0.0)) continue;
      const glm::dvec2 along = (b - a) / length;
      std::vector<std::pair<double, std::uint32_t>> within;
      const auto px = [&](std::uint32_t i) { return points_[i].x; };
      const auto end = std::ranges::upper_bound(by_x, std::max(a.x, b.x) + margin, {}, px);
      for (auto p = std::ranges::lower_bound(by_x, std::min(a.x, b.x) - margin, {}, px); p < end; ++p) {
        const double at = glm::dot(along, points_[*p] - a);
        if (*p == from || *p == to || at <= 0.0 || at >= length) continue;
        if (std::abs(cross(along, points_[*p] - a)) <= margin) within.emplace_back(at, *p);
      }
      std::ranges::sort(within);
      for (const auto& [at, p] : within) corners.push_back(p);
    }
    piece.corners = std::move(corners);
  }
}

void FacetCutter::findEdges() {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::array<std::uint32_t, 2>> found;
  for (std::uint32_t i = 0; i < pieces_.size(); ++i) {
    const auto& corners = pieces_[i].corners;
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const auto from = corners[k], to = corners[(k + 1) % corners.size()];
      auto& sides = found.try_emplace(std::minmax(from, to), std::array<std::uint32_t, 2>{kNone, kNone}).first->second;
      auto& side = sides[from < to ? 0 : 1];
      if (side == kNone) side = i;
    }
  }
  edges_.clear();
  for (const auto& [ends, sides] : found) {
    edges_.push_back({ends.first, ends.second, sides, glm::distance(points_[ends.first], points_[ends.second])});
    look(edges_.back());
  }
}

void FacetCutter::look(PieceEdge& edge) const {
  const glm::dvec2 &a = points_[edge.from], &b = points_[edge.to], middle = 0.5 * (a + b);
  const glm::dvec2 left(a.y - b.y, b.x - a.x);
  const double margin = kNear * scale_.rounding;
  for (const auto& wall : all_walls_) {
    if (wall.height < kLowWall * scale_.least) continue;
    const Line line(wall);
    if (std::abs(line.distance(a)) > margin || std::abs(line.distance(b)) > margin) continue;
    const double at = line.place(middle);
    if (at < -margin || at > line.length + margin) continue;
    edge.blocked = true;
    edge.parts = edge.parts || (line.length >= kLongWall * scale_.texel && wall.height >= kHighWall * scale_.texel);
    const bool front_left = glm::dot(wall.front, left) > 0.0;
    edge.sees_front[0] = edge.sees_front[0] || front_left || wall.shows_back;
    edge.sees_front[1] = edge.sees_front[1] || !front_left || wall.shows_back;
  }
}

double FacetCutter::areaOf(const Piece& piece) const {
  double twice = 0.0;
  for (std::size_t k = 2; k < piece.corners.size(); ++k)
    twice += cross(points_[piece.corners[k - 1]] - points_[piece.corners[0]],
                   points_[piece.corners[k]] - points_[piece.corners[0]]);
  return 0.5 * twice;
}

/// Of those it is cut along, such as have some of these edges on their lines.
std::vector<WallSegment> FacetCutter::wallsOn(const std::vector<bool>& edges) const {
  std::vector<WallSegment> found;
  const double margin = kNear * scale_.rounding;
  for (const auto& wall : walls_) {
    const Line line(wall);
    const auto isOn = [&](std::uint32_t p) { return std::abs(line.distance(points_[p])) <= margin; };
    bool has = false;
    for (std::size_t i = 0; i < edges_.size() && !has; ++i)
      has = edges[i] && isOn(edges_[i].from) && isOn(edges_[i].to);
    if (has) found.push_back(wall);
  }
  return found;
}

void FacetCutter::insert(const std::vector<glm::dvec2>& points) {
  const auto known = points_.size();
  std::vector<glm::dvec3> places;
  for (const auto& p : points_) places.emplace_back(p, 0.0);
  for (const auto& p : points) places.emplace_back(p, 0.0);
  // Those that are known stay as they are: nearer than rounding, two of them would have been one.
  const auto ids = weldPoints(places, scale_.rounding);
  std::uint32_t most = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i >= known && ids[i] > most) points_.emplace_back(places[i]);
    most = std::max(most, ids[i]);
  }
  if (points_.size() == known) return;
  addToEdges();
  findEdges();
}

bool FacetCutter::isWalled(std::uint32_t from, std::uint32_t to) const {
  const auto ends = std::minmax(from, to);
  const auto key = [](const PieceEdge& edge) { return std::pair(edge.from, edge.to); };
  const auto found = std::ranges::lower_bound(edges_, std::pair<std::uint32_t, std::uint32_t>(ends), {}, key);
  if (found == edges_.end() || key(*found) != std::pair<std::uint32_t, std::uint32_t>(ends)) return false;
  const auto [a, b] = found->piece;
  if (a == kNone || b == kNone || pieces_[a].region == pieces_[b].region) return false;
  return found->blocked || pieces_[a].hidden || pieces_[b].hidden;
}

}  // namespace radiosity::scene
