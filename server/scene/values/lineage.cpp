#include "server/scene/values/lineage.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <limits>
#include <map>
#include <span>
#include <tuple>
#include <utility>

#include "common/check.h"
#include "common/union_find.h"

namespace radiosity::scene {
namespace {

/// By which an instance is known again: its node, mesh and primitive, and which of the node's instances it is. Of those
/// that have these in common the one of lower index comes first.
struct InstanceKey {
  std::uint32_t node, mesh, primitive;
  std::uint32_t index;  ///< in Scene::instances

  [[nodiscard]] auto what() const { return std::tie(node, mesh, primitive); }
  bool operator<(const InstanceKey& other) const {
    return std::tie(node, mesh, primitive, index) < std::tie(other.node, other.mesh, other.primitive, other.index);
  }
};

/// In ascending order; most scenes have them in it as they are.
std::vector<InstanceKey> keysOf(const Scene& scene) {
  std::vector<InstanceKey> keys;
  keys.reserve(scene.instances.size());
  for (const auto& instance : scene.instances) {
    const auto& primitive = scene.primitives[instance.primitive];
    keys.push_back({instance.node, primitive.mesh, primitive.primitive, static_cast<std::uint32_t>(keys.size())});
  }
  if (!std::ranges::is_sorted(keys, std::less<>())) std::ranges::sort(keys, std::less<>());
  return keys;
}

/// By instance: its first surface and how many it has; they lie together.
struct SurfaceRange {
  std::uint32_t first = 0, count = 0;
};
std::vector<SurfaceRange> surfacesOf(const Scene& scene, const PatchScene& patches) {
  std::vector<SurfaceRange> ranges(scene.instances.size());
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    auto& range = ranges[patches.surfaces[s].instance];
    if (range.count++ == 0) range.first = s;
  }
  return ranges;
}

/// More boxes cost more to look past than they leave out.
constexpr std::size_t kMaxChangedBoxes = 16;
/// Of more than these it is not asked which go together best.
constexpr std::size_t kMostCompared = 64;
/// What a box hides, or lets be seen, goes by its surface.
constexpr float kJoin = 0.9F;

ChangedBox unionOf(const ChangedBox& a, const ChangedBox& b) {
  return {glm::min(a.low, b.low), glm::max(a.high, b.high)};
}

float surfaceOf(const ChangedBox& box) {
  const glm::vec3 size = box.high - box.low;
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

bool sameGrid(const Surface& a, const Surface& b) {
  const auto hasSide = [](const Surface& s, std::size_t side) { return s.first_node[side] != kNone; };
  return a.width == b.width && a.height == b.height && hasSide(a, 0) == hasSide(b, 0) && hasSide(a, 1) == hasSide(b, 1);
}

InstanceCharts keysOf(const PatchScene& patches, std::uint32_t instance, const SurfaceRange& range) {
  InstanceCharts charts{{}, patches.cuts.find(instance) != nullptr};
  for (auto s = range.first; s < range.first + range.count; ++s) {
    const Surface& surface = patches.surfaces[s];
    charts.keys.push_back(
        {patches.cuts.sourceOf(instance, patches.triangle_source[surface.first_triangle]), surface.triangle_count});
  }
  return charts;
}

/// By surface: the former one of the same instance and grid, or kNone.
std::vector<std::uint32_t> formerSurfaces(const Scene& scene_before, const PatchScene& before, const Scene& scene_after,
                                          const PatchScene& after) {
  std::vector<std::uint32_t> former(after.surfaces.size(), kNone);
  const auto old_ranges = surfacesOf(scene_before, before), new_ranges = surfacesOf(scene_after, after);
  const auto source = matchInstances(scene_before, scene_after);
  for (std::uint32_t i = 0; i < new_ranges.size(); ++i) {
    if (source[i] == kNone) continue;
    const auto range = new_ranges[i], old_range = old_ranges[source[i]];
    const auto match = matchCharts(keysOf(before, source[i], old_range), keysOf(after, i, range));
    for (std::uint32_t k = 0; k < range.count; ++k) {
      if (match[k] == kNone) continue;
      const auto of = old_range.first + match[k];
      if (sameGrid(before.surfaces[of], after.surfaces[range.first + k])) former[range.first + k] = of;
    }
  }
  return former;
}

class Matcher {
 public:
  Matcher(const PatchScene& before, const PatchScene& after) : before_(before), after_(after) {}

  [[nodiscard]] bool samePlace(const Surface& a, const Surface& b) const {
    if (a.triangle_count != b.triangle_count || a.planar != b.planar || a.see_through || b.see_through) return false;
    if (a.emits != b.emits) return false;  // another may be seen where they lie
    for (std::uint32_t i = 0; i < 3 * a.triangle_count; ++i) {
      const auto& v = before_.vertices[before_.indices[std::size_t{3} * a.first_triangle + i]];
      const auto& w = after_.vertices[after_.indices[std::size_t{3} * b.first_triangle + i]];
      if (v.position != w.position || v.texel != w.texel || v.normal != w.normal) return false;
    }
    return true;
  }

  /// Of surfaces in the same place.
  [[nodiscard]] bool sameFrames(const Surface& a, const Surface& b) const {
    for (std::uint32_t i = 0; i < a.triangle_count; ++i) {
      const auto &f = before_.triangles[a.first_triangle + i], &g = after_.triangles[b.first_triangle + i];
      if (f.origin != g.origin || f.du != g.du || f.dv != g.dv || f.normal != g.normal) return false;
    }
    return true;
  }

  /// A leaf of a surface that has not moved. Triangles are numbered from the surface's first.
  [[nodiscard]] bool sameLeaf(const Surface& a, const Surface& b, std::uint32_t leaf) const {
    const auto &old_one = before_.leaves[a.first_leaf + leaf], &new_one = after_.leaves[b.first_leaf + leaf];
    const auto sameTriangle = [&](std::uint32_t t, std::uint32_t u) {
      return t == kNone || u == kNone ? t == u : t - a.first_triangle == u - b.first_triangle;
    };
    if (!sameTriangle(old_one.triangle, new_one.triangle) || old_one.full != new_one.full ||
        old_one.cut != new_one.cut || old_one.beneath != new_one.beneath)
      return false;
    if (!old_one.full && old_one.texel != new_one.texel) return false;
    if (old_one.hasSpots() != new_one.hasSpots()) return false;
    const auto count = old_one.hasSpots() && !old_one.full ? before_.spotCount(old_one) : 0;  // full ones: all alike
    if (count > 0 && count != after_.spotCount(new_one)) return false;
    for (std::uint32_t k = 0; k < count; ++k) {
      const auto s = before_.spot(old_one, k), t = after_.spot(new_one, k);
      if (s.texel != t.texel || !sameTriangle(s.triangle, t.triangle)) return false;
    }
    for (std::size_t side = 0; side < 2; ++side) {
      if (a.first_node[side] == kNone) continue;
      if (before_.node_area[a.first_node[side] + leaf] != after_.node_area[b.first_node[side] + leaf]) return false;
    }
    return true;
  }

 private:
  const PatchScene& before_;
  const PatchScene& after_;
};

/// Boxes around some surfaces: one for each part of an instance that hangs together, which is much less than one around
/// all of a chair.
class Boxes {
 public:
  explicit Boxes(const PatchScene& patches) : patches_(patches) {}
  /// In ascending order.
  void add(std::uint32_t surface) { surfaces_.push_back(surface); }
  void appendTo(std::vector<ChangedBox>& all) const {
    for (std::size_t first = 0; first < surfaces_.size();) {
      auto end = first + 1;
      while (end < surfaces_.size() && instanceOf(end) == instanceOf(first)) ++end;
      const auto parts = partsOf(std::span(surfaces_).subspan(first, end - first));
      all.insert(all.end(), parts.begin(), parts.end());
      first = end;
    }
  }

 private:
  using Corner = std::tuple<float, float, float>;
  static constexpr std::size_t kMostToTellApart = 200'000;  ///< triangles: a tenth of a second

  [[nodiscard]] std::uint32_t instanceOf(std::size_t i) const { return patches_.surfaces[surfaces_[i]].instance; }

  /// Surfaces that share a corner hang together. One for all of them where they are too many to tell apart.
  [[nodiscard]] std::vector<ChangedBox> partsOf(std::span<const std::uint32_t> surfaces) const {
    UnionFind parts(surfaces.size());
    std::size_t triangles = 0;
    for (const auto surface : surfaces) triangles += patches_.surfaces[surface].triangle_count;
    const bool tells_apart = triangles <= kMostToTellApart;
    std::vector<std::pair<Corner, std::uint32_t>> corners;
    for (std::uint32_t i = 0; i < surfaces.size() && tells_apart; ++i) {
      const auto& surface = patches_.surfaces[surfaces[i]];
      for (std::uint32_t k = 0; k < 3 * surface.triangle_count; ++k) {
        const auto& at = patches_.vertices[patches_.indices[std::size_t{3} * surface.first_triangle + k]].position;
        corners.push_back({{at.x, at.y, at.z}, i});
      }
    }
    std::ranges::sort(corners);
    for (std::size_t k = 1; k < corners.size(); ++k) {
      if (corners[k].first == corners[k - 1].first) parts.join(corners[k].second, corners[k - 1].second);
    }
    std::map<std::uint32_t, ChangedBox> boxes;
    for (std::uint32_t i = 0; i < surfaces.size(); ++i) {
      const auto& surface = patches_.surfaces[surfaces[i]];
      const ChangedBox own{surface.bounds_min, surface.bounds_max};
      const auto [box, is_new] = boxes.try_emplace(tells_apart ? parts.find(i) : 0, own);
      if (!is_new) box->second = unionOf(box->second, own);
    }
    std::vector<ChangedBox> all;
    for (const auto& [root, box] : boxes) {
      if (all.empty() || boxes.size() <= kMaxChangedBoxes) {
        all.push_back(box);
      } else {
        all[0] = unionOf(all[0], box);
      }
    }
    return all;
  }

  const PatchScene& patches_;
  std::vector<std::uint32_t> surfaces_;
};

/// The two boxes whose union has the least surface more than they.
std::pair<std::size_t, std::size_t> bestPair(const std::vector<ChangedBox>& boxes) {
  std::pair<std::size_t, std::size_t> best{0, 1};
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    for (auto k = i + 1; k < boxes.size(); ++k) {
      const float more = surfaceOf(unionOf(boxes[i], boxes[k])) - surfaceOf(boxes[i]) - surfaceOf(boxes[k]);
      if (more >= least) continue;
      least = more;
      best = {i, k};
    }
  }
  return best;
}

}  // namespace

