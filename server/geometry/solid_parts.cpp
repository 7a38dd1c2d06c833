#include "server/geometry/solid_parts.h"

#include <utility>

#include "common/task.h"

namespace radiosity::scene {
namespace {

/// Boxes are larger by this (unit box): well above what rounding moves positions.
constexpr float kBoxMargin = 1e-5F;

}  // namespace

SolidParts::SolidParts(std::span<const Bvh::Triangle> triangles, std::span<const std::uint32_t> part_of) {
  std::vector<std::vector<Bvh::Triangle>> parts;
  std::vector<Bvh::Triangle> others;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const auto part = part_of[i];
    if (part >= 2 * kMostParts) {
      others.push_back(triangles[i]);
      continue;
    }
    if (part >= parts.size()) parts.resize(part + std::size_t{1});
    parts[part].push_back(triangles[i]);
  }
  add(std::move(others), false);
  std::vector<Bvh::Triangle> boxes;
  std::vector<ClosedParts::Part> closed;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    interruptionPoint();
    if (parts[p].empty()) continue;
    Bounds box;
    for (const auto& triangle : parts[p])
      for (const auto& corner : triangle) box.add(corner);
    boxes.push_back({box.min - kBoxMargin, box.max + kBoxMargin, box.max + kBoxMargin});
    if (p % 2 == kClosed) closed.emplace_back(static_cast<std::uint32_t>(parts_.size()), parts[p]);
    add(std::move(parts[p]), p % 2 == kHollow);
  }
  boxes_ = Bvh(std::move(boxes));
  closed_ = ClosedParts(closed);
}

void SolidParts::add(std::vector<Bvh::Triangle> triangles, bool is_hollow) {
  auto& part = parts_.emplace_back(std::make_unique<Part>());
  part->tree = Bvh(std::move(triangles));
  part->ends = SolidTree(part->tree);
  part->is_hollow = is_hollow;
}

bool SolidParts::find(const Bounds& places, const std::optional<Plane>& plane, Around& around) const {
  around.trees.clear();
  around.in_hollow = around.is_crowded = false;
  if (parts_.empty()) return true;
  const auto mayMeet = [&](const Part& part) {
    return plane ? part.tree.risesAbove(plane->normal, plane->height) : !part.tree.empty();
  };
  if (mayMeet(*parts_.front())) around.trees.push_back(&parts_.front()->ends);
  std::vector<std::uint32_t> near;
  if (!boxes_.collectNear(places.min, places.max, kMostAround, near)) return false;
  for (const auto k : near) {
    const Part& part = *parts_[std::size_t{k} + 1];
    if (!mayMeet(part)) continue;
    around.trees.push_back(&part.ends);
    around.in_hollow = around.in_hollow || part.is_hollow;
  }
  return true;
}

std::optional<bool> SolidParts::anyHolds(const glm::vec3& place, std::uint64_t& work, std::uint64_t stop,
                                         const std::function<bool(const SolidTree& part)>& holds) const {
  ClosedParts::Search search(closed_, place);
  for (auto some = search.next(work); !some.empty(); some = search.next(work))
    for (const auto part : some)
      if (work >= stop || holds(parts_[part]->ends)) return true;
  const bool has_others = !parts_.empty() && (!parts_.front()->tree.empty() || closed_.size() + 1 < parts_.size());
  return has_others ? std::nullopt : std::optional(false);
}

}  // namespace radiosity::scene
