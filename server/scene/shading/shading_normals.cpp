#include "server/scene/shading/shading_normals.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

#include "common/task.h"
#include "server/geometry/normal_matrix.h"

namespace radiosity::scene {
namespace {

/// Cosine of what a normal of a flat face may be off by, as files round it: a twentieth of a degree, of which light at
/// 45 degrees changes by a thousandth.
constexpr double kSameNormal = 1.0 - 4e-7;
/// Shorter sums of normals have no direction to speak of.
constexpr double kNoDirection = 1e-6;

glm::dvec3 unitOr(const glm::dvec3& normal, const glm::dvec3& otherwise) {
  const double length = glm::length(normal);
  return length > kNoDirection && std::isfinite(length) ? normal / length : otherwise;
}

/// Normals of an instance in world space.
class InstanceNormals {
 public:
  InstanceNormals(const Primitive& primitive, const glm::dmat4& world, const PatchScene& patches)
      : primitive_(primitive),
        world_(world),
        patches_(patches),
        facing_(glm::determinant(glm::dmat3(world)) < 0.0 ? -1.0 : 1.0),
        to_world_(normalMatrix(world)) {}

  /// Of the corners of a triangle of the patch scene, on its front: it may be the back of the file's, and its corners
  /// run the other way round then, or where the instance is mirrored.
  [[nodiscard]] std::array<glm::dvec3, 3> of(std::uint32_t triangle, const glm::dvec3& geometric) const {
    const auto* index = &primitive_.indices[std::size_t{3} * patches_.triangle_source[triangle]];
    std::array<glm::dvec3, 3> position{}, corner{};
    for (std::size_t k = 0; k < 3; ++k)
      position[k] =
          (glm::dvec3(world_ * glm::dvec4(primitive_.positions[index[k]], 1.0)) - patches_.centre) / patches_.scale;
    const auto front = facing_ * glm::cross(position[1] - position[0], position[2] - position[0]);
    const double side = glm::dot(front, geometric) < 0.0 ? -1.0 : 1.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 at(patches_.vertices[patches_.indices[std::size_t{3} * triangle + k]].position);
      const auto apart = [&](const glm::dvec3& p) { return glm::distance(p, at); };
      const auto from = std::ranges::min_element(position, {}, apart) - position.begin();
      const glm::dvec3 normal(primitive_.normals[index[from]]);
      corner[k] = normal == glm::dvec3(0.0) ? geometric : unitOr(side * (to_world_ * normal), geometric);
    }
    return corner;
  }

 private:
  const Primitive& primitive_;
  const glm::dmat4& world_;
  const PatchScene& patches_;
  double facing_;
  glm::dmat3 to_world_;
};

}  // namespace

ShadingNormals::ShadingNormals(const Scene& scene, const PatchScene& patches) {
  for (const auto& surface : patches.surfaces) {
    interruptionPoint();
    const auto& instance = scene.instances[surface.instance];
    const auto& primitive = patches.cuts.primitiveOf(scene, surface.instance);
    if (primitive.normals.size() != primitive.positions.size()) continue;
    const InstanceNormals normals(primitive, instance.world, patches);
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
      const glm::dvec3 geometric(patches.triangles[t].normal);
      const auto corner = normals.of(t, geometric);
      const auto faces = [&](const glm::dvec3& normal) { return glm::dot(normal, geometric); };
      if (std::ranges::all_of(corner, [&](const auto& n) { return faces(n) >= kSameNormal; })) continue;
      if (std::ranges::all_of(corner, [&](const auto& n) { return faces(n) <= 0.0; })) continue;
      const auto texelOf = [&](std::uint32_t k) {
        return glm::dvec2(patches.vertices[patches.indices[std::size_t{3} * t + k]].texel);
      };
      const glm::dvec2 origin = texelOf(0), a = texelOf(1) - origin, b = texelOf(2) - origin;
      const double twice_area = a.x * b.y - a.y * b.x;
      if (!(std::abs(twice_area) > 1e-9)) continue;  // no texel can tell its corners apart
      const glm::dvec2 second = glm::dvec2(b.y, -b.x) / twice_area, third = glm::dvec2(-a.y, a.x) / twice_area;
      if (of_triangle_.empty()) of_triangle_.assign(patches.triangles.size(), kNone);
      of_triangle_[t] = static_cast<std::uint32_t>(corners_.size());
      corners_.push_back({glm::vec2(origin),
                          glm::vec2(second),
                          glm::vec2(third),
                          {glm::vec3(corner[0]), glm::vec3(corner[1]), glm::vec3(corner[2])}});
    }
  }
}

glm::dvec3 ShadingNormals::at(std::uint32_t triangle, const glm::vec2& texel, const glm::dvec3& geometric) const {
  if (!has(triangle)) return geometric;
  const auto& corners = corners_[of_triangle_[triangle]];
  const glm::vec2 way = texel - corners.origin;
  const float second = glm::dot(way, corners.second), third = glm::dot(way, corners.third);
  const glm::vec3 weight(std::max(0.0F, 1.0F - second - third), std::max(0.0F, second), std::max(0.0F, third));
  const auto normal =
      unitOr(glm::dvec3(weight.x * corners.normal[0] + weight.y * corners.normal[1] + weight.z * corners.normal[2]),
             geometric);
  return glm::dot(normal, geometric) > 0.0 ? normal : geometric;
}

}  // namespace radiosity::scene
