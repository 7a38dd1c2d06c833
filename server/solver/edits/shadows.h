// Which links an edit of geometry may have cut or opened: those to leaves that were changed themselves, and those that
// pass what was or is where something changed. Plain values; find() may be called by several threads, each with a
// Scratch of its own.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/math/near_edge.h"
#include "server/solver/patches/side.h"
#include "server/solver/transport/link_column.h"

namespace radiosity::solver {

/// What changed, in the numbers of the edited scene.
struct GeometryChange {
  std::vector<scene::ChangedBox> boxes;  ///< around what came and what is gone
  std::vector<scene::ChangedBox> came;   ///< around what came: all that can hide what could be seen
  std::vector<bool> altered;             ///< by leaf value
};

class Shadows {
 public:
  Shadows(const scene::PatchScene& patches, const std::vector<Side>& sides, GeometryChange change);

  [[nodiscard]] const GeometryChange& change() const { return change_; }
  /// Around all that changed, altered leaves too.
  [[nodiscard]] const std::vector<scene::ChangedBox>& all() const { return all_; }

  /// Whether something of it may be so near to a leaf, or to a place on it.
  [[nodiscard]] bool changesWithin(std::uint32_t value, float distance) const;
  /// Whether something of it may be on the way from a place to another.
  [[nodiscard]] bool changesAlong(const glm::vec3& from, const glm::vec3& to) const;
  /// Whether something of it lies before the plane of a flat leaf of this normal, so near to some place on it. Leaves
  /// that were altered and lie in that plane do not.
  [[nodiscard]] bool changesBefore(std::uint32_t value, const glm::vec3& normal, float distance) const;
  /// Whether ways within a ball may pass a box.
  [[nodiscard]] bool passesWithin(const glm::vec3& middle, float radius) const;
  /// Whether some way from a place on a leaf to one within `radius` of a point may pass a box. The second: to one on
  /// another leaf.
  [[nodiscard]] bool isPassed(std::uint32_t value, const glm::vec3& to, float radius) const;
  [[nodiscard]] bool isPassed(std::uint32_t value, std::uint32_t to) const;
  /// Whether the way from a place to another may pass a box.
  [[nodiscard]] bool isPassed(const glm::vec3& from, const glm::vec3& to) const;
  /// Of two leaves, whether anything that came may hide places of one from the other.
  [[nodiscard]] bool mayHide(std::uint32_t value, std::uint32_t to) const { return lookFrom(value).mayHide(to); }
  /// The same of one leaf and many others.
  class Look {
   public:
    [[nodiscard]] bool mayHide(std::uint32_t to) const;
    /// The same of one of which screen() does not say that it surely hides nothing.
    [[nodiscard]] bool mayHideScreened(std::uint32_t to) const;
    /// Of many leaves, those that it surely hides no places of: 0; mayHide() is to tell of the others.
    void screen(std::span<const std::int32_t> to, std::int32_t* may) const;

   private:
    friend class Shadows;
    const Shadows* shadows;
    glm::vec4 from;  ///< ball
    glm::vec4 past;  ///< a ball around all that came, with room for rounding, from there
  };
  [[nodiscard]] Look lookFrom(std::uint32_t value) const;
  /// Whether it may lie before where a ray from a place, in a unit direction, ends on a leaf.
  [[nodiscard]] bool mayHide(const glm::vec3& from, const glm::vec3& direction, std::uint32_t to) const;
  /// Whether a half space can see any of it.
  [[nodiscard]] bool sees(const glm::vec3& point, const glm::vec3& normal) const;

  class Scratch;
  /// Leaves that may look at some place of a shooter near to them, past a box: the next find() gives them, too.
  void markNear(const EdgeBall& edge, Scratch& scratch) const;
  /// Runs of leaf values, ascending, none across sides, of all leaves whose links from within `radius` of one of the
  /// points, as an item buffer of `resolution` finds them, may differ: those altered, and those that the way to passes
  /// a box, what the pixels show that decide on the leaf included. A superset; leaves behind the plane of the points,
  /// and without area, may be missing unless they are altered. O(tiles + leaves near those found).
  void find(std::span<const glm::vec3> points, const glm::vec3& normal, float radius, std::uint32_t resolution,
            Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const;

 private:
  /// Balls around leaves, or around some of them; a negative radius: nothing.
  struct Balls {
    std::vector<float> x, y, z, radius;
    std::vector<float> reach;  ///< of the pixels that decide, in half diagonals of one
    void clear();
    void add(const glm::vec3& centre, float r, float pixels = 1.0F);
    [[nodiscard]] glm::vec3 centre(std::size_t i) const { return {x[i], y[i], z[i]}; }
  };
  /// All ways from a point to what lies behind, in, or beside a box.
  struct Way {
    glm::vec3 from, low, high;
    float spread;  ///< the box counts as larger by so much for each unit of the way to it
    float wide;    ///< and is by this: so far apart ways begin, and there is none of it where they end
  };
  static void markMet(const Way& way, const glm::vec4& plane, const Balls& balls, std::size_t first, std::size_t end,
                      float* marks);
  /// Some boxes, and one around them.
  struct Boxes {
    std::span<const scene::ChangedBox> each;
    scene::ChangedBox all;
  };
  /// Whether some way between places within two balls (w: the radius) may pass a box. True where one is below zero and
  /// there are boxes: nothing is known of that leaf.
  [[nodiscard]] static bool isPassed(const Boxes& boxes, const glm::vec4& from, const glm::vec4& to);
  void takeTiles(Scratch& scratch) const;
  void markLeaves(std::size_t i, const glm::vec4& plane, Scratch& scratch) const;
  void addTiles(const Side& side);
  void addTile(const Side& side, std::uint32_t x0, std::uint32_t y0);
  void addLeaf(const Side& side, std::uint32_t leaf);
  [[nodiscard]] float reachOf(const scene::Surface& surface, const scene::LeafPoint& leaf) const;
  [[nodiscard]] scene::ChangedBox aroundAltered(const std::vector<Side>& sides) const;
  void takeRuns(Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const;

  const scene::PatchScene& patches_;
  GeometryChange change_;
  std::vector<scene::ChangedBox> all_;  ///< boxes, and one around all altered leaves
  scene::ChangedBox around_{};          ///< all boxes
  scene::ChangedBox around_came_{};     ///< those of what came
  glm::vec4 ball_of_came_{0.0F};        ///< around that, with room for rounding
  Balls leaves_;                        ///< tile after tile
  std::vector<std::uint32_t> value_;    ///< of these leaves
  std::vector<glm::vec4> ball_;         ///< by leaf value: the same, in one place; its radius is w
  /// Leaves of a square of a side.
  struct Tile {
    std::size_t first, count;  ///< into leaves_
    bool altered;              ///< some of them
  };
  std::vector<Tile> tiles_;
  Balls tile_balls_;
  std::vector<bool> starts_;  ///< by leaf value: the first of a side
};

/// What find() works with.
class Shadows::Scratch {
  friend class Shadows;
  std::vector<float> tiles, leaves;  ///< marks: negative where missed
  std::vector<std::uint32_t> near;   ///< tiles that may be met
  Balls near_balls;                  ///< around these
  std::vector<Way> ways;
  std::vector<float> by_way;         ///< marks of these tiles, way after way
  std::vector<std::uint64_t> found;  ///< one bit a leaf value; none between calls
};

}  // namespace radiosity::solver
