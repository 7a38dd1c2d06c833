// Where the leaves of a scene receive light without extent: receiving points, planes, and which sides only absorb.
// Plain values made from a scene, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/scene/patch_scene.h"

namespace radiosity::gpu {

/// A receiver this far (unit box) behind a plane still counts as lying in it.
inline constexpr float kInPlane = 2.0e-6F;

class Receivers {
 public:
  /// A side of a leaf that can receive light.
  struct Receiver {
    std::uint32_t node, triangle;
    glm::vec2 texel;  ///< corner of the leaf when full, else the point itself
    bool full;
  };
  /// Receivers of one side of a surface; they lie together.
  struct Group {
    std::uint32_t surface;
    std::size_t first, count;
    float side;  ///< +1 front, -1 back
  };
  struct Plane {
    glm::vec3 normal{0.0F};
    float distance = 0.0F;

    [[nodiscard]] float height(const glm::vec3& point) const {
      return normal.x * point.x + normal.y * point.y + normal.z * point.z - distance;
    }
  };

  Receivers() = default;
  explicit Receivers(std::shared_ptr<const scene::PatchScene> patches);

  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }
  [[nodiscard]] const std::vector<Receiver>& all() const { return receivers_; }
  [[nodiscard]] const Plane& plane(std::uint32_t triangle) const { return planes_[triangle]; }
  /// Whether the side of the triangle that faces (or turns away from) a light only absorbs.
  [[nodiscard]] bool absorbs(std::uint32_t triangle, bool back) const {
    return absorbs_[triangle][static_cast<std::size_t>(back)];
  }
  /// Point of a receiver: `at` in [0, 1)^2 of a full leaf; others have one point.
  [[nodiscard]] glm::vec3 point(const Receiver& receiver, const glm::vec2& at) const;

  /// Whether the plane seen in the receiver's pixel hides the light: the receiver lies behind it (on the side that the
  /// light, `light_height` above the plane, does not see), and some of the triangle is above the receiver's horizon. No
  /// depth bias, hence no acne.
  [[nodiscard]] bool hides(std::uint32_t item, float light_height, const glm::vec3& at, const glm::vec3& normal) const {
    const float height = planes_[item].height(at);
    return (light_height > 0.0F ? height : -height) < -kInPlane && risesBefore(item, at, normal);
  }

 private:
  [[nodiscard]] bool risesBefore(std::uint32_t triangle, const glm::vec3& point, const glm::vec3& normal) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  std::vector<Receiver> receivers_;
  std::vector<Group> groups_;
  std::vector<Plane> planes_;                 ///< by triangle
  std::vector<std::array<bool, 2>> absorbs_;  ///< by triangle: front, back
};

}  // namespace radiosity::gpu
