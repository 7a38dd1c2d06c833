#include "server/geometry/covering_faces.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "server/geometry/triangle_hit.h"

namespace radiosity::scene {
namespace {

constexpr std::uint64_t kStepWork = 4;  ///< of a node or a triangle
constexpr float kRounding = 2e-6F;      ///< of positions (unit box), with room

}  // namespace

CoveringFaces::CoveringFaces(std::vector<Bvh::Triangle> triangles, std::span<const glm::vec3> normals,
                             std::vector<std::uint32_t> rank)
    : triangles_(std::move(triangles)), rank_(std::move(rank)) {
  std::vector<FacingTree::Item> items;
  items.reserve(triangles_.size());
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const auto& [a, b, c] = triangles_[t];
    items.push_back({glm::min(glm::min(a, b), c), glm::max(glm::max(a, b), c), normals[t]});
  }
  tree_ = FacingTree(items);
  const auto& nodes = tree_.nodes();
  least_.assign(nodes.size(), std::numeric_limits<std::uint32_t>::max());
  for (auto n = nodes.size(); n-- > 0;) {  // children follow
    if (nodes[n].child != 0) least_[n] = std::min(least_[nodes[n].child], least_[nodes[n].child + 1]);
    for (auto i = nodes[n].first; nodes[n].child == 0 && i < nodes[n].first + nodes[n].count; ++i)
      least_[n] = std::min(least_[n], rank_[tree_.order()[i]]);
  }
}

/// Least ranks first: of many triangles in one place it comes to the one that is seen.
std::optional<RayHit> CoveringFaces::find(const Question& question, const std::function<bool(const RayHit&)>& counts,
                                          std::uint64_t& work) const {
  const auto& nodes = tree_.nodes();
  const auto chord = FacingTree::chordOf(question.same_way);
  const auto margin = static_cast<float>(question.reach) + kRounding;
  const auto isLater = [&](std::uint32_t a, std::uint32_t b) { return least_[a] > least_[b]; };
  std::vector<std::uint32_t> waiting;
  std::uint32_t end = question.end, tests = 0;
  const auto wait = [&](std::uint32_t n) {
    work += kStepWork;
    const auto& reach = nodes[n].reach;
    if (least_[n] >= end || !reach.isNear(question.position, question.position, margin) ||
        !(reach.faces(question.facing, chord) || reach.faces(-question.facing, chord)))
      return;
    waiting.push_back(n);
    std::ranges::push_heap(waiting, isLater);
  };
  if (!nodes.empty()) wait(0);
  const glm::dvec3 way = -glm::dvec3(question.facing), origin = glm::dvec3(question.position) - question.reach * way;
  std::optional<RayHit> found;
  while (!waiting.empty() && tests < kMostTests) {
    std::ranges::pop_heap(waiting, isLater);
    const auto& node = nodes[waiting.back()];
    if (least_[waiting.back()] >= end) break;
    waiting.pop_back();
    if (node.child != 0) {
      wait(node.child);
      wait(node.child + 1);
      continue;
    }
    for (auto i = node.first; i < node.first + node.count; ++i) {
      const auto t = tree_.order()[i];
      if (rank_[t] >= end) continue;
      ++tests;
      work += kStepWork;
      RayHit hit{0.0, t, false};
      if (!meetsTriangle(triangles_[t], origin, way, hit) || !(hit.t > 0.0 && hit.t < 2.0 * question.reach)) continue;
      if (!counts(hit)) continue;
      found = hit;
      end = rank_[t];
    }
  }
  return found;
}

}  // namespace radiosity::scene