std::vector<std::uint32_t> matchCharts(const InstanceCharts& before, const InstanceCharts& after) {
  std::vector<std::uint32_t> match(after.keys.size(), kNone);
  if (!before.cut && !after.cut) {
    for (std::uint32_t k = 0; k < match.size() && before.keys.size() == match.size(); ++k) match[k] = k;
    return match;
  }
  std::map<ChartKey, std::vector<std::uint32_t>> known;  // last first
  for (auto k = static_cast<std::uint32_t>(before.keys.size()); k-- > 0;) known[before.keys[k]].push_back(k);
  for (std::uint32_t k = 0; k < match.size(); ++k) {
    const auto found = known.find(after.keys[k]);
    if (found == known.end() || found->second.empty()) continue;
    match[k] = found->second.back();
    found->second.pop_back();
  }
  return match;
}

std::vector<std::uint32_t> matchInstances(const Scene& before, const Scene& after) {
  const auto old_keys = keysOf(before), new_keys = keysOf(after);
  std::vector<std::uint32_t> source(after.instances.size(), kNone);
  auto of = old_keys.begin();
  for (const auto& key : new_keys) {
    while (of != old_keys.end() && of->what() < key.what()) ++of;
    if (of == old_keys.end()) break;
    if (of->what() == key.what()) source[key.index] = (of++)->index;
  }
  return source;
}

