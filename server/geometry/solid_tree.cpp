#include "server/geometry/solid_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <new>
#include <tuple>

#include "common/clones.h"
#include "server/geometry/triangle_hit.h"

namespace radiosity::scene {
namespace {

/// Of a node with its boxes, or of a block with its triangles: what time it takes, in units of Hits::work.
constexpr std::uint64_t kNodeWork = 4;
constexpr std::size_t kMovedAtOnce = 8;  ///< hits that are moved in a unit of work
/// Hits that would have to make way for one: where they are more, those that wait are kept in a heap, and each takes so
/// much work.
constexpr std::size_t kMostMoved = 64, kHeapWork = 8;
/// By which a ray may seem to miss a triangle that it meets (unit box): twice what rounding makes of it.
constexpr float kEdge = 1e-6F;

/// Trees that are followed at once: one after the other, the first, which may be large, last.
constexpr std::size_t kTreesAtOnce = 64;

/// Of nodes that wait; beyond, the children of each are sorted among themselves alone, so that few more come to wait.
constexpr std::size_t kSorted = 64;

/// Hits so near to each other are one, on an edge.
constexpr double kSameHit = 1e-9;

}  // namespace

/// Walks along the hits of a ray in order: +1 for every solid entered (front), -1 for every one left (back); below
/// zero, the origin was inside.
class SolidTree::Walk {
 public:
  explicit Walk(std::vector<RayHit>& hits) : hits_(hits) { hits_.clear(); }

  /// They come nearly in order. Out of follow() nothing may be thrown: check() says that one was lost.
  /// Returns the work that it was.
  std::size_t add(const RayHit& hit) noexcept {
    const bool in_order = hits_.empty() || keyOf(hits_.back()) < keyOf(hit);
    const auto at = in_order ? hits_.end() : std::ranges::upper_bound(hits_, keyOf(hit), {}, keyOf);
    const auto behind = static_cast<std::size_t>(hits_.end() - at);
    try {
      if (waiting_.empty() && behind <= kMostMoved) {
        hits_.insert(at, hit);
        return behind / kMovedAtOnce;
      }
      if (waiting_.empty()) {
        waiting_.assign(hits_.begin() + static_cast<std::ptrdiff_t>(next_), hits_.end());
        hits_.erase(hits_.begin() + static_cast<std::ptrdiff_t>(next_), hits_.end());
        std::ranges::make_heap(waiting_, isLater);
      }
      waiting_.push_back(hit);
      std::ranges::push_heap(waiting_, isLater);
    } catch (const std::bad_alloc&) {
      is_short_ = true;
    }
    return kHeapWork;
  }
  /// Throws std::bad_alloc.
  void check() const {
    if (is_short_) throw std::bad_alloc();
  }

  /// Goes on to `end`, before which no more hits will come.
  [[nodiscard]] std::optional<double> leaveBefore(double end) noexcept {
    for (; hasNextBefore(end); ++next_) {
      const RayHit& hit = hits_[next_];
      // The edge between two triangles; two solids may begin in one plane.
      if (last_.front == hit.front && last_.tree == hit.tree && hit.t - last_.t < kSameHit) continue;
      last_ = hit;
      depth_ += hit.front ? 1 : -1;
      if (depth_ < 0) return hit.t;
    }
    return std::nullopt;
  }

 private:
  static std::tuple<double, bool, std::uint16_t, std::uint32_t> keyOf(const RayHit& of) {
    return {of.t, of.front, of.tree, of.triangle};
  }
  static bool isLater(const RayHit& a, const RayHit& b) { return keyOf(b) < keyOf(a); }

  /// Whether hits_[next_] is there, and before the end.
  [[nodiscard]] bool hasNextBefore(double end) noexcept {
    if (waiting_.empty() || next_ < hits_.size()) return next_ < hits_.size() && hits_[next_].t < end;
    if (!(waiting_.front().t < end)) return false;
    std::ranges::pop_heap(waiting_, isLater);
    try {
      hits_.push_back(waiting_.back());
    } catch (const std::bad_alloc&) {
      is_short_ = true;
    }
    waiting_.pop_back();
    return !is_short_;
  }

