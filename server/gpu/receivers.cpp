#include "server/gpu/receivers.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

namespace radiosity::gpu {
namespace {

/// A facet narrower than this many pixels may slip between them.
constexpr float kWidePixels = 3.0F;
/// Facets of more triangles than this are not intersected.
constexpr std::uint32_t kMaxFacetTriangles = 512;
/// Triangles are widened by this part of their size, so that a ray cannot pass between two that share an edge.
constexpr float kSeal = 1.0e-5F;

std::uint32_t rootOf(std::vector<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

}  // namespace

Receivers::Receivers(std::shared_ptr<const scene::PatchScene> patches) : patches_(std::move(patches)) {
  for (std::uint32_t s = 0; s < patches_->surfaces.size(); ++s) {
    const auto& surface = patches_->surfaces[s];
    for (std::size_t side = 0; side < 2; ++side) {
      const auto first = surface.first_node[side];
      if (first == scene::kNone) continue;
      const std::size_t begin = receivers_.size();
      for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
        const auto& leaf = patches_->leaves[surface.first_leaf + i];
        if (leaf.triangle == scene::kNone || patches_->node_area[first + i] <= 0.0F) continue;
        const auto texel = leaf.full ? glm::vec2(i % surface.width, i / surface.width) : leaf.texel;
        receivers_.push_back({first + i, leaf.triangle, texel, leaf.first_spot, leaf.full});
      }
      groups_.push_back({s, begin, receivers_.size() - begin, side == 0 ? 1.0F : -1.0F});
    }
  }
  for (std::size_t i = 0; i < patches_->triangles.size(); ++i) {
    const auto& normal = patches_->triangles[i].normal;
    planes_.push_back({normal, glm::dot(normal, patches_->vertices[patches_->indices[3 * i]].position)});
    const auto& surface = patches_->surfaces[patches_->triangle_surface[i]];
    absorbs_.push_back({surface.first_node[0] == scene::kNone, surface.first_node[1] == scene::kNone});
  }
  findFacets();
}

void Receivers::findFacets() {
  // Corners are shared only within a plane, so triangles with a common corner belong together.
  const auto triangles = static_cast<std::uint32_t>(patches_->triangles.size());
  std::vector<std::uint32_t> parent(triangles), owner(patches_->vertices.size(), scene::kNone);
  std::iota(parent.begin(), parent.end(), 0U);
  for (std::uint32_t i = 0; i < 3 * triangles; ++i) {
    auto& first = owner[patches_->indices[i]];
    if (first == scene::kNone) first = i / 3;
    parent[rootOf(parent, i / 3)] = rootOf(parent, first);
  }
  facet_of_.resize(triangles);
  facet_triangles_.resize(triangles);
  std::iota(facet_triangles_.begin(), facet_triangles_.end(), 0U);
  for (std::uint32_t t = 0; t < triangles; ++t) facet_of_[t] = rootOf(parent, t);
  std::stable_sort(facet_triangles_.begin(), facet_triangles_.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return facet_of_[a] < facet_of_[b]; });
  std::vector<std::uint32_t> number(triangles, scene::kNone);
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const auto triangle = facet_triangles_[i];
    auto& facet = number[facet_of_[triangle]];
    if (facet == scene::kNone) {
      facet = static_cast<std::uint32_t>(facets_.size());
      facets_.push_back({i, 0, 0.0F});
    }
    ++facets_[facet].count;
    facet_of_[triangle] = facet;
  }
  for (auto& facet : facets_) {
    float area = 0.0F;
    glm::vec3 low(1e30F), high(-1e30F);
    for (std::uint32_t i = facet.first; i < facet.first + facet.count; ++i) {
      std::array<glm::vec3, 3> c;
      for (std::size_t k = 0; k < 3; ++k) {
        c[k] = patches_->vertices[patches_->indices[3 * std::size_t{facet_triangles_[i]} + k]].position;
        low = glm::min(low, c[k]);
        high = glm::max(high, c[k]);
      }
      area += 0.5F * glm::length(glm::cross(c[1] - c[0], c[2] - c[0]));
    }
    facet.width = area / std::max(glm::length(high - low), 1e-12F);
  }
}

