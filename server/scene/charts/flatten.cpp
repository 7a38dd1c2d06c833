#include "server/scene/charts/flatten.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>
#include <glm/vector_relational.hpp>
#include <utility>
#include <vector>

#include "common/task.h"

namespace radiosity::scene {
namespace {

/// Distances below this fraction of an instance's extent are rounding of 32-bit file coordinates.
constexpr double kWeldFraction = 2e-7;

/// Heights of triangles below this part of the unit box are rounding too, however small their instance is: they are a
/// few hundred steps of a double there, and a chart's plane is fitted to sums of such coordinates.
constexpr double kLeastHeight = 1e-13;

/// A scene keeps the unit box of its former self as long as it reaches no farther from its middle, ...
constexpr double kMostReach = 0.75;
/// ... and fills this part of it: 32-bit positions keep their digits.
constexpr double kLeastExtent = 0.5;

bool isFinite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

struct Box {
  glm::dvec3 min{std::numeric_limits<double>::infinity()}, max{-std::numeric_limits<double>::infinity()};
  void add(const glm::dvec3& p) {
    min = glm::min(min, p);
    max = glm::max(max, p);
  }
  [[nodiscard]] bool empty() const { return min.x > max.x; }
  [[nodiscard]] double extent() const {
    return empty() ? 0.0 : std::max({max.x - min.x, max.y - min.y, max.z - min.z});
  }
};

bool usable(const Scene& scene, const Instance& instance) {
  return instance.visible && instance.primitive < scene.primitives.size();
}

glm::dvec3 toWorld(const Instance& instance, const glm::dvec3& p) {
  return glm::dvec3(instance.world * glm::dvec4(p, 1.0));
}

/// Only vertices that triangles use count, so that a stray vertex does not shrink the scene.
Box worldBounds(const Scene& scene) {
  Box box;
  for (const Instance& instance : scene.instances) {
    interruptionPoint();
    if (!usable(scene, instance)) continue;
    const Primitive& primitive = scene.primitives[instance.primitive];
    for (const std::uint32_t index : primitive.indices) {
      const glm::dvec3 p = toWorld(instance, primitive.positions[index]);
      if (isFinite(p)) box.add(p);
    }
  }
  return box;
}

/// By the key of a cell: the last point that was put into it. One flat table, since a node of its own for each cell,
/// and giving them all back, takes longer than welding.
class CellHeads {
 public:
  /// kNone: the cell is empty.
  [[nodiscard]] std::uint32_t at(std::uint64_t key) const { return slots_[slotOf(key)].point; }
  /// Returns the former one.
  std::uint32_t replace(std::uint64_t key, std::uint32_t point) {
    if (2 * (used_ + 1) > slots_.size()) grow();
    auto& slot = slots_[slotOf(key)];
    if (slot.point == kNone) ++used_;
    slot.key = key;
    return std::exchange(slot.point, point);
  }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t point = kNone;
  };

  /// Its own, or the empty one that it would get.
  [[nodiscard]] std::size_t slotOf(std::uint64_t key) const {
    const auto mask = slots_.size() - 1;
    auto at = static_cast<std::size_t>(key) & mask;
    while (slots_[at].point != kNone && slots_[at].key != key) at = (at + 1) & mask;
    return at;
  }
  void grow() {
    const auto all = std::exchange(slots_, std::vector<Slot>(2 * slots_.size()));
    for (const auto& slot : all)
      if (slot.point != kNone) slots_[slotOf(slot.key)] = slot;
  }

  std::vector<Slot> slots_ = std::vector<Slot>(16);  ///< a power of two, half of them empty
  std::size_t used_ = 0;
};

/// Points closer than the tolerance become one (the first). A hash grid of cells much larger than the tolerance, so
/// that most points look into one cell only.
class Welder {
 public:
  Welder(std::vector<glm::dvec3>& points, double tolerance)
      : points_(points), tolerance_(tolerance), cell_(std::max(tolerance * 64.0, 1e-12)) {}

