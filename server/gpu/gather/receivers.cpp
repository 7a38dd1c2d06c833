#include "server/gpu/gather/receivers.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <span>

#include "common/union_find.h"

namespace radiosity::gpu {
namespace {

/// A facet narrower than this many pixels may slip between them.
constexpr float kWidePixels = 1.5F;
/// Facets of more triangles than this are not intersected.
constexpr std::uint32_t kMaxFacetTriangles = 512;
/// Of more triangles it is not asked whether they bound a convex room: each against all corners.
constexpr std::size_t kMostConvex = 256;
/// Of a facet with more corners a box around it stands for them.
constexpr std::size_t kMostCorners = 8;
/// Triangles are widened by this part of their size, so that a ray cannot pass between two that share an edge.
constexpr float kSeal = 1.0e-5F;

bool receives(const scene::LeafPoint& leaf, float area) { return leaf.triangle != scene::kNone && area > 0.0F; }

std::size_t countReceivers(const scene::PatchScene& patches) {
  std::size_t count = 0;
  for (const auto& surface : patches.surfaces) {
    for (const auto first : surface.first_node) {
      for (std::uint32_t i = 0; first != scene::kNone && i < surface.width * surface.height; ++i)
        count += receives(patches.leaves[surface.first_leaf + i], patches.node_area[first + i]) ? 1 : 0;
    }
  }
  return count;
}

}  // namespace

Receivers::Receivers(std::shared_ptr<const scene::PatchScene> patches)
    : patches_(std::move(patches)), rays_(std::make_unique<Rays>()) {
  has_glass_ = patches_->hasGlass();
  const auto count = countReceivers(*patches_);
  receivers_.reserve(count);
  for (auto* texels : {&texel_x_, &texel_y_}) texels->reserve(count);
  nodes_.reserve(count);
  for (std::uint32_t s = 0; s < patches_->surfaces.size(); ++s) {
    const auto& surface = patches_->surfaces[s];
    for (std::size_t side = 0; side < 2; ++side) {
      const auto first = surface.first_node[side];
      if (first == scene::kNone) continue;
      const std::size_t begin = receivers_.size();
      for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
        const auto& leaf = patches_->leaves[surface.first_leaf + i];
        if (!receives(leaf, patches_->node_area[first + i])) continue;
        const auto texel = leaf.full ? glm::vec2(i % surface.width, i / surface.width) : leaf.texel;
        receivers_.push_back({first + i, leaf.triangle, texel, leaf.spot_list, leaf.full});
      }
      groups_.push_back({s, begin, receivers_.size() - begin, side == 0 ? 1.0F : -1.0F, blocks_.size()});
      findBlocks(groups_.back());
    }
  }
  planes_.reserve(patches_->triangles.size());
  corners_.reserve(patches_->triangles.size());
  for (std::size_t i = 0; i < patches_->triangles.size(); ++i) {
    auto& corners = corners_.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) corners[k] = patches_->vertices[patches_->indices[3 * i + k]].position;
    const auto& normal = patches_->triangles[i].normal;
    planes_.push_back({normal, glm::dot(normal, corners[0])});
    const auto& surface = patches_->surfaces[patches_->triangle_surface[i]];
    absorbs_.push_back({surface.first_node[0] == scene::kNone, surface.first_node[1] == scene::kNone});
  }
  findFacets();
  is_convex_ = findConvex();
}

bool Receivers::findConvex() const {
  if (planes_.size() > kMostConvex) return false;
  return std::ranges::all_of(planes_, [this](const auto& plane) {
    return std::ranges::all_of(corners_, [&](const auto& corners) {
      return std::ranges::all_of(corners, [&](const glm::vec3& corner) { return plane.height(corner) >= -kInPlane; });
    });
  });
}