bool sweeps(const glm::dvec3& from, const glm::dvec3& half, const glm::dvec3& direction, double length,
            const ChangedBox& box) {
  double near = 0.0, far = length;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = static_cast<double>(box.low[axis]) - half[axis] - from[axis];
    const double high = static_cast<double>(box.high[axis]) + half[axis] - from[axis];
    if (std::abs(direction[axis]) < 1e-12) {
      if (low > 0.0 || high < 0.0) return false;
      continue;
    }
    const double one = low / direction[axis], other = high / direction[axis];
    near = std::max(near, std::min(one, other));
    far = std::min(far, std::max(one, other));
  }
  return near <= far;
}

void joinBoxes(std::vector<ChangedBox>& boxes) {
  const auto join = [&](std::size_t i, std::size_t k) {
    boxes[i] = unionOf(boxes[i], boxes[k]);
    boxes.erase(boxes.begin() + static_cast<std::ptrdiff_t>(k));
  };
  if (boxes.size() > kMostCompared) {  // those that come one after the other, since they often belong together
    const auto all = std::exchange(boxes, {});
    for (std::size_t i = 0; i < all.size(); ++i) {
      const auto to = i * kMostCompared / all.size();
      if (to == boxes.size()) boxes.push_back(all[i]);
      boxes[to] = unionOf(boxes[to], all[i]);
    }
  }
  for (bool joined = true; joined;) {
    joined = false;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      for (std::size_t k = i + 1; k < boxes.size();) {
        if (surfaceOf(unionOf(boxes[i], boxes[k])) > kJoin * (surfaceOf(boxes[i]) + surfaceOf(boxes[k]))) {
          ++k;
          continue;
        }
        join(i, k);
        joined = true;
      }
    }
  }
  while (boxes.size() > kMaxChangedBoxes) {
    const auto [i, k] = bestPair(boxes);
    join(i, k);
  }
}

