// One flat face in its plane, cut along segments that walls stand on: convex pieces, and which of them hang together
// so that one texel grid may hold them. Plain values, any thread; used by wall_cuts.cpp alone.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <map>
#include <utility>
#include <vector>

#include "server/scene/charts/facet_regions.h"

namespace radiosity::scene {

/// Where a wall meets the face.
struct WallSegment {
  glm::dvec2 from{0.0}, to{0.0};
  glm::dvec2 front{0.0};    ///< across it: where the wall's front looks
  bool shows_back = false;  ///< one can see its back, too
  double height = 0.0;      ///< of the wall, above the face
};

class FacetCutter {
 public:
  using Triangle = std::array<glm::dvec2, 3>;  ///< counter-clockwise
  struct Piece {
    std::vector<glm::dvec2> outline;     ///< while it is cut; convex, counter-clockwise
    std::vector<std::uint32_t> corners;  ///< then: into points(), also those in the middle of an edge
    std::uint32_t triangle = 0;          ///< that it is a part of
    std::uint32_t region = 0;
    bool hidden = false;  ///< FacetRegions::hidden
  };

  FacetCutter(std::vector<Triangle> triangles, std::vector<WallSegment> walls, const CutScale& scale);

  /// Cuts, and finds the regions. False: it is one region, and best left whole.
  [[nodiscard]] bool cut();
  /// Points on the border where a neighbour is cut: corners of the pieces there, too. Keeps regions.
  void insert(const std::vector<glm::dvec2>& points);

  /// The longest, where there are too many.
  [[nodiscard]] std::size_t wallCount() const { return all_walls_.size(); }
  [[nodiscard]] const std::vector<Piece>& pieces() const { return pieces_; }
  [[nodiscard]] const std::vector<glm::dvec2>& points() const { return points_; }
  /// Whether a wall stands on the edge between two corners, or a solid, with another region behind.
  [[nodiscard]] bool isWalled(std::uint32_t from, std::uint32_t to) const;

 private:
  bool cutAlong(const std::vector<WallSegment>& walls);
  void splitBy(const WallSegment& wall);
  void numberPoints();
  void addToEdges();
  void findEdges();
  void look(PieceEdge& edge) const;
  void findRegions();
  [[nodiscard]] std::vector<WallSegment> wallsOn(const std::vector<bool>& edges) const;
  [[nodiscard]] std::vector<double> areas() const;
  [[nodiscard]] double areaOf(const Piece& piece) const;

  std::vector<Triangle> triangles_;
  std::vector<WallSegment> all_walls_, walls_;
  CutScale scale_;
  std::vector<Piece> pieces_;
  std::vector<glm::dvec2> points_;
  std::vector<PieceEdge> edges_;  ///< by their ends
  std::uint32_t regions_ = 0;
};

}  // namespace radiosity::scene
