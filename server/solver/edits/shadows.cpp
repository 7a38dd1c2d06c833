#include "server/solver/edits/shadows.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "common/clones.h"

namespace radiosity::solver {
namespace {

/// What lies this little (unit box) before a plane may be rounding: it is seen from there.
constexpr float kInFront = -5e-7F;
/// A leaf of a curved surface may reach so much farther than the frame of one of its triangles tells.
constexpr float kCurved = 2.8F;
/// Squares of so many leaves along a side are looked at as one first.
constexpr std::uint32_t kTileSide = 4;
/// Balls ask for no more than the pixels so far around theirs.
constexpr float kMostReach = 3.0F;
/// Half a pixel's diagonal, in widths of a pixel, and room for rounding.
constexpr float kHalfDiagonal = 0.7072F;

constexpr float kMissed = -1.0F;
/// Boxes are larger by this (unit box) than they are, where numbers are rounded that are of its size.
constexpr float kRounding = 1e-6F;
/// Charts of a file count as flat though they leave their plane by so much (unit box).
constexpr float kOfChart = 2e-5F;
/// Rays start a little before a place (unit box).
constexpr float kOfPlace = 1e-5F;
/// Squares of distances are known to this factor, and well below it.
constexpr float kApart = 1.001F;
/// Slopes this small do not leave where they are.
constexpr float kLevel = 1e-20F;

scene::ChangedBox nothing() { return {glm::vec3(1e30F), glm::vec3(-1e30F)}; }

void include(scene::ChangedBox& box, const glm::vec3& centre, float radius) {
  box.low = glm::min(box.low, centre - radius);
  box.high = glm::max(box.high, centre + radius);
}

inline float smaller(float a, float b) { return a < b ? a : b; }
inline float larger(float a, float b) { return a > b ? a : b; }

/// The part of [0, 1] where slope t >= least.
struct Clip {
  float first, last;
};
inline Clip clip(float slope, float least) {
  const bool rises = slope > -kLevel;
  const float t = least / (rises ? larger(slope, kLevel) : slope);
  return {rises ? larger(t, 0.0F) : 0.0F, rises ? 1.0F : smaller(t, 1.0F)};
}

/// All ways between places of two balls (w: their radius).
class Ways {
 public:
  Ways(const glm::vec4& from, const glm::vec4& to)
      : from_(from), way_(glm::vec3(to) - from_), radius_(from.w + kRounding), widens_(to.w - from.w) {}
  Ways(const glm::vec3& from, const glm::vec3& to, float around)
      : Ways(glm::vec4(from, around), glm::vec4(to, around)) {}

  /// False: at each part of the way some coordinate is outside (Kay and Kajiya 1986), however much room the balls leave
  /// there.
  [[nodiscard]] bool mayMeet(const scene::ChangedBox& box) const {
    if (isApart(box)) return false;
    float first = 0.0F, last = 1.0F;
    for (int axis = 0; axis < 3; ++axis) {
      const auto low = clip(way_[axis] + widens_, box.low[axis] - radius_ - from_[axis]);
      const auto high = clip(widens_ - way_[axis], from_[axis] - box.high[axis] - radius_);
      first = larger(first, larger(low.first, high.first));
      last = smaller(last, smaller(low.last, high.last));
    }
    return first <= last;
  }

 private:
  /// Without divisions: an axis, or the product of one and the way, separates them (Gottschalk, Lin and Manocha 1996)
  /// though all of the way is as wide as the larger ball.
  [[nodiscard]] bool isApart(const scene::ChangedBox& box) const {
    const glm::vec3 half = 0.5F * way_, along = glm::abs(half);
    const glm::vec3 wide = 0.5F * (box.high - box.low) + radius_ + larger(widens_, 0.0F);
    const glm::vec3 to = from_ + half - 0.5F * (box.low + box.high), apart = glm::abs(to);
    if (apart.x > wide.x + along.x || apart.y > wide.y + along.y || apart.z > wide.z + along.z) return true;
    const glm::vec3 between = glm::abs(glm::cross(to, half));
    return between.x > wide.y * along.z + wide.z * along.y || between.y > wide.x * along.z + wide.z * along.x ||
           between.z > wide.x * along.y + wide.y * along.x;
  }

