// Which flat things lie together: in about one plane, facing the same way, where their bounds meet. Pure function, any
// thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace radiosity::scene {

/// A side of a planar surface.
struct FlatSide {
  glm::vec3 low, high;  ///< bounds
  glm::vec3 normal;     ///< unit length
  std::uint32_t surface;
};

/// Two sides of different surfaces lie together when their bounds are no farther apart than `margin` along any axis,
/// and the cosine of the angle between their normals is above `same_way`.
struct LieTogether {
  float margin, same_way;

  [[nodiscard]] bool operator()(const FlatSide& a, const FlatSide& b) const;
};

/// By side: whether another lies together with it. O(n log n) where sides that are near each other mostly lie together,
/// or mostly face other ways; all may be in one place.
[[nodiscard]] std::vector<bool> findCompany(std::span<const FlatSide> sides, const LieTogether& lie_together);

}  // namespace radiosity::scene
