// Which links an edit of geometry may have cut or opened: those to leaves that were changed themselves, and those that
// pass what was or is where something changed. Plain values; find() may be called by several threads, each with a
// Scratch of its own.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/scene/lineage.h"
#include "server/solver/link_column.h"
#include "server/solver/side.h"

namespace radiosity::solver {

/// What changed, in the numbers of the edited scene.
struct GeometryChange {
  std::vector<scene::ChangedBox> boxes;
  std::vector<bool> altered;  ///< by leaf value
};

class Shadows {
 public:
  Shadows(const scene::PatchScene& patches, const std::vector<Side>& sides, GeometryChange change);

  [[nodiscard]] const GeometryChange& change() const { return change_; }

  /// Whether a half space can see any of it.
  [[nodiscard]] bool sees(const glm::vec3& point, const glm::vec3& normal) const;

  struct Scratch {
    std::vector<std::uint8_t> marks;  // by leaf value; all zero between calls
  };
  /// Runs of leaf values, ascending, none across sides, of all leaves whose links from within `radius` of one of the
  /// points, as an item buffer of `resolution` finds them, may differ: those altered, and those that the way to passes
  /// a box, half a pixel's diagonal beside it included. A superset; leaves behind the plane of the points, and without
  /// area, may be missing unless they are altered. O(leaves found + sides).
  void find(std::span<const glm::vec3> points, const glm::vec3& normal, float radius, std::uint32_t resolution,
            Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const;

 private:
  struct Ball {
    glm::vec3 centre{0.0F};
    float radius = -1.0F;  ///< negative: empty
  };
  struct Way {
    glm::vec3 from, low, high;
  };
  struct Ways {
    std::vector<Way> each;
    glm::vec3 point, normal;
  };
  void enclose(const Side& side);
  void mark(std::uint32_t side, std::uint32_t level, std::uint32_t x, std::uint32_t y, const Ways& ways,
            std::vector<std::uint8_t>& marks, bool& any) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  GeometryChange change_;
  std::vector<scene::ChangedBox> all_;  ///< boxes, and one around all altered leaves
  std::vector<bool> side_altered_;      ///< some leaf of it
  std::vector<Ball> ball_;              ///< by node
};

}  // namespace radiosity::solver
