// A small bounding volume hierarchy over triangles: which triangles does a ray meet, which touch a box. For burial
// while a scene is built (coverage.h), for light within leaves, and where an item buffer cannot tell what hides a place
// (gpu/gather/receivers.h); immutable once built, so any number of threads may ask.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

namespace radiosity::scene {

struct RayHit {
  double t;                ///< in units of the direction's length
  std::uint32_t triangle;  ///< index into the list the tree was built from
  bool front;              ///< the ray meets the counter-clockwise side
  std::uint16_t tree = 0;  ///< of several that were asked
};

class Bvh {
 public:
  using Triangle = std::array<glm::vec3, 3>;
  static constexpr std::size_t kAnyNumber = ~std::size_t{0};

  Bvh() = default;
  /// Binned surface area heuristic (Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"),
  /// O(n log n).
  explicit Bvh(std::vector<Triangle> triangles);

  /// All hits with t in (t_min, t_max), unsorted, appended to `hits`.
  void collectHits(const glm::dvec3& origin, const glm::dvec3& direction, double t_min, double t_max,
                   std::vector<RayHit>& hits) const;

  /// By node: the least tag of its triangles. `tags`: one for each triangle.
  [[nodiscard]] std::vector<std::uint32_t> leastTags(std::span<const std::uint32_t> tags) const;
  /// Of the hits with t in (t_min, t_max) that count, the one with the least tag below `end`; the first of those that
  /// collectHits() would find. `least`: leastTags(tags). However many lie there, it looks at few.
  [[nodiscard]] std::optional<RayHit> leastHit(const glm::dvec3& origin, const glm::dvec3& direction, double t_min,
                                               double t_max, std::span<const std::uint32_t> tags,
                                               std::span<const std::uint32_t> least, std::uint32_t end,
                                               const std::function<bool(const RayHit&)>& counts) const;

  /// False: no ray in this direction from anywhere in the box meets the back of a triangle (RayHit::front) with t in
  /// (0, t_max). True: one might.
  [[nodiscard]] bool mayMeetBack(const glm::vec3& box_min, const glm::vec3& box_max, const glm::dvec3& direction,
                                 double t_max) const;

  /// The hit with the least t in (t_min, t_max), or none.
  [[nodiscard]] std::optional<RayHit> nearestHit(const glm::dvec3& origin, const glm::dvec3& direction, double t_min,
                                                 double t_max) const;

  /// Whether there is one; costs less.
  [[nodiscard]] bool meets(const glm::dvec3& origin, const glm::dvec3& direction, double t_min, double t_max) const;

  /// True when a triangle other than those marked with `ignored_tag` touches the box. `tags`: one for each triangle.
  /// `looks`: at so many nodes and triangles; where these do not tell, one may touch it, and that is the answer.
  [[nodiscard]] bool touches(const glm::vec3& box_min, const glm::vec3& box_max, std::span<const std::uint32_t> tags,
                             std::uint32_t ignored_tag, std::size_t looks = kAnyNumber) const;

  struct OrientedBox {
    glm::vec3 centre{0.0F};
    std::array<glm::vec3, 3> axes{};  ///< unit, at right angles
    glm::vec3 half{0.0F};             ///< extent along each
  };
  /// The same for a box that is turned.
  [[nodiscard]] bool touches(const OrientedBox& box, std::span<const std::uint32_t> tags, std::uint32_t ignored_tag,
                             std::size_t looks = kAnyNumber) const;
  /// The same, of triangles alone that lie wholly above the lower face of the box along its third axis.
  [[nodiscard]] bool hoversIn(const OrientedBox& box, std::span<const std::uint32_t> tags, std::uint32_t ignored_tag,
                              std::size_t looks = kAnyNumber) const;

  /// False: no corner lies above the plane dot(normal, p) = height. True: one does, or that would take long to tell.
  [[nodiscard]] bool risesAbove(const glm::vec3& normal, float height) const;

  /// Whether a triangle lies wholly in the box.
  [[nodiscard]] bool holdsOne(const glm::vec3& box_min, const glm::vec3& box_max) const;

  /// Numbers of the triangles whose bounds reach into the box. False: they are more than `most`, of which some are
  /// told.
  [[nodiscard]] bool collectNear(const glm::vec3& box_min, const glm::vec3& box_max, std::size_t most,
                                 std::vector<std::uint32_t>& triangles) const;
  /// Whether `is_it` holds for one of the triangles whose bounds reach into the box; asks of no more from there on.
  [[nodiscard]] bool anyNear(const glm::vec3& box_min, const glm::vec3& box_max,
                             const std::function<bool(std::uint32_t triangle)>& is_it) const;

  [[nodiscard]] bool empty() const { return triangles_.empty(); }
  [[nodiscard]] std::size_t size() const { return triangles_.size(); }

 private:
  // Made of the same boxes and triangles:
  friend class ClosedParts;
  friend class SolidTree;
  friend class WideNodes;
  struct Node {
    glm::vec3 min, max;
    std::uint32_t first;  ///< leaf: into order_; inner: left child (the right one follows it)
    std::uint32_t count;  ///< 0: inner
  };
  template <bool kAny>
  [[nodiscard]] std::optional<RayHit> findHit(const glm::dvec3& origin, const glm::dvec3& direction, double t_min,
                                              double t_max) const;
  template <typename Test>
  [[nodiscard]] bool anyTriangle(const glm::vec3& box_min, const glm::vec3& box_max, Test test,
                                 std::size_t looks = kAnyNumber) const;
  template <typename Test>
  [[nodiscard]] bool anyTouching(const OrientedBox& box, Test test, std::size_t looks) const;
  void build();
  [[nodiscard]] std::uint32_t split(std::uint32_t first, std::uint32_t count);

  std::vector<Triangle> triangles_;   ///< leaf after leaf
  std::vector<glm::vec3> centres_;    ///< while building, when triangles_ is as it was given
  std::vector<std::uint32_t> order_;  ///< of each of triangles_: its index in the list that was given
  std::vector<Node> nodes_;
};

}  // namespace radiosity::scene
