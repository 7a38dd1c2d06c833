// Which points of a surface are no surface that light can reach: those inside another solid, and those under a face
// that lies in the same plane. Asks for all that a ray meets, not only the first. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "tests/oracle/ray_scene.h"
#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

/// Where a point of a surface lies. Models are open here and there, and from within an open one some rays get out.
/// Where few or most of them leave a solid the question has an answer, and so where several or none along the surface
/// see out. Between it depends on the rays that one asks: undecided.
enum class Where { kOutside, kUndecidedOutside, kUndecidedInside, kInside };
[[nodiscard]] constexpr bool isInside(Where where) { return where >= Where::kUndecidedInside; }
[[nodiscard]] constexpr bool isDecided(Where where) { return where == Where::kOutside || where == Where::kInside; }

class Burial {
 public:
  /// Keeps both. `scene` is made of `triangles`.
  Burial(const RayScene& scene, std::span<const Triangle> triangles);

  /// Whether the point (of the box) on a surface with that unit normal lies inside a solid. Solids are what opaque
  /// single-sided triangles bound: most rays from inside leave more of them than they enter. That does not suffice for
  /// a panel that hangs before a wall, whose back hides the wall from nearly everywhere: behind it one sees out along
  /// the wall, and inside a solid one does not. What lies on the surface, nearer than kOnSurface, leaves no gap.
  [[nodiscard]] Where whereIs(const glm::dvec3& point, const glm::dvec3& normal) const;

  /// One ray of the question: false where the point cannot be inside, at much less cost when asked at many points.
  [[nodiscard]] bool leavesSolid(const glm::dvec3& point, const glm::dvec3& direction) const;

  /// Whether a triangle lies in the plane of `triangle`, faces the same way and holds the point (of the box), and comes
  /// before it in the file, or is opaque where one can see through this one, or emits where this one does not: that one
  /// is lit.
  [[nodiscard]] bool underEarlier(const glm::dvec3& point, const glm::dvec3& normal, std::uint32_t triangle) const;

 private:
  struct Crossing {
    double distance = 0.0;
    std::uint32_t triangle = 0;
  };
  [[nodiscard]] std::vector<Crossing> crossings(const glm::dvec3& from, const glm::dvec3& way, double far) const;
  [[nodiscard]] std::vector<Crossing> solidCrossings(const glm::dvec3& from, const glm::dvec3& direction) const;
  [[nodiscard]] bool isSheet(const Crossing& crossing) const;
  [[nodiscard]] bool isFront(std::uint32_t triangle, const glm::dvec3& direction) const;
  [[nodiscard]] bool leavesMore(std::span<const Crossing> crossings, const glm::dvec3& direction) const;
  [[nodiscard]] Where vote(const glm::dvec3& point, const glm::dvec3& normal) const;
  [[nodiscard]] Where alongSurface(const glm::dvec3& point, const glm::dvec3& normal) const;

  const RayScene& scene_;
  std::span<const Triangle> triangles_;
};

}  // namespace radiosity::oracle