bool Receivers::behind(std::uint32_t item, const Ray& ray) const {
  const auto& plane = planes_[item];
  const float height = plane.height(ray.at);
  const float rise = glm::dot(plane.normal, ray.way) * ray.reach;  // from the receiver to the light
  const bool light_above = height + rise > 0.0F;
  return (light_above ? height : -height) < -kInPlane && risesBefore(item, ray.at, ray.normal);
}

bool Receivers::wide(std::uint32_t item, const Ray& ray) const {
  const auto& facet = facets_[facet_of_[item]];
  return facet.width > kWidePixels * ray.pixel_size && facet.count <= kMaxFacetTriangles;
}

/// Ray against the triangles of the item's facet (Moeller and Trumbore 1997).
Receivers::Meeting Receivers::meet(std::uint32_t item, const Ray& ray) const {
  const auto& facet = facets_[facet_of_[item]];
  for (std::uint32_t i = facet.first; i < facet.first + facet.count; ++i) {
    std::array<glm::vec3, 3> c;
    std::array<glm::vec2, 3> texel;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& vertex = patches_->vertices[patches_->indices[3 * std::size_t{facet_triangles_[i]} + k]];
      c[k] = vertex.position;
      texel[k] = vertex.texel;
    }
    const auto e1 = c[1] - c[0], e2 = c[2] - c[0], p = glm::cross(ray.way, e2);
    const float determinant = glm::dot(e1, p);
    if (determinant == 0.0F) continue;
    const auto s = ray.at - c[0];
    const float u = glm::dot(s, p) / determinant;
    const auto q = glm::cross(s, e1);
    const float v = glm::dot(ray.way, q) / determinant;
    if (u < -kSeal || v < -kSeal || u + v > 1.0F + kSeal) continue;
    return opacityAt(facet_triangles_[i], texel[0] + u * (texel[1] - texel[0]) + v * (texel[2] - texel[0]));
  }
  return Meeting::kNothing;
}

Receivers::Meeting Receivers::opacityAt(std::uint32_t triangle, const glm::vec2& texel) const {
  const auto& surface = patches_->surfaces[patches_->triangle_surface[triangle]];
  if (!surface.see_through) return Meeting::kSolid;
  const auto cell = [&](float place, std::uint32_t leaves) {
    const auto scaled = static_cast<std::uint32_t>(std::max(place, 0.0F) * static_cast<float>(surface.opacity_scale));
    return std::min(scaled, leaves * surface.opacity_scale - 1);
  };
  const auto row = std::size_t{cell(texel.y, surface.height)} * surface.width * surface.opacity_scale;
  const auto opacity = patches_->opacity[surface.first_opacity + row + cell(texel.x, surface.width)];
  return opacity == 0 ? Meeting::kNothing : opacity == 255 ? Meeting::kSolid : Meeting::kChance;
}

bool Receivers::hidesAtEdge(std::uint32_t item, const Ray& ray) const {
  return hides(item, ray) && (!wide(item, ray) || meet(item, ray) != Meeting::kNothing);
}

bool Receivers::anyMeets(std::span<const std::uint32_t> items, const Ray& ray) const {
  std::uint32_t last = scene::kNone;
  for (const auto item : items) {
    if (item == last || item == scene::kNone) continue;
    last = item;
    if (behind(item, ray) && wide(item, ray) && meet(item, ray) == Meeting::kSolid) return true;
  }
  return false;
}

Receivers::Place Receivers::place(const Receiver& receiver, const glm::vec2& at) const {
  const auto [texel, triangle] =
      receiver.full ? scene::LeafSpot{receiver.texel + at, receiver.triangle}
                    : patches_->spotAt({receiver.texel, receiver.triangle, false, receiver.first_spot}, 0, 0, at);
  const auto& frame = patches_->triangles[triangle];
  return {frame.origin + texel.x * frame.du + texel.y * frame.dv, &frame};
}

Receivers::Place Receivers::spot(const Receiver& receiver, std::uint32_t spot) const {
  const auto& [texel, triangle] = patches_->spots[receiver.first_spot + spot];
  const auto& frame = patches_->triangles[triangle];
  return {frame.origin + texel.x * frame.du + texel.y * frame.dv, &frame};
}

}  // namespace radiosity::gpu