  std::vector<RayHit>& hits_;
  std::vector<RayHit> waiting_;  ///< a heap, the nearest first; then all before next_ are in hits_, and no others
  std::size_t next_ = 0;
  int depth_ = 0;
  bool is_short_ = false;
  RayHit last_{-1.0, 0, false};
};

struct SolidTree::Ray {
  glm::dvec3 origin, direction;
  double t_max;
};

SolidTree::SolidTree(const Bvh& tree)
    : tree_(&tree), nodes_(tree, [&](std::uint32_t first, std::uint32_t count) { return addBlock(first, count); }) {}

std::uint32_t SolidTree::addBlock(std::uint32_t first, std::uint32_t count) {
  Block block{};
  block.first = first;
  block.slack.fill(-1.0F);
  for (std::uint32_t k = 0; k < count; ++k) {
    block.set(k, tree_->triangles_[first + k], kEdge);
  }
  blocks_.push_back(block);
  return static_cast<std::uint32_t>(blocks_.size() - 1);
}

/// Moller and Trumbore 1997, without a division. As bits.
__attribute__((always_inline)) inline std::uint32_t SolidTree::mayMeet(const Block& block, const WideNodes::Ray& ray) {
  const auto& c = block.corner;
  const auto& a = block.edge1;
  const auto& b = block.edge2;
  const float dx = ray.direction[0], dy = ray.direction[1], dz = ray.direction[2];
  std::uint32_t bits[kWidth];
  for (std::size_t k = 0; k < kWidth; ++k) {
    const float px = dy * b[2][k] - dz * b[1][k], py = dz * b[0][k] - dx * b[2][k], pz = dx * b[1][k] - dy * b[0][k];
    const float determinant = a[0][k] * px + a[1][k] * py + a[2][k] * pz;
    const float sx = ray.origin[0] - c[0][k], sy = ray.origin[1] - c[1][k], sz = ray.origin[2] - c[2][k];
    const float qx = sy * a[2][k] - sz * a[1][k], qy = sz * a[0][k] - sx * a[2][k], qz = sx * a[1][k] - sy * a[0][k];
    const float way = determinant < 0.0F ? -1.0F : 1.0F;
    const float u = way * (sx * px + sy * py + sz * pz), v = way * (dx * qx + dy * qy + dz * qz);
    const float t = way * (b[0][k] * qx + b[1][k] * qy + b[2][k] * qz);
    const float slack = block.slack[k];
    const bool may = (u >= -slack) & (v >= -slack) & (u + v <= way * determinant + 2.0F * slack) & (t >= -slack);
    bits[k] = may ? 1U << k : 0U;
  }
  std::uint32_t mask = 0;
  for (std::size_t k = 0; k < kWidth; ++k) mask |= bits[k];
  return mask;
}

std::optional<double> SolidTree::endOfSolid(std::span<const SolidTree* const> trees, const glm::dvec3& origin,
                                            const glm::dvec3& direction, double t_max, std::vector<RayHit>& hits,
                                            std::uint64_t& work, std::uint64_t stop) {
  Walk walk(hits);
  const Ray ray{origin, direction, t_max};
  if (trees.size() <= kTreesAtOnce) {
    const auto end = follow(trees, 0, ray, true, walk, work, stop);
    walk.check();
    return end;
  }
  for (std::size_t first = 0; first < trees.size(); first += kTreesAtOnce) {
    const auto some = trees.subspan(first, std::min(trees.size() - first, kTreesAtOnce));
    (void)follow(some, static_cast<std::uint16_t>(first), ray, false, walk, work, stop);
  }
  const auto end = work < stop ? walk.leaveBefore(std::numeric_limits<double>::infinity()) : std::nullopt;
  walk.check();
  return end;
}

/// Nearer children first; what waits bounds from below what is still to come. `all`: no other trees follow, and where
/// the ray leaves the solid is the end. `first`: number of the first.
RADIOSITY_CLONES std::optional<double> SolidTree::follow(std::span<const SolidTree* const> trees, std::uint16_t first,
                                                         const Ray& from, bool all, Walk& walk, std::uint64_t& work,
                                                         std::uint64_t stop) noexcept {
  constexpr float kNever = std::numeric_limits<float>::infinity();
  const WideNodes::Ray ray{glm::vec3(from.origin), glm::vec3(from.direction)};
  const auto reach = static_cast<float>(from.t_max) * (1.0F + 1e-6F);
  struct Task {
    const SolidTree* tree;
    std::uint16_t number;  ///< of the tree
    std::uint32_t child;
    float entry, soonest;  ///< of it, and of all that wait below it as well
  };
  Task stack[WideNodes::kStackDepth + kTreesAtOnce];
  std::size_t depth = 0;
  for (const auto* tree : trees) {
    if (!tree->nodes_.empty()) stack[depth++] = {tree, first++, 0, 0.0F, 0.0F};
  }
  alignas(32) float entry[kWidth];
  while (depth > 0) {
    if (work >= stop) return std::nullopt;
    const auto* tree = stack[--depth].tree;
    const auto number = stack[depth].number;
    const auto child = stack[depth].child;
    work += kNodeWork;
    if ((child & WideNodes::kLeaf) == 0) {
      const auto& node = tree->nodes_[child];
      // Nearest first of all trees, or else all that a ray meets in one of them is found before the others are asked.
      const std::size_t base = depth < kSorted ? 0 : depth;
      for (std::uint32_t mask = WideNodes::meet(node, ray, reach, entry); mask != 0; mask &= mask - 1) {
        const auto k = static_cast<std::size_t>(std::countr_zero(mask));
        std::size_t at = depth++;
        for (; at > base && stack[at - 1].entry < entry[k]; --at) stack[at] = stack[at - 1];
        stack[at] = {tree, number, node.child[k], entry[k], entry[k]};
      }
      // All that waits is sorted as long as the base is the ground, and then the uppermost is the soonest.
      for (auto at = base; base > 0 && at < depth; ++at)
        stack[at].soonest = std::min(stack[at].entry, stack[at - 1].soonest);
      continue;
    }
    const Block& block = tree->blocks_[child & ~WideNodes::kLeaf];
    for (std::uint32_t mask = mayMeet(block, ray); mask != 0; mask &= mask - 1) {
      const auto i = block.first + static_cast<std::uint32_t>(std::countr_zero(mask));
      const Bvh& of = *tree->tree_;
      RayHit hit{0.0, of.order_[i], false, number};
      if (meetsTriangle(of.triangles_[i], from.origin, from.direction, hit) && hit.t > 0.0 && hit.t < from.t_max)
        work += walk.add(hit);
    }
    if (!all) continue;
    const float soonest = depth == 0 ? kNever : stack[depth - 1].soonest;
    if (const auto end = walk.leaveBefore(static_cast<double>(soonest))) return end;
  }
  return all ? walk.leaveBefore(static_cast<double>(kNever)) : std::nullopt;
}

}  // namespace radiosity::scene