bool PatchMap::nothingKept() const {
  return std::ranges::all_of(moved, [](bool m) { return m; });
}

std::vector<std::uint32_t> matchSurfaces(const Scene& scene_before, const PatchScene& before, const Scene& scene_after,
                                         const PatchScene& after) {
  auto source = formerSurfaces(scene_before, before, scene_after, after);
  const Matcher matcher(before, after);
  for (std::uint32_t s = 0; s < source.size(); ++s) {
    if (source[s] == kNone) continue;
    const Surface &a = before.surfaces[source[s]], &b = after.surfaces[s];
    if (!matcher.samePlace(a, b) || !matcher.sameFrames(a, b)) source[s] = kNone;
  }
  return source;
}

PatchMap matchPatches(const Scene& scene_before, const PatchScene& before, const Scene& scene_after,
                      const PatchScene& after) {
  RAD_CHECK(before.centre == after.centre && before.scale == after.scale);
  PatchMap map;
  map.moved.assign(after.surfaces.size(), true);
  map.leaf_altered.assign(after.leaves.size(), true);
  map.surface_before = formerSurfaces(scene_before, before, scene_after, after);
  const Matcher matcher(before, after);
  Boxes old_boxes(before), new_boxes(after);
  std::vector<bool> stayed(before.surfaces.size(), false);
  for (std::uint32_t s = 0; s < after.surfaces.size(); ++s) {
    const auto former = map.surface_before[s];
    const auto& surface = after.surfaces[s];
    if (former == kNone || !matcher.samePlace(before.surfaces[former], surface)) {
      new_boxes.add(s);
      continue;
    }
    map.moved[s] = false;
    stayed[former] = true;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf)
      map.leaf_altered[surface.first_leaf + leaf] = !matcher.sameLeaf(before.surfaces[former], surface, leaf);
  }
  for (std::uint32_t s = 0; s < before.surfaces.size(); ++s) {
    if (!stayed[s]) old_boxes.add(s);
  }
  old_boxes.appendTo(map.boxes);
  new_boxes.appendTo(map.came);
  map.boxes.insert(map.boxes.end(), map.came.begin(), map.came.end());
  joinBoxes(map.boxes);
  joinBoxes(map.came);
  return map;
}

}  // namespace radiosity::scene
