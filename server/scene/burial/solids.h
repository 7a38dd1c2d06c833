// What can hide a place of a surface from everything: solids that it lies in, and surfaces that lie on it. Plain values
// made from a scene; questions may be asked by several threads, each with Hits of its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "server/geometry/bounds.h"
#include "server/geometry/bvh.h"
#include "server/geometry/covering_faces.h"
#include "server/geometry/solid_parts.h"
#include "server/scene/burial/burial_record.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

[[nodiscard]] inline glm::vec3 positionAt(const TriangleFrame& frame, const glm::dvec2& texel) {
  return glm::vec3(glm::dvec3(frame.origin) + texel.x * glm::dvec3(frame.du) + texel.y * glm::dvec3(frame.dv));
}

/// Of one thread's rays. `work`: what they took, all together, in units of some 6 ns.
struct Hits : std::vector<RayHit> {
  std::uint64_t work = 0;
  /// Of one place: when it has taken so much, at `stop`, what most rays have said until then is the answer.
  std::uint64_t most_of_place = kMostWorkOfPlace, stop = ~std::uint64_t{0};
  bool gave_up = false;               ///< of some place, since somebody made it false
  SolidParts::Around around, beyond;  ///< room for where a place lies, and what a ray from there meets
};

/// The triangles that bound solids, and the question whether a point lies inside one. Sheets that are seen from both
/// sides bound none, but what lies beyond them does not count: a room of such walls within a house that is closed is no
/// inside of the house.
class Solids {
 public:
  /// `hides`: by surface.
  Solids(const PatchScene& patches, const std::vector<Hides>& hides);
  ~Solids();
  Solids(const Solids&) = delete;  // a part refers to another
  Solids& operator=(const Solids&) = delete;

  [[nodiscard]] bool empty() const { return tree_.empty(); }

  /// True when a solid's surface, other than `surface` itself, passes through or touches the box, or when so many looks
  /// (Bvh) do not tell.
  [[nodiscard]] bool near(const Bounds& box, std::uint32_t surface, std::size_t looks) const;

  /// Buried when most rays into the hemisphere leave more solids than they enter. One odd face that is turned the
  /// wrong way, or a room whose roof was modelled from outside, does not bury what can be seen from elsewhere. Nor does
  /// a panel that hangs before a wall, whose back hides the wall from nearly everywhere: one sees out along the wall.
  /// `agreed`: all rays that were asked said the same, and none ended on a sheet. They do unless a model is open, and
  /// then what holds for one place need not hold for another, though nothing lies between.
  struct Answer {
    bool buried = false, agreed = true;
  };
  /// `notes`: where they are not null, of the rays that decided. `around`: of a box that holds the position.
  [[nodiscard]] Answer ask(const glm::vec3& position, const glm::vec3& normal, const SolidParts::Around& around,
                           Hits& hits, RayNotes* notes = nullptr) const;
  [[nodiscard]] Answer ask(const glm::vec3& position, const glm::vec3& normal, Hits& hits) const;

  /// What positions in the box may lie in, of some normals, or of one and as far along it as this at least.
  struct Facing {
    glm::vec3 normal;
    float height;
  };
  void findAround(const Bounds& positions, const std::optional<Facing>& facing, SolidParts::Around& around) const;

  /// False: it buries no position in the box, of this normal. True: it may. Costs as much as one that is not buried.
  [[nodiscard]] bool mayBury(const Bounds& positions, const glm::vec3& normal, const SolidParts::Around& around) const;