void Receivers::findBlocks(Group& group) {
  const bool planar = patches_->surfaces[group.surface].planar;
  const auto isPlain = [&](const Receiver& receiver) { return planar && receiver.full && !receiver.hasSpots(); };
  const auto sameFrame = [&](const Receiver& a, const Receiver& b) {
    const auto &one = patches_->triangles[a.triangle], &other = patches_->triangles[b.triangle];
    return one.origin == other.origin && one.du == other.du && one.dv == other.dv;
  };
  for (auto i = group.first; i < group.first + group.count; ++i) {
    const auto& receiver = receivers_[i];
    const bool plain = isPlain(receiver);
    const bool goes_on = i > group.first && blocks_.back().count < kBlock && blocks_.back().plain == plain &&
                         (!plain || sameFrame(receiver, receivers_[i - 1]));
    if (!goes_on) blocks_.push_back({i, 0, glm::vec3(1e30F), glm::vec3(-1e30F), plain});
    ++blocks_.back().count;
    texel_x_.push_back(receiver.texel.x);
    texel_y_.push_back(receiver.texel.y);
    nodes_.push_back(receiver.node);
  }
  for (auto block = group.first_block; block < blocks_.size(); ++block) setBounds(blocks_[block]);
}

/// Around the box of all texels, or those of each, where they are of one frame.
void Receivers::setBounds(Block& block) const {
  const auto hold = [&block](const glm::vec3& point) {
    block.low = glm::min(block.low, point);
    block.high = glm::max(block.high, point);
  };
  const auto holdBox = [&](const glm::vec2& low, const glm::vec2& high, std::uint32_t triangle) {
    for (const float x : {low.x, high.x})
      for (const float y : {low.y, high.y}) hold(placeOf({{x, y}, triangle}).point);
  };
  if (block.plain) {
    const auto first = static_cast<std::ptrdiff_t>(block.first), end = first + static_cast<std::ptrdiff_t>(block.count);
    const auto [left, right] = std::minmax_element(texel_x_.begin() + first, texel_x_.begin() + end);
    const auto [top, bottom] = std::minmax_element(texel_y_.begin() + first, texel_y_.begin() + end);
    return holdBox({*left, *top}, {*right + 1.0F, *bottom + 1.0F}, receivers_[block.first].triangle);
  }
  for (const auto& receiver : std::span(receivers_).subspan(block.first, block.count)) {
    if (receiver.full) {
      holdBox(receiver.texel, receiver.texel + 1.0F, receiver.triangle);
    } else if (!receiver.hasSpots()) {
      hold(placeOf({receiver.texel, receiver.triangle}).point);
    } else if (const auto of = spots(receiver); of.list.triangles == nullptr) {
      holdBox(of.list.lattice.low, of.list.lattice.low + of.list.lattice.size, receiver.triangle);
    } else {
      for (std::uint32_t k = 0; k < of.count; ++k) hold(of.at(k).point);
    }
  }
}

void Receivers::findFacets() {
  // Corners are shared only within a plane, so triangles with a common corner belong together.
  const auto triangles = static_cast<std::uint32_t>(patches_->triangles.size());
  UnionFind parts(triangles);
  std::vector<std::uint32_t> owner(patches_->vertices.size(), scene::kNone);
  for (std::uint32_t i = 0; i < 3 * triangles; ++i) {
    auto& first = owner[patches_->indices[i]];
    if (first == scene::kNone) first = i / 3;
    parts.join(i / 3, first);
  }
  facet_of_.resize(triangles);
  facet_triangles_.resize(triangles);
  std::iota(facet_triangles_.begin(), facet_triangles_.end(), 0U);
  for (std::uint32_t t = 0; t < triangles; ++t) facet_of_[t] = parts.find(t);
  std::stable_sort(facet_triangles_.begin(), facet_triangles_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return facet_of_[a] < facet_of_[b]; });
  std::vector<std::uint32_t> number(triangles, scene::kNone);
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const auto triangle = facet_triangles_[i];
    auto& facet = number[facet_of_[triangle]];
    if (facet == scene::kNone) {
      facet = static_cast<std::uint32_t>(facets_.size());
      facets_.push_back({.first = i});
    }
    ++facets_[facet].count;
    facet_of_[triangle] = facet;
  }
  for (auto& facet : facets_) measure(facet);
}