  std::uint32_t weld(const glm::dvec3& p) {
    const glm::dvec3 low = (p - tolerance_) / cell_;
    const glm::dvec3 high = (p + tolerance_) / cell_;
    for (auto x = floorOf(low.x); x <= floorOf(high.x); ++x)
      for (auto y = floorOf(low.y); y <= floorOf(high.y); ++y)
        for (auto z = floorOf(low.z); z <= floorOf(high.z); ++z) {
          for (std::uint32_t i = heads_.at(key(x, y, z)); i != kNone; i = next_[i - base_])
            if (glm::distance(points_[i], p) <= tolerance_) return i;
        }
    return insert(p);
  }

 private:
  static std::int64_t floorOf(double v) { return static_cast<std::int64_t>(std::floor(v)); }
  static std::uint64_t key(std::int64_t x, std::int64_t y, std::int64_t z) {
    const auto mix = [](std::uint64_t h) {
      h ^= h >> 32;
      h *= 0xd6e8feb86659fd93ULL;
      return h ^ (h >> 32);
    };
    return mix(static_cast<std::uint64_t>(x) + mix(static_cast<std::uint64_t>(y) + mix(static_cast<std::uint64_t>(z))));
  }
  std::uint32_t insert(const glm::dvec3& p) {
    const auto id = static_cast<std::uint32_t>(points_.size());
    points_.push_back(p);
    next_.push_back(heads_.replace(key(floorOf(p.x / cell_), floorOf(p.y / cell_), floorOf(p.z / cell_)), id));
    return id;
  }

  std::vector<glm::dvec3>& points_;
  std::uint32_t base_ = static_cast<std::uint32_t>(points_.size());
  double tolerance_, cell_;
  CellHeads heads_;
  std::vector<std::uint32_t> next_;
};

/// Smallest index first, order kept, so that equal triangles compare equal whatever corner they start with.
std::array<std::uint32_t, 3> canonical(const std::array<std::uint32_t, 3>& p) {
  if (p[0] < p[1] && p[0] < p[2]) return p;
  if (p[1] < p[2]) return {p[1], p[2], p[0]};
  return {p[2], p[0], p[1]};
}

class InstanceFlattener {
 public:
  InstanceFlattener(const Scene& scene, const WallCuts& cuts, FlatScene& flat, std::uint32_t instance)
      : flat_(flat),
        id_(instance),
        instance_(scene.instances[instance]),
        primitive_(cuts.primitiveOf(scene, instance)),
        cut_(cuts.find(instance)),
        mirrored_(glm::determinant(glm::dmat3(instance_.world)) < 0.0) {}

  void run() {
    transform();
    const double tolerance = kWeldFraction * extent_;
    flat_.tolerance[id_] = tolerance;
    Welder welder(flat_.points, tolerance);
    welded_.assign(positions_.size(), kNone);
    const auto count = static_cast<std::uint32_t>(primitive_.indices.size() / 3);
    const std::size_t first = flat_.triangles.size();
    for (std::uint32_t t = 0; t < count; ++t) {
      interruptionPoint();
      addTriangle(t, welder, tolerance);
    }
    dropDuplicates(first);
  }

 private:
  void transform() {
    findUsed();
    const auto count = used_.empty() ? primitive_.positions.size() : used_.size();
    positions_.resize(count);
    for (std::size_t i = 0; i < count; ++i)
      positions_[i] =
          (toWorld(instance_, primitive_.positions[used_.empty() ? i : used_[i]]) - flat_.centre) / flat_.scale;
    Box box;
    for (const std::uint32_t index : primitive_.indices)
      if (const auto& position = positions_[numberOf(index)]; isFinite(position)) box.add(position);
    extent_ = box.extent();
  }

  /// Many primitives may share one long list of vertices: an instance costs no more than its triangles.
  void findUsed() {
    if (primitive_.positions.size() <= primitive_.indices.size()) return;
    used_ = primitive_.indices;
    std::ranges::sort(used_);
    used_.erase(std::unique(used_.begin(), used_.end()), used_.end());
  }
  [[nodiscard]] std::uint32_t numberOf(std::uint32_t vertex) const {
    if (used_.empty()) return vertex;
    return static_cast<std::uint32_t>(std::ranges::lower_bound(used_, vertex) - used_.begin());
  }