  glm::vec3 from_, way_;
  float radius_, widens_;
};

/// Ways from a ball to others, of which these pass another ball (from there, w: its radius), on a line that goes on
/// without end both ways. Between places of two balls a way is nowhere farther from that between their middles than the
/// larger of them is wide. Of balls below zero nothing is known. Both clones give the same.
RADIOSITY_CLONES void screenBalls(const glm::vec4& from, const glm::vec4& past, std::size_t count,
                                  const std::int32_t* to, const float* balls, std::int32_t* may) {
  const float fx = from.x, fy = from.y, fz = from.z, fr = from.w, px = past.x, py = past.y, pz = past.z, pr = past.w;
  for (std::size_t i = 0; i < count; ++i) {
    const std::int32_t b = 4 * to[i];
    const float x = balls[b] - fx, y = balls[b + 1] - fy, z = balls[b + 2] - fz, r = balls[b + 3];
    const float cx = py * z - pz * y, cy = pz * x - px * z, cz = px * y - py * x;
    const float reach = pr + larger(fr, r), apart = cx * cx + cy * cy + cz * cz;
    const bool passes = !(apart > kApart * reach * reach * (x * x + y * y + z * z));
    may[i] = (passes | (smaller(fr, r) < 0.0F)) ? 1 : 0;
  }
}

scene::ChangedBox around(std::span<const scene::ChangedBox> boxes) {
  auto all = nothing();
  for (const auto& box : boxes) {
    all.low = glm::min(all.low, box.low);
    all.high = glm::max(all.high, box.high);
  }
  return all;
}

struct Ball {
  glm::vec3 middle;
  float radius;
};
Ball ballAround(std::span<const glm::vec3> points) {
  Ball ball{glm::vec3(0.0F), 0.0F};
  for (const auto& point : points) ball.middle += point / static_cast<float>(points.size());
  for (const auto& point : points) ball.radius = std::max(ball.radius, glm::distance(ball.middle, point));
  return ball;
}

/// The corner that lies farthest that way.
glm::vec3 farthest(const scene::ChangedBox& box, const glm::vec3& way) {
  return {way.x > 0.0F ? box.high.x : box.low.x, way.y > 0.0F ? box.high.y : box.low.y,
          way.z > 0.0F ? box.high.z : box.low.z};
}

}  // namespace

void Shadows::Balls::clear() {
  for (auto* values : {&x, &y, &z, &radius, &reach}) values->clear();
}

void Shadows::Balls::add(const glm::vec3& centre, float r, float pixels) {
  x.push_back(centre.x);
  y.push_back(centre.y);
  z.push_back(centre.z);
  radius.push_back(r);
  reach.push_back(pixels);
}

/// Leaves in gaps, and those of surfaces with two sides, ask the pixels around their own as well.
float Shadows::reachOf(const scene::Surface& surface, const scene::LeafPoint& leaf) const {
  const bool in_gap = leaf.full && leaf.hasSpots();
  const bool two_sided = surface.first_node[0] != scene::kNone && surface.first_node[1] != scene::kNone;
  return in_gap || two_sided ? kMostReach : 1.0F;
}

Shadows::Shadows(const scene::PatchScene& patches, const std::vector<Side>& sides, GeometryChange change)
    : patches_(patches), change_(std::move(change)), all_(change_.boxes) {
  starts_.resize(change_.altered.size());
  for (const auto& side : sides) {
    if (side.leaf_count > 0) starts_[side.first_value] = true;
    addTiles(side);
  }
  // The first ways often meet all of a tile then.
  std::ranges::sort(change_.boxes, std::ranges::greater(), [](const scene::ChangedBox& box) {
    const auto size = box.high - box.low;
    return size.x * size.y + size.y * size.z + size.z * size.x;
  });
  around_ = around(change_.boxes);
  around_came_ = around(change_.came);
  ball_of_came_ = glm::vec4(0.5F * (around_came_.low + around_came_.high),
                            0.5F * glm::distance(around_came_.low, around_came_.high) + kRounding);
  ball_.resize(value_.size());
  for (std::size_t i = 0; i < value_.size(); ++i) ball_[value_[i]] = glm::vec4(leaves_.centre(i), leaves_.radius[i]);
  const auto altered = aroundAltered(sides);
  if (altered.low.x <= altered.high.x) all_.push_back(altered);
}

scene::ChangedBox Shadows::aroundAltered(const std::vector<Side>& sides) const {
  auto box = nothing();
  for (const auto& side : sides) {
    const auto& surface = patches_.surfaces[side.surface];
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto value = side.first_value + leaf;
      const auto triangle = patches_.leaves[surface.first_leaf + leaf].triangle;
      if (!change_.altered[value] || triangle == scene::kNone) continue;
      const auto& frame = patches_.triangles[triangle];
      const glm::vec3 centre(ball_[value]), half = 0.5F * (glm::abs(frame.du) + glm::abs(frame.dv)) + kOfChart;
      box.low = glm::min(box.low, centre - (surface.planar ? half : glm::vec3(ball_[value].w)));
      box.high = glm::max(box.high, centre + (surface.planar ? half : glm::vec3(ball_[value].w)));
    }
  }
  return box;
}

