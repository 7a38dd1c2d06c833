#include "server/solver/patches/slivers.h"

#include <algorithm>
#include <cmath>
#include <compare>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <span>
#include <tuple>

namespace radiosity::solver {
namespace {

constexpr double kSliverPart = 0.25;
constexpr double kReach = 1.5;        // edges of a leaf
constexpr float kLeastReach = 1e-6F;  // unit box: nearer than this floats do not tell places apart
constexpr float kFacing = 0.5F;       // cosine between their normals
constexpr float kAside = 0.3F;        // out of the larger one's plane, of the reach

struct Leaf {
  std::tuple<int, int, int> cell;
  glm::vec3 at, normal;
  std::uint32_t value, side;
};

/// All leaves of one instance.
class Instance {
 public:
  Instance(const scene::PatchScene& patches, const std::vector<Side>& sides, std::span<const std::uint32_t> members);

  void find(std::vector<Sliver>& slivers) const;

 private:
  template <typename Visit>
  void visitLeaves(const Visit& visit) const;
  [[nodiscard]] double areaOf(const Side& side) const {
    return static_cast<double>(patches_.node_area[side.first_node + side.node_count - 1]);
  }
  [[nodiscard]] std::tuple<int, int, int> cellOf(const glm::vec3& at) const;
  [[nodiscard]] const Leaf* neighbourOf(const Leaf& sliver) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  std::span<const std::uint32_t> members_;
  double thin_ = 0.0;                   // unit box squared
  float reach_ = 0.0F;                  // unit box
  std::vector<Leaf> slivers_, others_;  // the others by cell
};

Instance::Instance(const scene::PatchScene& patches, const std::vector<Side>& sides,
                   std::span<const std::uint32_t> members)
    : patches_(patches), sides_(sides), members_(members) {
  double sum = 0.0, squares = 0.0, least = 1e30;
  visitLeaves([&](std::uint32_t, std::uint32_t, double area) {
    sum += area;
    squares += area * area;
    least = std::min(least, area);
  });
  if (!(sum > 0.0)) return;
  const double mean = squares / sum;
  thin_ = kSliverPart * mean;
  reach_ = static_cast<float>(kReach * std::sqrt(mean));
  if (least >= thin_ || reach_ < kLeastReach) return;
  visitLeaves([&](std::uint32_t s, std::uint32_t leaf, double area) {
    const auto& surface = patches_.surfaces[sides_[s].surface];
    const auto texel = static_cast<double>(surface.texel_area);
    const auto& place = patches_.leaves[surface.first_leaf + leaf];
    if (place.triangle == scene::kNone) return;
    const auto& frame = patches_.triangles[place.triangle];
    const glm::vec3 at = frame.origin + place.texel.x * frame.du + place.texel.y * frame.dv;
    const Leaf found{cellOf(at), at, sides_[s].side == 0 ? frame.normal : -frame.normal, sides_[s].first_value + leaf,
                     s};
    if (area >= thin_) {
      others_.push_back(found);
    } else if (area < kSliverPart * texel || areaOf(sides_[s]) < mean) {
      slivers_.push_back(found);  // and not of a finer chart beside a coarse one, which shows what it shows
    }
  });
  std::sort(others_.begin(), others_.end(),
            [](const Leaf& a, const Leaf& b) { return std::tie(a.cell, a.value) < std::tie(b.cell, b.value); });
}

template <typename Visit>
void Instance::visitLeaves(const Visit& visit) const {
  for (const auto s : members_) {
    for (std::uint32_t leaf = 0; leaf < sides_[s].leaf_count; ++leaf) {
      const auto area = static_cast<double>(patches_.node_area[sides_[s].first_node + leaf]);
      if (area > 0.0) visit(s, leaf, area);
    }
  }
}

std::tuple<int, int, int> Instance::cellOf(const glm::vec3& at) const {
  const glm::vec3 cell = glm::floor(at / reach_);
  return {static_cast<int>(cell.x), static_cast<int>(cell.y), static_cast<int>(cell.z)};
}

const Leaf* Instance::neighbourOf(const Leaf& sliver) const {
  const Leaf* nearest = nullptr;
  float best = reach_ * reach_;
  const auto [cx, cy, cz] = sliver.cell;
  for (int x = cx - 1; x <= cx + 1; ++x) {
    for (int y = cy - 1; y <= cy + 1; ++y) {
      // Cells along z lie together.
      auto leaf = std::lower_bound(others_.begin(), others_.end(), std::tuple(x, y, cz - 1),
                                   [](const Leaf& a, const auto& cell) { return a.cell < cell; });
      for (; leaf != others_.end() && leaf->cell <= std::tuple(x, y, cz + 1); ++leaf) {
        const glm::vec3 apart = leaf->at - sliver.at;
        const float distance = glm::dot(apart, apart);
        if (distance >= best || glm::dot(leaf->normal, sliver.normal) < kFacing) continue;
        if (std::abs(glm::dot(leaf->normal, apart)) > kAside * reach_) continue;  // the other face of a shelf, say
        best = distance;
        nearest = &*leaf;
      }
    }
  }
  return nearest;
}

void Instance::find(std::vector<Sliver>& slivers) const {
  for (const auto& sliver : slivers_) {
    if (const auto* leaf = neighbourOf(sliver)) slivers.push_back({leaf->value, leaf->side, sliver.value, sliver.side});
  }
}

}  // namespace

std::vector<Sliver> findSlivers(const scene::PatchScene& patches, const std::vector<Side>& sides) {
  std::map<std::uint32_t, std::vector<std::uint32_t>> instances;
  for (std::uint32_t s = 0; s < sides.size(); ++s) instances[patches.surfaces[sides[s].surface].instance].push_back(s);
  std::vector<Sliver> slivers;
  for (const auto& [instance, members] : instances) Instance(patches, sides, members).find(slivers);
  std::sort(slivers.begin(), slivers.end());
  return slivers;
}

}  // namespace radiosity::solver
