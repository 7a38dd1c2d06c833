// Shots of unit radiosity from the nodes of quadtrees and from light polygons. Pure functions of the seed, the node and
// the number of the sample: whoever asks again gets the same shot. One thread.
#pragma once

#include <cstdint>

#include "server/solver/patches/flat_nodes.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/outlines.h"
#include "server/solver/patches/side.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// Points of one sample of a node at most.
inline constexpr std::uint32_t kMostNodePoints = 4;

/// A place on a surface as the standing point of a hemicube; `rotation` in [0, 1).
[[nodiscard]] HemicubeFrame hemicubeAt(const glm::vec3& origin, const glm::vec3& normal, double rotation,
                                       std::uint64_t key);

class NodeShots {
 public:
  NodeShots(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed)
      : patches_(patches), sides_(sides), outlines_(patches), flat_(patches), seed_(seed) {}

  /// Nodes that lie in one plane shoot as polygons, gathered; others from one point, scattered.
  [[nodiscard]] bool gathers(const NodePlace& node) const {
    return !patches_.surfaces[sides_[node.side].surface].see_through && flatTriangle(node) != scene::kNone;
  }
  /// Wide parts of the node lie in one plane each, but not all of it.
  [[nodiscard]] bool isFolded(const NodePlace& node) const {
    return flat_.isFolded(sides_[node.side].surface, node.level, node.x, node.y);
  }
  /// All of the node's polygon is covered and not buried.
  [[nodiscard]] bool isWhole(const NodePlace& node) const;
  [[nodiscard]] std::uint64_t key(const NodePlace& node) const;

  /// Points of a node's sample: one where it is scattered or is the first, then as many as all before it, up to
  /// kMostNodePoints. From one point of a node that is near and wide, and partly hidden, visibility is the part of its
  /// area that is seen, in the mean, and not that of its form factor: only the ratio of sums over several points tells.
  [[nodiscard]] std::uint32_t pointsOf(const NodePlace& node, std::uint32_t index) const;

  /// Appends sample `index` of `half`; a gather or a scatter shot.
  void add(const NodePlace& node, std::size_t half, std::uint32_t index, std::uint32_t resolution,
           ShotBatch& batch) const;
  /// The same of a light, from `points` points.
  void add(const LightPolygon& light, std::size_t half, std::uint32_t index, std::uint32_t points,
           std::uint32_t resolution, ShotBatch& batch) const;

 private:
  void addGather(const NodePlace& node, std::size_t half, std::uint32_t index, std::uint32_t resolution,
                 ShotBatch& batch) const;
  void addScatter(const NodePlace& node, std::size_t half, std::uint32_t index, std::uint32_t resolution,
                  ShotBatch& batch) const;
  [[nodiscard]] std::uint32_t flatTriangle(const NodePlace& node) const {
    return flat_.triangle(sides_[node.side].surface, node.level, node.x, node.y);
  }
  [[nodiscard]] double areaOf(const NodePlace& node, const TexelPolygon& polygon) const;
  [[nodiscard]] std::uint32_t leafByArea(const NodePlace& node, double& u, double& v) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  Outlines outlines_;
  FlatNodes flat_;
  std::uint64_t seed_;
};

}  // namespace radiosity::solver
