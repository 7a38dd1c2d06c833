// Instances flattened into one list of welded, non-degenerate triangles in the unit box. First step of buildPatchScene
// (charts.h); plain values, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "server/scene/values/scene.h"
#include "server/scene/values/wall_cuts.h"

namespace radiosity::scene {

/// A triangle in the unit box, counter-clockwise seen from its front (mirroring instances already undone).
struct FlatTriangle {
  std::array<std::uint32_t, 3> points;         ///< into FlatScene::points
  std::array<std::uint32_t, 3> source_corner;  ///< which corner of the source triangle each point was (0..2)
  std::uint32_t instance;
  std::uint32_t source;  ///< triangle of the instance's primitive
  glm::dvec3 normal;     ///< unit length
  double area;
  std::uint32_t region = 0;  ///< CutPrimitive::region
  bool hidden = false;       ///< CutPrimitive::hidden
  std::uint8_t walled = 0;   ///< by edge as a bit (edge e joins corners e and e + 1): no light goes on across it
};

struct FlatScene {
  glm::dvec3 centre{0.0};
  double scale = 1.0;              ///< unit = (world - centre) / scale
  std::vector<glm::dvec3> points;  ///< unit box; welded within an instance only
  std::vector<FlatTriangle> triangles;
  std::vector<std::uint32_t> first_triangle;  ///< by instance, one more than there are instances
  std::vector<double> tolerance;              ///< by instance: distances below it are rounding (unit box)
  std::uint64_t dropped = 0;                  ///< zero-area, non-finite and duplicate triangles
  std::vector<std::string> warnings;
};

/// unit = (world - centre) / scale.
struct UnitFrame {
  glm::dvec3 centre{0.0};
  double scale = 1.0;
  bool operator==(const UnitFrame&) const = default;
};

/// The scale is the largest extent itself, so scaling a scene by a power of two gives the same bits in the unit box.
/// With a former frame, that one as long as it suits.
[[nodiscard]] UnitFrame frameFor(const Scene& scene, const UnitFrame* former = nullptr);

/// Of the primitives as they are cut.
[[nodiscard]] FlatScene flatten(const Scene& scene, const UnitFrame& frame, const WallCuts& cuts = {});

/// By 3 x triangle + edge (edge e joins corners e and e + 1): the triangle of the same instance on the other side,
/// unless it is of another region, traversing the edge the opposite way; where several share an edge, the one that
/// bends least. kNone: border.
[[nodiscard]] std::vector<std::uint32_t> edgeNeighbours(const FlatScene& flat);

/// For each point a number that points within `tolerance` of each other share. O(n).
[[nodiscard]] std::vector<std::uint32_t> weldPoints(const std::vector<glm::dvec3>& points, double tolerance);

/// "/nodes/3 (/meshes/1/primitives/0)", for warnings.
[[nodiscard]] std::string describeInstance(const Scene& scene, std::uint32_t instance);

}  // namespace radiosity::scene
