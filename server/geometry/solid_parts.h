// The triangles that bound solids, parted so that a ray is held only against those of them that the place where it
// starts may lie in: what it enters of a closed solid (closed_solids.h) that it starts outside of it leaves again, and
// what is open at an end holds no place outside of its bounds. Neither has a cavity, or what does counts everywhere. In
// a furnished room that leaves a few triangles of thousands. Immutable once built, so any number of threads may ask.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/geometry/bounds.h"
#include "server/geometry/bvh.h"
#include "server/geometry/closed_parts.h"
#include "server/geometry/solid_tree.h"

namespace radiosity::scene {

class SolidParts {
 public:
  /// What places in a box may lie in.
  struct Around {
    std::vector<const SolidTree*> trees;
    bool in_hollow = false;   ///< something that is open: not all rays from within tell of it
    bool is_crowded = false;  ///< they are too many to be told of: `trees` are of all there is
  };

  SolidParts() = default;
  static constexpr std::uint32_t kClosed = 0, kHollow = 1;
  /// Each takes a kilobyte or two; further ones count for all places.
  static constexpr std::size_t kMostParts = 32'768;
  /// `part_of`: by triangle, twice the number of the part that it belongs to, and whether that is closed or hollow;
  /// kNone: of none, so that it counts for all places. O(n log n).
  SolidParts(std::span<const Bvh::Triangle> triangles, std::span<const std::uint32_t> part_of);

  /// Rays start above this plane, dot(normal, p) = height, and rise from it: what lies below they do not meet.
  struct Plane {
    glm::vec3 normal;
    float height;
  };
  /// So many parts are told of one by one.
  static constexpr std::size_t kMostAround = 48;
  /// Takes the place of what is in `around`. False: these are more than kMostAround parts, of which none is told.
  /// O(kMostAround + log n).
  [[nodiscard]] bool find(const Bounds& places, const std::optional<Plane>& plane, Around& around) const;

  /// Whether `holds` says so of a closed part that may hold the place: of one after the other, until it is true, or
  /// until `work`, which grows by what that takes, has come to `stop`, and then too. None: it is not, and there are
  /// others than these, which are open, or of no part. O(log n + parts looked at).
  [[nodiscard]] std::optional<bool> anyHolds(const glm::vec3& place, std::uint64_t& work, std::uint64_t stop,
                                             const std::function<bool(const SolidTree& part)>& holds) const;

 private:
  struct Part {
    Bvh tree;
    SolidTree ends;  ///< of the same
    bool is_hollow;
  };
  void add(std::vector<Bvh::Triangle> triangles, bool is_hollow);

  std::vector<std::unique_ptr<Part>> parts_;  ///< that of what counts for all places first, which may be empty
  Bvh boxes_;                                 ///< of the others, in their order: triangles that have these bounds
  ClosedParts closed_;                        ///< those that are, numbered as in parts_
};

}  // namespace radiosity::scene
