// What single places of leaves see, by rays: for light that varies within a leaf, of which links know nothing, and for
// light that is gathered from wherever it comes. Plain values; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/geometry/bounds.h"
#include "server/geometry/ray_scene.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/math/sky_cells.h"
#include "server/solver/patches/side.h"

namespace radiosity::solver {

class LeafRays {
 public:
  /// Instead of leaf values: nothing that sends light, or a cell of the sky (SkyCells), the first of which is kSky.
  static constexpr std::uint32_t kNothing = scene::kNone, kSky = scene::kNone - SkyCells::kCount;
  [[nodiscard]] static bool isSky(std::uint32_t value) { return value >= kSky && value != kNothing; }
  [[nodiscard]] static bool isSkyAbove(std::uint32_t value) { return isSky(value) && SkyCells::isAbove(value - kSky); }

  /// A place on the lit side of a leaf; unit box.
  struct Place {
    glm::dvec3 position{0.0};
    glm::dvec3 normal{0.0};
    std::uint32_t value = kNothing;         ///< leaf value
    std::uint32_t triangle = scene::kNone;  ///< no ray of see() from there meets it: on which it lies, if known, or
                                            ///< one in the same plane and frame
  };

  /// O(n log n) in triangles, on all cores. Both are to outlive it. Throws std::bad_alloc.
  LeafRays(const scene::PatchScene& patches, const std::vector<Side>& sides);

  [[nodiscard]] std::uint32_t indexOfSide(std::uint32_t value) const { return side_of_value_[value]; }
  [[nodiscard]] const Side& sideOf(std::uint32_t value) const { return sides_[side_of_value_[value]]; }
  /// Unit box squared: what is covered and not buried.
  [[nodiscard]] double areaOf(std::uint32_t value) const;
  /// The same, whatever of the light passes there: places of placeOn() lie as densely as one over it.
  [[nodiscard]] double coveredAreaOf(std::uint32_t value) const;
  /// Its surface is flat, and all of its normals are the same to the bit.
  [[nodiscard]] bool isEven(std::uint32_t value) const { return is_even_[sideOf(value).surface]; }
  /// Edge of a leaf, unit box: of the whole texel.
  [[nodiscard]] double widthOf(std::uint32_t value) const;
  [[nodiscard]] double greatestWidth() const { return greatest_width_; }

  /// The place at (u, v) in [0, 1)^2, uniform over what is left of a leaf that has area.
  [[nodiscard]] Place placeOn(std::uint32_t value, const glm::dvec2& at) const;
  /// Where in its chart a place lies that knows its triangle.
  [[nodiscard]] glm::dvec2 texelOf(const Place& place) const;
  /// Coloured glass that a ray went through, and what is left of light, by channel, that went through it by chance.
  struct Panes {
    static constexpr std::size_t kMost = 16;
    glm::dvec3 tint{1.0};  ///< of all of it, as it is at the places
    std::array<std::uint32_t, kMost>
        which;  ///< by index into PatchScene::leaf_tints, in the order of the ray; the first
    std::size_t count = 0;
  };
  /// One can see through nothing.
  [[nodiscard]] bool isOpaque() const { return patches_.opacity.empty(); }
  [[nodiscard]] bool hasTints() const { return !patches_.tints.empty(); }
  [[nodiscard]] const glm::vec3& tint(std::uint32_t which) const { return patches_.leaf_tints[which]; }
  /// What lies that way within `reach` (unit box), in single precision; `value` is kNothing where nothing does, and
  /// where it is no leaf.
  struct Sight {
    Place end;
    double distance = 0.0;
  };
  [[nodiscard]] Sight look(const Place& from, const glm::dvec3& direction, double reach) const;
  /// look() without bounds; `value` may be one of the sky's.
  [[nodiscard]] Sight look(const Place& from, const glm::dvec3& direction) const;
  /// The leaf value that is seen that way, kNothing or one of the sky's. Where a leaf has no area of its own (buried
  /// right behind another, or so little of it that its neighbours took it) it is theirs. What one can see through stops
  /// the ray or not, by chance from `key`.
  /// `end`: where the ray ends, and on which leaf, be it that another's value is told; kNothing: on an unlit side, of
  /// `end.triangle`. As it was where it ends in the sky.
  /// `first`: what the ray meets, of meetFirst(); null: that is looked for. `panes`: what it goes through is added.
  [[nodiscard]] std::uint32_t see(const Place& from, const glm::dvec3& direction, std::uint64_t key, Place& end,
                                  const geometry::Hit* first = nullptr, Panes* panes = nullptr) const;
  /// Whether what see() told is the unlit back of a surface: inside solids rays meet nothing else.
  [[nodiscard]] bool isBack(std::uint32_t value, const Place& end, const glm::dvec3& direction) const {
    return value == kNothing && end.triangle != scene::kNone &&
           glm::dot(glm::dvec3(patches_.triangles[end.triangle].normal), direction) > 0.0;
  }
  /// What rays of see() meet first, geometry::kPacket of them at most: asked together they cost half.
  void meetFirst(std::span<const Place> from, std::span<const glm::dvec3> directions,
                 std::span<geometry::Hit> hits) const;
  /// Light may change within the leaf from one place to the next: something passes through it or right before it.
  [[nodiscard]] bool isCut(std::uint32_t value) const { return is_cut_[value]; }
  /// Who is seen where a leaf lies: itself, unless it has no area.
  [[nodiscard]] std::uint32_t standInOf(std::uint32_t value) const {
    return has_stand_in_[value] ? foundStandIn(value) : value;
  }
  /// Whether nothing lies between, but for what is nearer than a hundred-thousandth to `to`. `normal`: of the face on
  /// which that lies, which a way that grazes it must not meet before; zero: it lies on none.
  [[nodiscard]] bool isOpen(const Place& from, const glm::dvec3& to, const glm::dvec3& normal = glm::dvec3(0.0)) const;
  /// Part of the light that passes what lies on a way, of the channel that does best, and what of that the others do.
  struct Passage {
    double part = 0.0;
    glm::dvec3 tint{1.0};

