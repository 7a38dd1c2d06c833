// What can hide a place of a surface from everything: solids that it lies in, and surfaces that lie on it. Plain values
// made from a scene; questions may be asked by several threads, each with Hits of its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/bounds.h"
#include "server/scene/burial_record.h"
#include "server/scene/bvh.h"
#include "server/scene/patch_scene.h"

namespace radiosity::scene {

[[nodiscard]] inline glm::vec3 positionAt(const TriangleFrame& frame, const glm::dvec2& texel) {
  return glm::vec3(glm::dvec3(frame.origin) + texel.x * glm::dvec3(frame.du) + texel.y * glm::dvec3(frame.dv));
}

/// Of one thread's rays. `work`: boxes and triangles that they were held against, all together.
struct Hits : std::vector<RayHit> {
  std::uint64_t work = 0;
};

/// The triangles that bound solids, and the question whether a point lies inside one.
class Solids {
 public:
  /// `solid`: by surface.
  Solids(const PatchScene& patches, const std::vector<bool>& solid);

  [[nodiscard]] bool empty() const { return tree_.empty(); }

  /// True when a solid's surface, other than `surface` itself, passes through or touches the box.
  [[nodiscard]] bool near(const Bounds& box, std::uint32_t surface) const;

  /// Buried when most rays into the hemisphere leave more solids than they enter. One odd face that is turned the
  /// wrong way, or a room whose roof was modelled from outside, does not bury what can be seen from elsewhere. Nor does
  /// a panel that hangs before a wall, whose back hides the wall from nearly everywhere: one sees out along the wall.
  /// `agreed`: all rays that were asked said the same. They do unless a model is open, and then what holds for one
  /// place need not hold for another, though nothing lies between.
  struct Answer {
    bool buried = false, agreed = true;
  };
  /// `notes`: where they are not null, of the rays that decided.
  [[nodiscard]] Answer ask(const glm::vec3& position, const glm::vec3& normal, Hits& hits,
                           RayNotes* notes = nullptr) const;

  /// False: it buries no position in the box, of this normal. True: it may. Costs as much as one that is not buried.
  [[nodiscard]] bool mayBury(const Bounds& positions, const glm::vec3& normal) const;

 private:
  /// Of rays: a place and what faces it.
  struct Start {
    glm::dvec3 origin;
    glm::vec3 normal;
    std::uint32_t triangle;  ///< of the tree; kNone: the place that is asked for
  };
  [[nodiscard]] Answer vote(const Start& start, Hits& hits, RayNotes* notes) const;
  [[nodiscard]] bool seesOutAlong(const Start& start, Hits& hits, RayNotes* notes) const;
  [[nodiscard]] bool leavesSolid(const Start& start, std::uint32_t way, const glm::dvec3& direction, Hits& hits,
                                 RayNotes* notes) const;

  Bvh tree_;
  std::vector<std::uint32_t> surface_;  ///< by triangle of the tree
  std::vector<glm::vec3> normal_;       ///< likewise
};

/// Pairs of surfaces that lie on each other and face the same way: the earlier is seen, the later gets no light.
class Coincidence {
 public:
  explicit Coincidence(PatchScene& patches);

  /// Finds the pairs; adds a warning to the scene where there are some.
  void run();

  /// Fills PatchScene::covered, when areas are known.
  void keepCovered();

  /// Whether there are any.
  [[nodiscard]] bool found() const { return std::ranges::find(covered_, true) != covered_.end(); }

  /// By surface: somewhere.
  [[nodiscard]] const std::vector<bool>& covered() const { return covered_; }

  /// Whether the front of `s` may be covered in the box.
  [[nodiscard]] bool mayCover(std::uint32_t s, const Bounds& box) const;

  /// Whether the front of `s` is covered there. Only asked of surfaces that are covered somewhere.
  [[nodiscard]] bool covers(std::uint32_t s, const glm::vec3& position, const glm::vec3& normal) const {
    return covered_[s] && coveredAt(s, position, normal) != kNone;
  }

 private:
  [[nodiscard]] std::uint32_t coveredAt(std::uint32_t s, const glm::vec3& position, const glm::vec3& normal) const;
  [[nodiscard]] std::uint32_t triangleOver(std::uint32_t s, const glm::vec3& position, const glm::vec3& normal) const;
  [[nodiscard]] std::vector<bool> coplanarWithEarlier() const;
  [[nodiscard]] bool lieTogether(const Surface& a, const Surface& b) const;
  [[nodiscard]] std::uint32_t coveredBy(std::uint32_t s, bool closely) const;

  PatchScene& patches_;
  Bvh tree_;
  std::vector<std::uint32_t> least_;  ///< by node of the tree: the earliest surface there
  std::vector<bool> covered_;         ///< by surface: somewhere
};

}  // namespace radiosity::scene