void Receivers::measure(Facet& facet) {
  float area = 0.0F;
  glm::vec3 low(1e30F), high(-1e30F);
  facet.first_corner = static_cast<std::uint32_t>(outlines_.size());
  for (std::uint32_t i = facet.first; i < facet.first + facet.count; ++i) {
    const auto& c = corners_[facet_triangles_[i]];
    for (const auto& corner : c) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
      const auto from = outlines_.begin() + static_cast<std::ptrdiff_t>(facet.first_corner);
      if (outlines_.size() - facet.first_corner <= kMostCorners &&
          std::find(from, outlines_.end(), corner) == outlines_.end())
        outlines_.push_back(corner);
    }
    area += 0.5F * glm::length(glm::cross(c[1] - c[0], c[2] - c[0]));
  }
  if (outlines_.size() - facet.first_corner > kMostCorners) {
    outlines_.resize(facet.first_corner);
    for (unsigned k = 0; k < 8; ++k)
      outlines_.emplace_back((k & 1U) != 0 ? high.x : low.x, (k & 2U) != 0 ? high.y : low.y,
                             (k & 4U) != 0 ? high.z : low.z);
  }
  facet.corner_count = static_cast<std::uint32_t>(outlines_.size()) - facet.first_corner;
  facet.width = area / std::max(glm::length(high - low), 1e-12F);
}

bool Receivers::wide(std::uint32_t item, const Ray& ray) const {
  const auto& facet = facets_[facet_of_[item]];
  return facet.width > kWidePixels * ray.pixel_size && facet.count <= kMaxFacetTriangles;
}

/// Ray against the triangles of the item's facet (Moeller and Trumbore 1997).
Receivers::Meeting Receivers::meet(std::uint32_t item, const Ray& ray) const {
  const auto& facet = facets_[facet_of_[item]];
  for (std::uint32_t i = facet.first; i < facet.first + facet.count; ++i) {
    const auto triangle = facet_triangles_[i];
    const auto& c = corners_[triangle];
    const auto e1 = c[1] - c[0], e2 = c[2] - c[0], p = glm::cross(ray.way, e2);
    const float determinant = glm::dot(e1, p);
    if (determinant == 0.0F) continue;
    const auto s = ray.at - c[0];
    const float u = glm::dot(s, p) / determinant;
    const auto q = glm::cross(s, e1);
    const float v = glm::dot(ray.way, q) / determinant;
    if (u < -kSeal || v < -kSeal || u + v > 1.0F + kSeal) continue;
    const auto texelOf = [&](std::size_t k) {
      return patches_->vertices[patches_->indices[3 * std::size_t{triangle} + k]].texel;
    };
    return opacityAt(triangle, texelOf(0) + u * (texelOf(1) - texelOf(0)) + v * (texelOf(2) - texelOf(0)));
  }
  return Meeting::kNothing;
}

bool Receivers::isMet(std::uint32_t item, const Ray& ray) const {
  return facets_[facet_of_[item]].count > kMaxFacetTriangles || meet(item, ray) != Meeting::kNothing;
}

Receivers::Meeting Receivers::opacityAt(std::uint32_t triangle, const glm::vec2& texel) const {
  const auto& surface = patches_->surfaces[patches_->triangle_surface[triangle]];
  if (!surface.see_through) return Meeting::kSolid;
  const auto opacity = patches_->opacityAt(surface, texel);
  return opacity == 0 && !surface.glass.isGlass() ? Meeting::kNothing
         : opacity == 255                         ? Meeting::kSolid
                                                  : Meeting::kChance;
}

bool Receivers::hidesAtEdge(std::uint32_t item, const Ray& ray) const {
  return hides(item, ray) && (!wide(item, ray) || meet(item, ray) != Meeting::kNothing);
}

std::optional<bool> Receivers::hiddenAmong(std::span<const std::uint32_t> items, const Ray& ray) const {
  bool met = false;
  std::array<std::uint32_t, 9> asked{};
  std::size_t count = 0;
  for (const auto item : items) {
    // Each is asked once: nine pixels show two or three items.
    const auto end = asked.begin() + static_cast<std::ptrdiff_t>(count);
    if (item == scene::kNone || std::find(asked.begin(), end, item) != end) continue;
    if (count < asked.size()) asked[count++] = item;
    if (!behind(item, ray) || !liesBefore(item, ray)) continue;
    if (!wide(item, ray)) return std::nullopt;
    const auto meeting = met ? Meeting::kSolid : meet(item, ray);
    if (meeting == Meeting::kChance) return std::nullopt;
    met = meeting == Meeting::kSolid;
  }
  return met;
}

bool Receivers::anyMeets(std::span<const std::uint32_t> items, const Ray& ray) const {
  auto last = scene::kNone;
  for (const auto item : items) {
    if (item == scene::kNone || item == last) continue;
    last = item;
    if (behind(item, ray) && wide(item, ray) && meet(item, ray) == Meeting::kSolid) return true;
  }
  return false;
}

}  // namespace radiosity::gpu