  void addTriangle(std::uint32_t source, Welder& welder, double tolerance) {
    FlatTriangle triangle{};
    triangle.instance = id_;
    triangle.source = source;
    for (std::uint32_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t from = mirrored_ ? (3 - corner) % 3 : corner;
      const std::uint32_t index = numberOf(primitive_.indices[std::size_t{3} * source + from]);
      if (!isFinite(positions_[index])) {
        ++flat_.dropped;
        return;
      }
      if (welded_[index] == kNone) welded_[index] = welder.weld(positions_[index]);
      triangle.points[corner] = welded_[index];
      triangle.source_corner[corner] = from;
    }
    const glm::dvec3& a = flat_.points[triangle.points[0]];
    const glm::dvec3& b = flat_.points[triangle.points[1]];
    const glm::dvec3& c = flat_.points[triangle.points[2]];
    const glm::dvec3 cross = glm::cross(b - a, c - a);
    const double twice_area = glm::length(cross);
    const double longest = std::max({glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)});
    if (!(twice_area > std::max(tolerance, kLeastHeight) * longest)) {  // its height is rounding
      ++flat_.dropped;
      return;
    }
    if (cut_ != nullptr) markCuts(triangle);
    triangle.normal = cross / twice_area;
    triangle.area = 0.5 * twice_area;
    flat_.triangles.push_back(triangle);
  }

  void markCuts(FlatTriangle& triangle) const {
    triangle.region = cut_->region[triangle.source];
    triangle.hidden = cut_->hidden[triangle.source];
    for (std::uint32_t e = 0; e < 3; ++e) {
      const auto from = triangle.source_corner[e], to = triangle.source_corner[(e + 1) % 3];
      const auto of_source = to == (from + 1) % 3 ? from : to;
      if ((cut_->walled[triangle.source] >> of_source & 1U) != 0U)
        triangle.walled = static_cast<std::uint8_t>(triangle.walled | 1U << e);
    }
  }

  void dropDuplicates(std::size_t first) {
    auto& all = flat_.triangles;
    std::vector<std::uint32_t> order(all.size() - first);
    std::vector<std::array<std::uint32_t, 3>> keys(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      order[i] = static_cast<std::uint32_t>(i);
      keys[i] = canonical(all[first + i].points);
    }
    std::ranges::sort(order,
                      [&](std::uint32_t a, std::uint32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; });
    std::vector<bool> drop(order.size(), false);
    for (std::size_t i = 1; i < order.size(); ++i) drop[order[i]] = keys[order[i]] == keys[order[i - 1]];
    std::size_t kept = first;
    for (std::size_t i = 0; i < drop.size(); ++i)
      if (!drop[i]) all[kept++] = all[first + i];
    flat_.dropped += all.size() - kept;
    all.resize(kept);
  }

  FlatScene& flat_;
  std::uint32_t id_;
  const Instance& instance_;
  const Primitive& primitive_;
  const CutPrimitive* cut_;  ///< null: it is whole
  bool mirrored_;
  double extent_ = 0.0;
  std::vector<std::uint32_t> used_;    ///< vertices that triangles have, ascending; empty: all
  std::vector<glm::dvec3> positions_;  ///< of these
  std::vector<std::uint32_t> welded_;  ///< likewise
};

struct HalfEdge {
  std::uint32_t low, high;
  std::uint32_t slot;  ///< 3 x triangle + edge
  bool forward;        ///< runs from low to high
};

/// Pairs one edge's opposite half-edges, flattest pair first.
void pairHalfEdges(const FlatScene& flat, const HalfEdge* edges, std::size_t count,
                   std::vector<std::uint32_t>& neighbours) {
  const auto regionAt = [&](std::size_t i) { return flat.triangles[edges[i].slot / 3].region; };
  if (count == 2) {
    if (edges[0].forward == edges[1].forward || regionAt(0) != regionAt(1)) return;
    neighbours[edges[0].slot] = edges[1].slot / 3;
    neighbours[edges[1].slot] = edges[0].slot / 3;
    return;
  }
  struct Pair {
    double flatness;
    std::uint32_t a, b;
  };
  std::vector<Pair> pairs;
  const std::size_t bounded = std::min<std::size_t>(count, 64);  // a fan of thousands would be quadratic
  for (std::size_t i = 0; i < bounded; ++i)
    for (std::size_t j = i + 1; j < bounded; ++j)
      if (edges[i].forward != edges[j].forward && regionAt(i) == regionAt(j))
        pairs.push_back({glm::dot(flat.triangles[edges[i].slot / 3].normal, flat.triangles[edges[j].slot / 3].normal),
                         edges[i].slot, edges[j].slot});
  std::ranges::stable_sort(pairs, [](const Pair& x, const Pair& y) { return x.flatness > y.flatness; });
  for (const Pair& pair : pairs) {
    if (neighbours[pair.a] != kNone || neighbours[pair.b] != kNone) continue;
    neighbours[pair.a] = pair.b / 3;
    neighbours[pair.b] = pair.a / 3;
  }
}

}  // namespace