void Shadows::addTiles(const Side& side) {
  for (std::uint32_t y = 0; y < side.height; y += kTileSide) {
    for (std::uint32_t x = 0; x < side.width; x += kTileSide) addTile(side, x, y);
  }
}

void Shadows::addTile(const Side& side, std::uint32_t x0, std::uint32_t y0) {
  Tile tile{value_.size(), 0, false};
  for (auto y = y0; y < std::min(y0 + kTileSide, side.height); ++y) {
    for (auto x = x0; x < std::min(x0 + kTileSide, side.width); ++x) addLeaf(side, y * side.width + x);
  }
  tile.count = value_.size() - tile.first;
  auto box = nothing();
  float reach = 1.0F;
  for (auto i = tile.first; i < value_.size(); ++i) {
    reach = std::max(reach, leaves_.reach[i]);
    tile.altered = tile.altered || change_.altered[value_[i]];
    if (leaves_.radius[i] >= 0.0F) include(box, leaves_.centre(i), leaves_.radius[i]);
  }
  tiles_.push_back(tile);
  const bool empty = box.low.x > box.high.x;
  tile_balls_.add(empty ? glm::vec3(0.0F) : 0.5F * (box.low + box.high),
                  empty ? -1.0F : 0.5F * glm::distance(box.low, box.high), reach);
}

void Shadows::addLeaf(const Side& side, std::uint32_t leaf) {
  value_.push_back(side.first_value + leaf);
  const auto& surface = patches_.surfaces[side.surface];
  const auto& point = patches_.leaves[surface.first_leaf + leaf];
  const auto triangle = point.triangle;
  if (triangle == scene::kNone) return leaves_.add(glm::vec3(0.0F), -1.0F);
  const auto& frame = patches_.triangles[triangle];
  const float x = static_cast<float>(leaf % side.width) + 0.5F, y = static_cast<float>(leaf / side.width) + 0.5F;
  const float half_diagonal = 0.5F * larger(glm::length(frame.du + frame.dv), glm::length(frame.du - frame.dv));
  leaves_.add(frame.origin + x * frame.du + y * frame.dv, (surface.planar ? 1.0F : kCurved) * half_diagonal,
              reachOf(surface, point));
}

bool Shadows::changesWithin(std::uint32_t value, float distance) const {
  const auto& ball = ball_[value];
  if (ball.w < 0.0F) return true;
  const glm::vec3 centre(ball);
  return std::ranges::any_of(all_, [&](const scene::ChangedBox& box) {
    return glm::distance(centre, glm::clamp(centre, box.low, box.high)) <= distance + ball.w;
  });
}

bool Shadows::changesAlong(const glm::vec3& from, const glm::vec3& to) const {
  const Ways way(from, to, kOfPlace);
  return std::ranges::any_of(all_, [&](const scene::ChangedBox& box) { return way.mayMeet(box); });
}

bool Shadows::changesBefore(std::uint32_t value, const glm::vec3& normal, float distance) const {
  const auto& ball = ball_[value];
  const glm::vec3 centre(ball);
  const auto lies = [&](const scene::ChangedBox& box, float least) {
    return glm::dot(normal, farthest(box, normal) - centre) > least &&
           glm::distance(centre, glm::clamp(centre, box.low, box.high)) <= distance + ball.w;
  };
  const bool has_altered = all_.size() > change_.boxes.size();
  return std::ranges::any_of(change_.boxes, [&](const auto& box) { return lies(box, kInFront); }) ||
         (has_altered && lies(all_.back(), 2.0F * kOfChart));
}

bool Shadows::passesWithin(const glm::vec3& middle, float radius) const {
  return std::ranges::any_of(change_.boxes, [&](const scene::ChangedBox& box) {
    return glm::distance(middle, glm::clamp(middle, box.low, box.high)) <= radius;
  });
}

bool Shadows::isPassed(const Boxes& boxes, const glm::vec4& from, const glm::vec4& to) {
  if (from.w < 0.0F || to.w < 0.0F) return !boxes.each.empty();
  const Ways way(from, to);
  return way.mayMeet(boxes.all) &&
         std::ranges::any_of(boxes.each, [&](const scene::ChangedBox& box) { return way.mayMeet(box); });
}

bool Shadows::isPassed(std::uint32_t value, const glm::vec3& to, float radius) const {
  return isPassed(Boxes{change_.boxes, around_}, ball_[value], glm::vec4(to, radius));
}

