#include "server/solver/patches/flat_nodes.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>

namespace radiosity::solver {
namespace {

using scene::kNone;

/// Some of the node lies in one triangle's frame, some in another's: in wide parts that are flat, or everywhere.
constexpr std::uint32_t kFolded = kNone - 1, kCurved = kNone - 2;
/// The same of all nodes above it, as on a sphere: that a leaf lies in one triangle is worth nothing there.
constexpr std::uint32_t kAllCurved = kNone - 3;
/// Parts of 2^this leaves are wide: as those facets that have charts of their own where no coordinates are given.
constexpr std::uint32_t kWideLevel = 3;

bool isFlat(std::uint32_t node) { return node < kAllCurved; }
/// Frames are one where the same texel lies so near in both: off the plane in units of the unit box (the rounding of
/// positions, so that no hemicube stands behind its own surface), in it in texels.
constexpr float kOffPlane = 5e-7F, kInTexels = 0.01F;

glm::vec3 placeOf(const scene::TriangleFrame& frame, const glm::vec2& texel) {
  return frame.origin + texel.x * frame.du + texel.y * frame.dv;
}

}  // namespace

FlatNodes::FlatNodes(const scene::PatchScene& patches) : patches_(patches), nodes_(patches.surfaces.size()) {
  for (std::size_t s = 0; s < nodes_.size(); ++s) {
    if (!patches_.surfaces[s].planar) fill(patches_.surfaces[s], nodes_[s]);
  }
}

std::uint32_t FlatNodes::at(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
  const auto& s = patches_.surfaces[surface];
  if (s.planar) return s.first_triangle;
  const auto grid = scene::levelGrid(s.width, s.height, level);
  return nodes_[surface][grid.offset + y * grid.width + x];
}

std::uint32_t FlatNodes::triangle(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
  const auto found = at(surface, level, x, y);
  return isFlat(found) ? found : kNone;
}

bool FlatNodes::isFolded(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
  return at(surface, level, x, y) == kFolded;
}

bool FlatNodes::inOneFrame(std::uint32_t a, std::uint32_t b, const glm::vec2& low, const glm::vec2& high) const {
  if (a == b) return true;
  const auto &one = patches_.triangles[a], &other = patches_.triangles[b];
  const float texel = glm::length(one.du) + glm::length(one.dv);
  const std::array<glm::vec2, 4> corners{low, {high.x, low.y}, high, {low.x, high.y}};
  return glm::dot(one.normal, other.normal) > 0.0F && std::ranges::all_of(corners, [&](const glm::vec2& corner) {
           const auto apart = placeOf(other, corner) - placeOf(one, corner);
           return std::abs(glm::dot(one.normal, apart)) <= kOffPlane && glm::length(apart) <= kInTexels * texel;
         });
}

std::uint32_t FlatNodes::ofLeaf(const scene::LeafPoint& leaf, const glm::vec2& corner) const {
  if (leaf.triangle == kNone || leaf.full) return leaf.triangle;
  const auto spots = leaf.hasSpots() && !patches_.spots.isInOneFrame(leaf.spot_list) ? patches_.spotCount(leaf) : 0;
  for (std::uint32_t k = 0; k < spots; ++k) {
    if (!inOneFrame(leaf.triangle, patches_.spot(leaf, k).triangle, corner, corner + 1.0F)) return kCurved;
  }
  return leaf.triangle;
}

void FlatNodes::fill(const scene::Surface& surface, std::vector<std::uint32_t>& nodes) const {
  const auto width = surface.width, height = surface.height;
  for (std::uint32_t i = 0; i < width * height; ++i)
    nodes.push_back(ofLeaf(patches_.leaves[surface.first_leaf + i], glm::vec2(i % width, i / width)));
  auto below = scene::levelGrid(width, height, 0);
  for (std::uint32_t level = 1; level < surface.level_count; ++level) {
    const auto grid = scene::levelGrid(width, height, level);
    nodes.resize(grid.offset + std::size_t{grid.width} * grid.height, kNone);
    for (std::uint32_t y = 0; y < below.height; ++y) {
      for (std::uint32_t x = 0; x < below.width; ++x) {
        const auto child = nodes[below.offset + y * below.width + x];
        auto& node = nodes[grid.offset + (y / 2) * grid.width + x / 2];
        const glm::vec2 low((x / 2) << level, (y / 2) << level), size(static_cast<float>(1U << level));
        if (child == kNone) continue;
        if (node == kNone) {
          node = child;
        } else if (!isFlat(node) || !isFlat(child) || !inOneFrame(node, child, low, low + size)) {
          const bool wide = level > kWideLevel && (isFlat(node) || isFlat(child));
          node = wide || node == kFolded || child == kFolded ? kFolded : kCurved;
        }
      }
    }
    below = grid;
  }
  findCurved(surface, nodes);
}

void FlatNodes::findCurved(const scene::Surface& surface, std::vector<std::uint32_t>& nodes) {
  if (nodes.back() == kCurved) nodes.back() = kAllCurved;
  for (auto level = surface.level_count - 1; level-- > 0;) {
    const auto grid = scene::levelGrid(surface.width, surface.height, level);
    const auto above = scene::levelGrid(surface.width, surface.height, level + 1);
    for (std::uint32_t y = 0; y < grid.height; ++y) {
      for (std::uint32_t x = 0; x < grid.width; ++x) {
        auto& node = nodes[grid.offset + y * grid.width + x];
        if (nodes[above.offset + (y / 2) * above.width + x / 2] == kAllCurved && node != kNone) node = kAllCurved;
      }
    }
  }
}

}  // namespace radiosity::solver
