// Where walls meet the flat faces of a scene. Used by wall_cuts.cpp alone; lives for one build, on its thread.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <utility>
#include <vector>

#include "server/geometry/bvh.h"
#include "server/scene/charts/charts.h"
#include "server/scene/charts/facet_cutter.h"
#include "server/scene/charts/flatten.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// A facet's plane, with coordinates of its own: x axis, y axis and normal are right-handed.
struct FacetPlane {
  glm::dvec3 origin{0.0}, x{0.0}, y{0.0}, normal{0.0};

  FacetPlane(const FlatScene& flat, const Facets::Facet& facet);
  [[nodiscard]] glm::dvec2 project(const glm::dvec3& p) const {
    return {glm::dot(p - origin, x), glm::dot(p - origin, y)};
  }
  [[nodiscard]] double height(const glm::dvec3& p) const { return glm::dot(p - origin, normal); }
};

class WallFinder {
 public:
  /// Facets that are too small to be walls, or that one can see through, are none. Refers to its parts.
  WallFinder(const Scene& scene, const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
             const Facets& facets, const CutScale& scale);

  /// Where walls meet the facet, from in front, and from behind where one can see its back. Empty also where that would
  /// take too long to tell.
  [[nodiscard]] std::vector<WallSegment> wallsOn(std::uint32_t facet, const FacetPlane& plane);

  /// It would have, of some.
  [[nodiscard]] bool gaveUp() const { return gave_up_; }

 private:
  /// By facet of the wall and side of the face: what its triangles have in common with the plane.
  struct Meeting {
    std::vector<std::pair<glm::dvec2, glm::dvec2>> segments;
    double height = 0.0;
  };
  using Meetings = std::map<std::pair<std::uint32_t, bool>, Meeting>;

  void meet(std::uint32_t wall, const FacetPlane& plane, bool behind, Meetings& found) const;
  void findClosedParts(const std::vector<std::uint32_t>& neighbours);
  void addWalls(std::uint32_t facet, std::uint32_t on, const Meeting& meeting, const FacetPlane& plane,
                std::vector<WallSegment>& walls) const;
  [[nodiscard]] bool isDoubleSided(std::uint32_t triangle) const;
  [[nodiscard]] bool showsBack(std::uint32_t wall, std::uint32_t face) const;

  const Scene& scene_;
  const FlatScene& flat_;
  const Facets& facets_;
  CutScale scale_;
  double touch_;                          ///< what hovers no higher stands on the face
  std::vector<std::uint32_t> triangles_;  ///< of the tree: into FlatScene::triangles
  Bvh tree_;
  std::vector<std::uint32_t> closed_part_;  ///< by flat triangle: of triangles that have no border; kNone: they have
  std::size_t looked_at_ = 0;
  bool gave_up_ = false;
};

}  // namespace radiosity::scene