UnitFrame frameFor(const Scene& scene, const UnitFrame* former) {
  UnitFrame frame;
  const Box box = worldBounds(scene);
  if (former != nullptr && !box.empty()) {
    const auto low = (box.min - former->centre) / former->scale, high = (box.max - former->centre) / former->scale;
    const bool holds = glm::all(glm::greaterThanEqual(low, glm::dvec3(-kMostReach))) &&
                       glm::all(glm::lessThanEqual(high, glm::dvec3(kMostReach)));
    if (holds && box.extent() >= kLeastExtent * former->scale) return *former;
  }
  if (!box.empty()) frame.centre = 0.5 * box.min + 0.5 * box.max;
  if (box.extent() > 0.0) frame.scale = box.extent();
  return frame;
}

FlatScene flatten(const Scene& scene, const UnitFrame& frame, const WallCuts& cuts) {
  FlatScene flat;
  flat.centre = frame.centre;
  flat.scale = frame.scale;
  flat.tolerance.assign(scene.instances.size(), 0.0);
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    interruptionPoint();
    flat.first_triangle.push_back(static_cast<std::uint32_t>(flat.triangles.size()));
    if (usable(scene, scene.instances[i])) InstanceFlattener(scene, cuts, flat, i).run();
  }
  flat.first_triangle.push_back(static_cast<std::uint32_t>(flat.triangles.size()));
  if (flat.dropped > 0)
    flat.warnings.push_back(fmt::format("{} zero-area, non-finite or duplicate triangles were left out", flat.dropped));
  return flat;
}

std::vector<std::uint32_t> edgeNeighbours(const FlatScene& flat) {
  std::vector<HalfEdge> edges;
  edges.reserve(flat.triangles.size() * 3);
  for (std::uint32_t t = 0; t < flat.triangles.size(); ++t)
    for (std::uint32_t e = 0; e < 3; ++e) {
      const std::uint32_t a = flat.triangles[t].points[e];
      const std::uint32_t b = flat.triangles[t].points[(e + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), 3 * t + e, a < b});
    }
  std::ranges::sort(edges, [](const HalfEdge& x, const HalfEdge& y) {
    if (x.low != y.low) return x.low < y.low;
    if (x.high != y.high) return x.high < y.high;
    return x.slot < y.slot;
  });
  std::vector<std::uint32_t> neighbours(flat.triangles.size() * 3, kNone);
  for (std::size_t i = 0; i < edges.size();) {
    interruptionPoint();
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    if (end - i >= 2) pairHalfEdges(flat, &edges[i], end - i, neighbours);
    i = end;
  }
  return neighbours;
}

std::vector<std::uint32_t> weldPoints(const std::vector<glm::dvec3>& points, double tolerance) {
  std::vector<glm::dvec3> kept;
  Welder welder(kept, tolerance);
  std::vector<std::uint32_t> ids;
  ids.reserve(points.size());
  for (const glm::dvec3& point : points) ids.push_back(welder.weld(point));
  return ids;
}

std::string describeInstance(const Scene& scene, std::uint32_t instance) {
  const Instance& placed = scene.instances[instance];
  const Primitive& primitive = scene.primitives[placed.primitive];
  const auto number = [](std::uint32_t id) { return id == kNone ? std::string("?") : std::to_string(id); };
  return fmt::format("/nodes/{} (/meshes/{}/primitives/{})", number(placed.node), number(primitive.mesh),
                     number(primitive.primitive));
}

}  // namespace radiosity::scene