bool Shadows::isPassed(std::uint32_t value, std::uint32_t to) const {
  return isPassed(Boxes{change_.boxes, around_}, ball_[value], ball_[to]);
}

bool Shadows::isPassed(const glm::vec3& from, const glm::vec3& to) const {
  return isPassed(Boxes{change_.boxes, around_}, glm::vec4(from, kOfPlace), glm::vec4(to, kOfPlace));
}

Shadows::Look Shadows::lookFrom(std::uint32_t value) const {
  Look look{};
  look.shadows = this;
  look.from = ball_[value];
  look.past = ball_of_came_ - glm::vec4(glm::vec3(look.from), 0.0F);
  return look;
}

/// Most ways pass far from all of it: a ball is asked first.
bool Shadows::Look::mayHide(std::uint32_t to) const {
  const auto index = static_cast<std::int32_t>(to);
  std::int32_t may = 0;
  screen({&index, 1}, &may);
  return may != 0 && mayHideScreened(to);
}

bool Shadows::Look::mayHideScreened(std::uint32_t to) const {
  return isPassed(Boxes{shadows->change_.came, shadows->around_came_}, from, shadows->ball_[to]);
}

void Shadows::Look::screen(std::span<const std::int32_t> to, std::int32_t* may) const {
  if (shadows->change_.came.empty()) return (void)std::fill_n(may, to.size(), 0);
  if (to.empty()) return;
  screenBalls(from, past, to.size(), to.data(), &shadows->ball_.front().x, may);
}

bool Shadows::mayHide(const glm::vec3& from, const glm::vec3& direction, std::uint32_t to) const {
  const auto& ball = ball_[to];
  const auto end = from + (glm::distance(from, glm::vec3(ball)) + ball.w) * direction;
  return isPassed(Boxes{change_.came, around_came_}, glm::vec4(from, kOfPlace),
                  glm::vec4(end, ball.w < 0.0F ? ball.w : kOfPlace));
}

bool Shadows::sees(const glm::vec3& point, const glm::vec3& normal) const {
  return std::ranges::any_of(
      all_, [&](const scene::ChangedBox& box) { return glm::dot(normal, farthest(box, normal) - point) > kInFront; });
}

/// Raises the marks of balls that the way meets and that reach before the plane to 0 or more: segments and boxes (Kay
/// and Kajiya 1986). Marks are numbers, and nothing is decided but by smaller and larger, since GCC 12 vectorises
/// neither branches nor flags here. Both clones give the same marks.
RADIOSITY_CLONES void Shadows::markMet(const Way& way, const glm::vec4& plane, const Balls& balls, std::size_t begin,
                                       std::size_t end, float* marks) {
  const float ox = way.from.x, oy = way.from.y, oz = way.from.z;
  const float lx = way.low.x, ly = way.low.y, lz = way.low.z, hx = way.high.x, hy = way.high.y, hz = way.high.z;
  const float nx = plane.x, ny = plane.y, nz = plane.z, nd = plane.w;
  const float spread = way.spread, wide = way.wide;
  const float *x = balls.x.data() + begin, *y = balls.y.data() + begin, *z = balls.z.data() + begin;
  const float *radius = balls.radius.data() + begin, *reach = balls.reach.data() + begin;
  float* __restrict mark = marks;
  const std::size_t count = end - begin;
  for (std::size_t i = 0; i < count; ++i) {
    const float r = radius[i];
    const float dx = x[i] - ox, dy = y[i] - oy, dz = z[i] - oz;
    const float s = spread * reach[i] * std::sqrt(dx * dx + dy * dy + dz * dz) - wide;
    // At part t of the way one is past the low face where t (d + s) >= low - r - o, and so on.
    const Clip a = clip(dx + s, lx - r - ox), b = clip(s - dx, ox - hx - r), c = clip(dy + s, ly - r - oy);
    const Clip d = clip(s - dy, oy - hy - r), e = clip(dz + s, lz - r - oz), f = clip(s - dz, oz - hz - r);
    const float first = larger(larger(larger(a.first, b.first), larger(c.first, d.first)), larger(e.first, f.first));
    const float last = smaller(smaller(smaller(a.last, b.last), smaller(c.last, d.last)), smaller(e.last, f.last));
    const float height = nx * x[i] + ny * y[i] + nz * z[i] - nd;
    mark[i] = larger(mark[i], smaller(smaller(last - first, r), height + r));
  }
}