 private:
  /// Of rays: a place and what faces it.
  struct Start {
    glm::dvec3 origin;
    glm::vec3 normal;
    std::uint32_t triangle;  ///< of the tree, and after those of the sheets; kNone: the place that is asked for
    const SolidParts::Around* around;
  };
  [[nodiscard]] std::optional<bool> liesInClosed(const Start& start, Hits& hits, RayNotes* notes) const;
  [[nodiscard]] Answer vote(const Start& start, Hits& hits, RayNotes* notes) const;
  [[nodiscard]] bool seesOutAlong(const Start& start, Hits& hits, RayNotes* notes) const;
  enum class Ray { kStays, kLeaves, kEndsOnSheet, kGivesUp };
  [[nodiscard]] Ray follow(const Start& start, std::uint32_t way, const glm::dvec3& direction, Hits& hits,
                           RayNotes* notes) const;
  [[nodiscard]] std::optional<Start> firstMet(const Start& start, const glm::dvec3& direction) const;

  Bvh tree_;
  SolidParts parts_;  ///< of the same
  /// All of it, for places in very many: what a ray enters of a solid that it starts outside of it leaves
  /// again, so that it only costs more. Made when it is first asked for.
  struct Whole;
  mutable std::unique_ptr<const Whole> whole_;
  mutable std::once_flag whole_made_;
  std::vector<std::uint32_t> surface_;  ///< by triangle of the tree
  std::vector<glm::vec3> normal_;       ///< likewise
  std::vector<Bvh::Triangle> corners_;  ///< likewise
  Bvh sheets_;
  std::vector<glm::vec3> sheet_normal_;
};

/// Sides of surfaces that lie on each other and face the same way: the earlier is seen, the later gets no light. What
/// one can see through comes after all that is opaque: a decal does not hide the wall. What emits comes before all: no
/// lamp is lost.
class Coincidence {
 public:
  explicit Coincidence(PatchScene& patches);

  /// Finds the pairs; adds a warning to the scene where there are some.
  void run();

  /// Fills PatchScene::covered, when areas are known.
  void keepCovered();

  /// Whether there are any.
  [[nodiscard]] bool found() const { return std::ranges::find(covered_, true) != covered_.end(); }

  /// By surface: a side of it is, somewhere.
  [[nodiscard]] std::vector<bool> covered() const;

  /// Whether a side of `s` may be covered in the box.
  [[nodiscard]] bool mayCover(std::uint32_t s, std::uint32_t side, const Bounds& box) const;

  /// Whether this side of a triangle is covered there.
  /// `work`: grows by what that took (Hits).
  [[nodiscard]] bool covers(std::uint32_t triangle, std::uint32_t side, const glm::vec3& position,
                            std::uint64_t& work) const {
    return covered_[slot(patches_.triangle_surface[triangle], side)] &&
           over(triangle, side, position, work).triangle != kNone;
  }

 private:
  static std::size_t slot(std::uint32_t s, std::uint32_t side) { return std::size_t{2} * s + side; }
  /// Which side of which triangle is seen.
  struct Over {
    std::uint32_t triangle = kNone, side = 0;
  };
  [[nodiscard]] Over over(std::uint32_t triangle, std::uint32_t side, const glm::vec3& position,
                          std::uint64_t& work) const;
  [[nodiscard]] glm::vec3 facing(std::uint32_t triangle, std::uint32_t side) const;
  [[nodiscard]] bool isLit(std::uint32_t s, std::uint32_t side) const {
    return patches_.surfaces[s].first_node[side] != kNone;
  }
  [[nodiscard]] std::vector<bool> coplanarWithOthers() const;
  /// A side of a planar surface.
  struct Plane {
    std::int64_t cell;  ///< of distance
    std::uint32_t surface, side;
  };
  [[nodiscard]] std::vector<Plane> planesByDistance(double shift) const;
  [[nodiscard]] std::uint32_t coveredBy(std::uint32_t s, std::uint32_t side, bool closely) const;
  void keepCovered(std::uint32_t s, std::uint32_t side);

  PatchScene& patches_;
  Bvh tree_;
  CoveringFaces faces_;              ///< of the same
  std::vector<std::uint32_t> rank_;  ///< by triangle: what is of less is seen
  std::vector<bool> covered_;        ///< by surface and side: somewhere
};

}  // namespace radiosity::scene
