// Which triangle is seen of those that lie in one place and face one way or the opposite one. Immutable once built, so
// any number of threads may ask.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/geometry/bvh.h"
#include "server/geometry/facing_tree.h"

namespace radiosity::scene {

class CoveringFaces {
 public:
  CoveringFaces() = default;
  /// `normals`: by triangle, unit length. `rank`: by triangle, each another: what is of less is seen. O(n log n).
  CoveringFaces(std::vector<Bvh::Triangle> triangles, std::span<const glm::vec3> normals,
                std::vector<std::uint32_t> rank);

  struct Question {
    glm::vec3 position, facing;
    float same_way;     ///< cosine of the angle to `facing`, or to its opposite, above which a triangle counts
    double reach;       ///< how far before or behind the position it may lie
    std::uint32_t end;  ///< only ranks below this
  };
  /// The triangle of least rank that lies there and that `counts`. However many lie there, it looks at few: those of
  /// lower rank whose bounds hold the place but which do not, kMostTests of them at most, after which none is found.
  /// `work`: grows by what that took, in units of 6 ns or so.
  [[nodiscard]] std::optional<RayHit> find(const Question& question, const std::function<bool(const RayHit&)>& counts,
                                           std::uint64_t& work) const;

 private:
  /// Slivers across one plane may all hold a place within their bounds.
  static constexpr std::uint32_t kMostTests = 2048;

  std::vector<Bvh::Triangle> triangles_;
  std::vector<std::uint32_t> rank_;
  FacingTree tree_;
  std::vector<std::uint32_t> least_;  ///< by node: rank
};

}  // namespace radiosity::scene