void Shadows::markNear(const EdgeBall& edge, Scratch& scratch) const {
  scratch.found.resize((change_.altered.size() + 63) / 64);
  const auto isNear = [&](const Balls& balls, std::size_t i) {
    return balls.radius[i] >= 0.0F && glm::distance(balls.centre(i), edge.middle) <= edge.reach + balls.radius[i];
  };
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    if (!isNear(tile_balls_, t)) continue;
    for (auto i = tiles_[t].first; i < tiles_[t].first + tiles_[t].count; ++i) {
      const auto value = value_[i];
      if (!isNear(leaves_, i) || !isPassed(value, edge.middle, edge.radius)) continue;
      scratch.found[value / 64] |= std::uint64_t{1} << (value % 64);
    }
  }
}

/// Tiles that a way around all boxes meets, then those of them that the way to a single box meets, then their leaves.
/// All from the middle of the points: a way from one of these is as far from that from the middle as they are apart,
/// and ever less towards the leaf, so that boxes grow by that.
void Shadows::find(std::span<const glm::vec3> points, const glm::vec3& normal, float radius, std::uint32_t resolution,
                   Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const {
  // A pixel is 2 / N wide at a depth of one; depths are at most distances.
  const float spread = 2.0F * kHalfDiagonal / static_cast<float>(resolution);
  const Ball around = ballAround(points);
  // Pixels are widest where seen from the point that is farthest away.
  const float wide = radius + around.radius, reach = wide + around.radius * spread * kMostReach;
  const auto wayTo = [&](const scene::ChangedBox& box) {
    return Way{around.middle, box.low - reach, box.high + reach, spread, wide};
  };
  const glm::vec4 plane(normal, glm::dot(normal, points.front()));
  scratch.tiles.assign(tiles_.size(), kMissed);
  if (!change_.boxes.empty()) markMet(wayTo(around_), plane, tile_balls_, 0, tiles_.size(), scratch.tiles.data());
  takeTiles(scratch);
  const auto near = scratch.near.size();
  scratch.ways.clear();
  scratch.by_way.assign(change_.boxes.size() * near, kMissed);
  for (const auto& box : change_.boxes) {
    auto* marks = scratch.by_way.data() + scratch.ways.size() * near;
    scratch.ways.push_back(wayTo(box));
    markMet(scratch.ways.back(), plane, scratch.near_balls, 0, near, marks);
  }
  scratch.found.resize((change_.altered.size() + 63) / 64);
  for (std::size_t i = 0; i < near; ++i) markLeaves(i, plane, scratch);
  takeRuns(scratch, runs);
}

/// Those that are marked, and those of which leaves are altered.
void Shadows::takeTiles(Scratch& scratch) const {
  scratch.near.clear();
  scratch.near_balls.clear();
  for (std::uint32_t t = 0; t < tiles_.size(); ++t) {
    if (scratch.tiles[t] < 0.0F && !tiles_[t].altered) continue;
    scratch.near.push_back(t);
    scratch.near_balls.add(tile_balls_.centre(t), tile_balls_.radius[t], tile_balls_.reach[t]);
  }
}

/// Leaves of the i-th of the tiles that were taken.
void Shadows::markLeaves(std::size_t i, const glm::vec4& plane, Scratch& scratch) const {
  const auto& tile = tiles_[scratch.near[i]];
  scratch.leaves.assign(tile.count, kMissed);
  bool met = tile.altered;
  for (std::size_t w = 0; w < scratch.ways.size(); ++w) {
    if (scratch.by_way[w * scratch.near.size() + i] < 0.0F) continue;
    met = true;
    markMet(scratch.ways[w], plane, leaves_, tile.first, tile.first + tile.count, scratch.leaves.data());
    if (std::ranges::all_of(scratch.leaves, [](float mark) { return mark >= 0.0F; })) break;
  }
  for (std::size_t k = 0; met && k < tile.count; ++k) {
    const auto value = value_[tile.first + k];
    const bool found = scratch.leaves[k] >= 0.0F || (tile.altered && change_.altered[value]);
    scratch.found[value / 64] |= std::uint64_t{found} << (value % 64);
  }
}

/// Of the bits that are set, which it clears.
void Shadows::takeRuns(Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const {
  runs.clear();
  for (std::size_t word = 0; word < scratch.found.size(); ++word) {
    for (auto bits = std::exchange(scratch.found[word], 0); bits != 0; bits &= bits - 1) {
      const auto value = static_cast<std::uint32_t>(64 * word + static_cast<std::size_t>(std::countr_zero(bits)));
      const bool joins = !runs.empty() && runs.back().first + runs.back().count == value && !starts_[value];
      if (!joins) runs.push_back({value, 0});
      ++runs.back().count;
    }
  }
}

}  // namespace radiosity::solver
