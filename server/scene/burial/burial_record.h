// What was found out about buried leaves, and by which rays, so that after an edit only leaves are looked at again of
// which some ray passes where something was or is. Plain values; questions may be asked by several threads.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/geometry/bounds.h"
#include "server/scene/burial/burial_budget.h"
#include "server/scene/burial/coverage.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// Rays start this far from the surface (unit box): well above the rounding of 32-bit positions (6e-8), well below
/// anything modelled.
inline constexpr double kBurialLift = 2e-5;
/// They end well outside of the unit box, in units of their directions' lengths, which are about one.
inline constexpr double kBurialRayLength = 8.0;
/// Ways that rays go from a place of some normal: one that decides most, those into the hemisphere, spread by the
/// cosine, and those along the surface.
inline constexpr std::uint32_t kBurialWays = 25, kFirstWayAlong = 17;

/// Directions about a normal, by way. A few sines.
class BurialWays {
 public:
  explicit BurialWays(const glm::vec3& normal);
  [[nodiscard]] glm::dvec3 of(std::uint32_t way) const;

 private:
  glm::dvec3 n_, u_, v_;
};

/// Rays that were cast from places near each other, of one normal.
struct RayFan {
  Bounds origins;
  glm::vec3 normal{0.0F};
  std::uint32_t from = kNone;  ///< the triangle that they start from, of some list; kNone: the leaf's own
  std::uint32_t ways = 0;      ///< bits
  double reach = 0.0;          ///< what lies farther away decided nothing

  /// False: none of the rays comes near any of the boxes.
  [[nodiscard]] bool mayMeet(std::span<const ChangedBox> boxes) const;
};

/// Notes rays. Those that start from other triangles become fans of their own, and so do those that end early: from
/// within a solid it decides where they leave it, and nothing beyond.
class RayNotes {
 public:
  struct Ray {
    glm::dvec3 origin;
    glm::vec3 normal;
    std::uint32_t from, way;
    double reach;
  };
  void clear() { fans_.clear(); }
  void add(const Ray& ray);
  [[nodiscard]] const std::vector<RayFan>& fans() const { return fans_; }

 private:
  std::vector<RayFan> fans_;
};

/// A leaf that lost area on one side, and the visible point found on it.
struct BuriedPart {
  std::uint32_t leaf = kNone, side = 0;
  LeafPoint point;
  LeafPlaces visible;  ///< where it is
  float visible_area = 0.0F;
};

/// By leaf and side: what was measured.
class BurialRecord {
 public:
  /// As some of the places on a leaf tell, or all that are ever looked at.
  enum class Pass : std::uint8_t { kFew, kMany };
  /// Of a leaf. The record of an edited scene shares what it is still true of.
  struct Found {
    std::vector<RayFan> fans;
    std::optional<BuriedPart> buried;          ///< none: all of it is visible
    std::uint32_t first_leaf, first_triangle;  ///< of the surface, in the numbers of `buried`
    bool is_undecided = false;                 ///< of a place, which took too much work
  };
  struct Leaf {
    std::uint32_t leaf, side;
    Pass pass;
    std::shared_ptr<const Found> found;
  };

  BurialPlaces places;        ///< that were looked at
  std::vector<Hides> hides;   ///< by surface
  std::vector<bool> covered;  ///< by surface: an earlier one lies on it somewhere, which no ray tells
  std::vector<Leaf> leaves;   ///< by leaf, side and pass once sort() was called

  void sort();
  /// Null: it was not measured by rays.
  [[nodiscard]] const Leaf* find(std::uint32_t leaf, std::uint32_t side, Pass pass) const;
};

/// The scene before an edit, for burial: which of its surfaces are where they were.
class FormerBurial {
 public:
  /// `surface_before`: by surface of `after`, the one of `before` that is the same in all triangles, or kNone.
  /// `record`: of `before`, sorted. `hides`: by surface of `after`. Refers to the first three.
  FormerBurial(const PatchScene& before, const BurialRecord& record, const PatchScene& after,
               std::vector<std::uint32_t> surface_before, const std::vector<Hides>& hides);

  /// What was found of the leaf of `after`; null: it must be looked at again. `leaf` counts from the first of the
  /// surface. A few ray and box tests.
  [[nodiscard]] const BurialRecord::Leaf* find(std::uint32_t surface, std::uint32_t leaf, std::uint32_t side,
                                               BurialRecord::Pass pass, const BurialPlaces& places) const;
  /// What is buried of a leaf of that surface, in the numbers of `after`.
  [[nodiscard]] BuriedPart renumbered(const BurialRecord::Found& found, std::uint32_t surface) const;

 private:
  void findChanged(const std::vector<Hides>& hides);
  void addParts(const PatchScene& patches, const std::vector<bool>& changed);

  const PatchScene& before_;
  const BurialRecord& record_;
  const PatchScene& after_;
  std::vector<std::uint32_t> surface_before_;
  std::vector<ChangedBox> boxes_;   ///< where something opaque was or is that is not the same
  std::vector<ChangedBox> around_;  ///< one around all of these: most rays miss it
  std::vector<ChangedBox> parts_;   ///< as boxes_, each surface by itself; empty: too many
};

}  // namespace radiosity::scene
