#include "server/gpu/receivers.h"

#include <glm/geometric.hpp>

namespace radiosity::gpu {

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
        receivers_.push_back({first + i, leaf.triangle, texel, leaf.full});
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
}

glm::vec3 Receivers::point(const Receiver& receiver, const glm::vec2& at) const {
  const auto& frame = patches_->triangles[receiver.triangle];
  const auto texel = receiver.full ? receiver.texel + at : receiver.texel;
  return frame.origin + texel.x * frame.du + texel.y * frame.dv;
}

bool Receivers::risesBefore(std::uint32_t triangle, const glm::vec3& point, const glm::vec3& normal) const {
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& corner = patches_->vertices[patches_->indices[3 * std::size_t{triangle} + k]].position;
    if (glm::dot(normal, corner - point) > kInPlane) return true;
  }
  return false;
}

}  // namespace radiosity::gpu
