// Which pieces of a face that is cut along walls hang together, so that one texel grid may hold them: a step of
// FacetCutter. Pure functions of values.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <span>
#include <vector>

namespace radiosity::scene {

/// Lengths in the plane.
struct CutScale {
  double texel = 0.0;     ///< edge
  double least = 0.0;     ///< what is smaller is not worth a region of its own
  double rounding = 0.0;  ///< distances below it are none
};

/// What two pieces share, or one has on the border of the face.
struct PieceEdge {
  std::uint32_t from, to;              ///< points, the lesser first
  std::array<std::uint32_t, 2> piece;  ///< left and right of it; kNone: none
  double length;
  bool blocked = false;                          ///< a wall stands on it,
  bool parts = false;                            ///< which is long and high
  std::array<bool, 2> sees_front{false, false};  ///< left, right: of that wall
};

/// By edge: a wall on it may part regions. Of what stands on a face most does not, since there is nothing to be seen
/// beneath it.
[[nodiscard]] std::vector<bool> findPartingEdges(std::span<const PieceEdge> edges, std::span<const glm::dvec2> points,
                                                 const std::vector<double>& areas, const CutScale& scale);

struct FacetRegions {
  std::vector<std::uint32_t> of_piece;  ///< from 0
  std::vector<bool> hidden;             ///< by piece: its region lies under a thin wall, between others
};

/// Pieces with a wall between them are of one region only where light goes around that wall, where a
/// solid hides one of them, or where one is small. O(edges x pieces).
[[nodiscard]] FacetRegions findRegions(std::span<const PieceEdge> edges, std::span<const glm::dvec2> points,
                                       const std::vector<double>& areas, const CutScale& scale);

}  // namespace radiosity::scene
