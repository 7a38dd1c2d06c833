// What rays meet among triangles: Embree (Wald et al. 2014) behind the few questions that solver and renderers ask.
// Single precision, in a scene about one unit wide. Triangles are grown by more than rounding moves their corners, so
// that no ray slips between two, also where a corner of one meets the middle of another's edge. Of triangles that
// coincide the one that shows its front is met, then the first: walls of no thickness are two, back to back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "common/result.h"

namespace radiosity::geometry {

using Triangle = std::array<glm::vec3, 3>;
inline constexpr std::uint32_t kNoTriangle = ~std::uint32_t{0};

/// Rays that are asked for together.
inline constexpr std::size_t kPacket = 8;

struct Ray {
  glm::vec3 origin{0.0F}, direction{0.0F};
  float reach = 0.0F;               ///< in units of the direction's length; what lies farther is not met
  std::uint32_t own = kNoTriangle;  ///< on which the ray starts, and which it does not meet
};

struct Hit {
  float t = 0.0F;                        ///< in units of the direction's length
  std::uint32_t triangle = kNoTriangle;  ///< as it was numbered; kNoTriangle: nothing is met
  bool front = false;                    ///< the ray meets the counter-clockwise side

  [[nodiscard]] bool found() const { return triangle != kNoTriangle; }
};

/// Ways of which it is asked whether they are open, from a millionth behind `origin` to origin + direction, structure
/// of arrays. None has no length.
struct alignas(32) Ways {
  using Lanes = std::array<float, kPacket>;
  std::array<Lanes, 3> origin, direction;
  std::array<std::uint64_t, kPacket> key;  ///< of the chance by which a way passes what one can see through
};

/// Whether light passes a place on a triangle that one can see through: by chance, from the way's key. `u`, `v`: of the
/// second and third corner, barycentric. `direction`: of the way, of whatever length. Called by many threads at once.
class SeeThrough {
 public:
  virtual ~SeeThrough() = default;
  [[nodiscard]] virtual bool passes(std::uint32_t triangle, float u, float v, const glm::vec3& direction,
                                    std::uint64_t key) const = 0;
};

/// Immutable once built, so any number of threads may ask. Copies share the tree.
class RayScene {
 public:
  RayScene() = default;  ///< nothing is met
  /// O(n log n), on the calling thread alone where `threads` is 1, on all cores where it is 0. `see_through`: by
  /// triangle, whether open() asks `passes`; both may be empty. kTooLarge: there is no memory for the tree.
  [[nodiscard]] static Result<RayScene> build(std::span<const Triangle> triangles, unsigned threads = 0,
                                              const std::vector<bool>& see_through = {},
                                              std::shared_ptr<const SeeThrough> passes = nullptr);

  /// The nearest; `passed`: triangles that are not met.
  [[nodiscard]] Hit nearest(const Ray& ray, std::span<const std::uint32_t> passed = {}) const;
  /// The same of kPacket rays at most, at about half the cost; best where they are near each other.
  void nearest(std::span<const Ray> rays, std::span<Hit> hits) const;
  /// Whether nothing is met, but what one can see through; `own` is met, too. Costs less than the nearest.
  [[nodiscard]] bool open(const Ray& ray) const;
  /// Which of the first `count` ways are open, as bits.
  [[nodiscard]] std::uint32_t open(const Ways& ways, std::size_t count = kPacket) const;

 private:
  struct Tree;
  explicit RayScene(std::shared_ptr<const Tree> tree) : tree_(std::move(tree)) {}

  std::shared_ptr<const Tree> tree_;
};

}  // namespace radiosity::geometry