    [[nodiscard]] glm::dvec3 light() const { return part * tint; }
  };
  /// isOpen() where one can see through what lies between. `normal` is none.
  [[nodiscard]] Passage passageTo(const Place& from, const glm::dvec3& to) const;
  /// What is seen of a surface at a point that lies on it.
  struct Arrival {
    Passage passage;  ///< of the light, that passes what lies before and is stopped there; 0: all is hidden
    Place end;        ///< `value`: who stands for the leaf there, or kNothing where the surface is unlit
  };
  [[nodiscard]] Arrival arriveAt(const Place& from, const glm::dvec3& at) const;
  /// Where ways from a place begin: a little before it.
  [[nodiscard]] static glm::vec3 startOf(const Place& place);
  /// Points of a light, structure of arrays: geometry::kPacket after geometry::kPacket of them.
  struct Points {
    std::vector<float> x, y, z;
  };
  /// By point, whether something hides it from where ways from a place begin: 1, or 0.
  void hide(const glm::vec3& from, const Points& points, std::int32_t* hidden) const;
  /// Where a ray of look() that ends on a leaf ends, without looking what lies before, to a few millionths. Nothing:
  /// the triangles of its surface have not all the same normal, or it is met at too flat an angle.
  [[nodiscard]] std::optional<Place> endOn(std::uint32_t value, const Place& from, const glm::dvec3& direction) const;

 private:
  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  void findStandIns();
  void findEven();
  [[nodiscard]] std::uint32_t foundStandIn(std::uint32_t value) const;
  [[nodiscard]] std::uint32_t neighbourOf(const Side& side, std::uint32_t leaf) const;
  [[nodiscard]] bool isBeneath(const Side& side, std::uint32_t value) const;
  bool uncover(geometry::Hit& hit, const glm::dvec3& origin, const glm::dvec3& direction,
               std::span<std::uint32_t> passed, std::size_t sheets) const;
  [[nodiscard]] bool passes(const geometry::Hit& hit, const glm::dvec3& at, const glm::dvec3& direction,
                            std::uint64_t key) const;
  [[nodiscard]] double stoppedPart(const geometry::Hit& hit, const glm::dvec3& at, const glm::dvec3& direction) const;
  void passThrough(const geometry::Hit& hit, const glm::dvec3& at, const glm::dvec3& direction, Passage& passage) const;
  void addPane(const geometry::Hit& hit, const glm::dvec3& at, Panes& panes) const;
  /// Number of the side that is lit where a ray meets it, or that stands for it; kNone: it is unlit.
  [[nodiscard]] std::uint32_t litSideOf(const geometry::Hit& hit) const;
  /// The leaf of a side that a texel lies on, or the nearest, by value.
  [[nodiscard]] static std::uint32_t leafAt(const Side& side, const glm::dvec2& texel);

  geometry::RayScene rays_;
  std::vector<std::array<std::uint32_t, 2>> side_of_;  ///< by surface
  std::vector<std::uint32_t> side_of_value_;
  std::vector<bool> has_stand_in_;  ///< by leaf value: it has no area
  /// Who stands for a leaf value that has no area: another, or kNothing. Ascending.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> stand_ins_;
  std::vector<bool> is_cut_;   ///< by leaf value
  std::vector<bool> is_even_;  ///< by surface: flat, and all normals are the same to the bit
  double greatest_width_ = 0.0;
};

/// Directions before a surface with probability proportional to the cosine, from (u, v) in [0, 1)^2.
[[nodiscard]] glm::dvec3 cosineDirection(const glm::dvec3& normal, double u, double v);

}  // namespace radiosity::solver
