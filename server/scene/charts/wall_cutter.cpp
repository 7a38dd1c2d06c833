#include "server/scene/charts/wall_cutter.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <tuple>
#include <utility>

#include "common/task.h"
#include "server/scene/charts/facet_cutter.h"
#include "server/scene/charts/flatten.h"
#include "server/scene/charts/wall_finder.h"
#include "server/scene/shading/opacity.h"
#include "server/scene/values/material_of.h"

namespace radiosity::scene {
namespace {

/// Metres: however large texels are, rooms are larger, and their walls higher.
constexpr double kLeastRoom = 0.5;
/// Of the least size: corners that are no farther apart are one.
constexpr double kRounding = 1e-4, kMostRounding = 2e-2;
/// Of the least size squared: a smaller face has no room for two regions.
constexpr double kLeastFace = 4.0;
/// Vertices of whole primitives that are there again, beside some parts of their cut copies.
constexpr std::size_t kMostCopied = 2'000'000;
/// Pieces times walls, about, of all faces: a second's.
constexpr std::size_t kMostWork = 30'000'000;
/// Of these, beside one for each of the scene's triangles.
constexpr std::size_t kMostMade = 100'000;

using Weights = std::array<double, 3>;

/// Where neighbours across an edge have corners that this triangle lacks: by the edge's points, the lesser first, how
/// far from it, as parts of its length.
using EdgePoints = std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<double>>;

struct CutFacet {
  const Facets::Facet& facet;
  FacetPlane plane;
  FacetCutter cutter;
};

/// One instance's primitive with some of its facets cut.
class InstanceCutter {
 public:
  InstanceCutter(const Scene& scene, const FlatScene& flat, std::uint32_t instance, double rounding)
      : flat_(flat),
        file_(scene.primitives[scene.instances[instance].primitive]),
        first_(flat.first_triangle[instance]),
        end_(flat.first_triangle[instance + 1]),
        rounding_(rounding) {}

  CutPrimitive run(std::vector<CutFacet>& facets) {
    for (auto& facet : facets) collectEdgePoints(facet);
    for (auto& facet : facets) insertEdgePoints(facet);
    out_.primitive = file_;
    out_.primitive.indices.clear();
    std::vector<bool> done(file_.indices.size() / 3, false);
    for (std::uint32_t f = 0; f < facets.size(); ++f) {
      for (const auto t : facets[f].facet.triangles) done[flat_.triangles[t].source] = true;
      for (const auto& piece : facets[f].cutter.pieces()) addPiece(facets[f], piece);
      first_region_ = next_region_;
    }
    for (auto t = first_; t < end_; ++t) {
      if (done[flat_.triangles[t].source]) continue;
      done[flat_.triangles[t].source] = true;
      addNeighbour(flat_.triangles[t]);
    }
    for (std::uint32_t source = 0; source < done.size(); ++source)  // such as have no area
      if (!done[source])
        addTriangle({vertexOf(source, 0), vertexOf(source, 1), vertexOf(source, 2)}, {source, 0, false}, 0);
    return std::move(out_);
  }

 private:
  /// What a triangle is a part of.
  struct Origin {
    std::uint32_t source, region;
    bool hidden;
  };
  [[nodiscard]] std::uint32_t vertexOf(std::uint32_t source, std::uint32_t corner) const {
    return file_.indices[std::size_t{3} * source + corner];
  }
  [[nodiscard]] FacetCutter::Triangle flatTriangle(const CutFacet& facet, std::uint32_t t) const {
    FacetCutter::Triangle at{};
    for (std::size_t k = 0; k < 3; ++k) at[k] = facet.plane.project(flat_.points[flat_.triangles[t].points[k]]);
    return at;
  }

  /// Of a place on a triangle; exact on its edges and at its corners.
  [[nodiscard]] Weights weightsAt(const FacetCutter::Triangle& triangle, const glm::dvec2& p) const {
    const auto cross = [](const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; };
    const double twice = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
    Weights weights{};
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto &a = triangle[(k + 1) % 3], &b = triangle[(k + 2) % 3];
      const double area = cross(b - a, p - a);
      weights[k] = std::abs(area) <= 2.0 * rounding_ * glm::distance(a, b) ? 0.0 : std::max(0.0, area / twice);
      sum += weights[k];
    }
    if (!(sum > 0.0)) {  // a sliver, all of which is near its edges
      const auto apart = [&](const glm::dvec2& corner) { return glm::distance(corner, p); };
      weights[static_cast<std::size_t>(std::ranges::min_element(triangle, {}, apart) - triangle.begin())] = sum = 1.0;
    }
    for (auto& weight : weights) weight /= sum;
    return weights;
  }

  [[nodiscard]] static std::pair<std::uint32_t, std::uint32_t> edgeOf(const FlatTriangle& triangle, std::size_t k) {
    return std::minmax(triangle.points[(k + 1) % 3], triangle.points[(k + 2) % 3]);
  }

  void collectEdgePoints(const CutFacet& facet) {
    for (const auto& piece : facet.cutter.pieces()) {
      const auto t = facet.facet.triangles[piece.triangle];
      const auto corners = flatTriangle(facet, t);
      for (const auto p : piece.corners) {
        const auto weights = weightsAt(corners, facet.cutter.points()[p]);
        if (std::ranges::count(weights, 0.0) != 1) continue;
        const auto k = static_cast<std::size_t>(std::ranges::find(weights, 0.0) - weights.begin());
        const auto edge = edgeOf(flat_.triangles[t], k);
        const bool ordered = flat_.triangles[t].points[(k + 1) % 3] == edge.first;
        edge_points_[edge].push_back(weights[(k + (ordered ? 2 : 1)) % 3]);
      }
    }
  }

  /// Of each edge of a flat triangle: sorted, without those that are the same but for rounding.
  [[nodiscard]] std::vector<glm::dvec3> pointsOn(const FlatTriangle& triangle, std::size_t k) const {
    const auto edge = edgeOf(triangle, k);
    const auto found = edge_points_.find(edge);
    if (found == edge_points_.end()) return {};
    auto places = found->second;
    std::ranges::sort(places);
    const auto &a = flat_.points[edge.first], &b = flat_.points[edge.second];
    std::vector<glm::dvec3> points;
    for (const auto at : places) {
      const auto p = a + at * (b - a);
      if (points.empty() || glm::distance(points.back(), p) > rounding_) points.push_back(p);
    }
    if (triangle.points[(k + 1) % 3] != edge.first) std::ranges::reverse(points);
    return points;
  }

  void insertEdgePoints(CutFacet& facet) {
    std::vector<glm::dvec2> points;
    for (const auto t : facet.facet.triangles)
      for (std::size_t k = 0; k < 3; ++k)
        for (const auto& p : pointsOn(flat_.triangles[t], k)) points.push_back(facet.plane.project(p));
    facet.cutter.insert(points);
  }

  /// Weights are of the triangle's corners as flattened, of which some are the file's own.
  std::uint32_t vertexAt(const FlatTriangle& triangle, const Weights& weights) {
    MadeVertex made{};
    for (std::uint32_t k = 0; k < 3; ++k) made.of[k] = vertexOf(triangle.source, triangle.source_corner[k]);
    made.weight = weights;
    const auto largest = static_cast<std::size_t>(std::ranges::max_element(weights) - weights.begin());
    if (weights[largest] == 1.0) return made.of[largest];
    if (const auto zero = std::ranges::find(weights, 0.0); zero != weights.end()) {  // the same from both sides
      const auto k = static_cast<std::size_t>(zero - weights.begin());
      auto a = (k + 1) % 3, b = (k + 2) % 3;
      if (made.of[a] > made.of[b]) std::swap(a, b);
      constexpr double kSteps = 0x1p40;
      const double at = std::round(weights[b] * kSteps) / kSteps;
      made = {{made.of[a], made.of[b], made.of[a]}, {1.0 - at, at, 0.0}};
    }
    const auto next = static_cast<std::uint32_t>(out_.primitive.positions.size());
    const auto [known, is_new] = known_.try_emplace(std::pair(made.of, made.weight), next);
    if (is_new) make(made);
    return known->second;
  }

  template <typename Vector>
  static void mix(std::vector<Vector>& values, const MadeVertex& made) {
    if (values.empty()) return;
    Vector sum(0.0F);
    for (std::size_t k = 0; k < 3; ++k)
      sum += values[made.of[k]] * static_cast<typename Vector::value_type>(made.weight[k]);
    values.push_back(sum);
  }

  void make(const MadeVertex& made) {
    out_.made.push_back(made);
    auto& primitive = out_.primitive;
    mix(primitive.positions, made);
    mix(primitive.texcoord0, made);
    mix(primitive.texcoord1, made);
    mix(primitive.color0, made);
    mix(primitive.normals, made);
    if (primitive.normals.empty()) return;
    auto& normal = primitive.normals.back();
    const float length = glm::length(normal);
    normal = length > 1e-6F ? normal / length : glm::vec3(0.0F);
  }

  void addPiece(const CutFacet& facet, const FacetCutter::Piece& piece) {
    const auto& triangle = flat_.triangles[facet.facet.triangles[piece.triangle]];
    const auto corners = flatTriangle(facet, facet.facet.triangles[piece.triangle]);
    std::vector<Weights> outline;
    std::vector<bool> walled;
    for (std::size_t k = 0; k < piece.corners.size(); ++k) {
      outline.push_back(weightsAt(corners, facet.cutter.points()[piece.corners[k]]));
      walled.push_back(facet.cutter.isWalled(piece.corners[k], piece.corners[(k + 1) % piece.corners.size()]));
    }
    const auto region = first_region_ + piece.region;
    next_region_ = std::max(next_region_, region + 1);
    addPolygon(triangle, outline, walled, {triangle.source, region, piece.hidden});
  }

  void addNeighbour(const FlatTriangle& triangle) {
    std::vector<Weights> outline;
    for (std::size_t k = 0; k < 3; ++k) {
      Weights corner{};
      corner[k] = 1.0;
      outline.push_back(corner);
      const auto &from = flat_.points[triangle.points[k]], &to = flat_.points[triangle.points[(k + 1) % 3]];
      for (const auto& p : pointsOn(triangle, (k + 2) % 3)) {
        const double at = glm::distance(from, p) / glm::distance(from, to);
        Weights weights{};
        weights[k] = 1.0 - at;
        weights[(k + 1) % 3] = at;
        outline.push_back(weights);
      }
    }
    addPolygon(triangle, outline, std::vector<bool>(outline.size(), false), {triangle.source, 0, false});
  }

  /// A fan: around the middle where corners lie on a line.
  void addPolygon(const FlatTriangle& triangle, const std::vector<Weights>& outline, const std::vector<bool>& walled,
                  const Origin& origin) {
    std::vector<std::uint32_t> corners;
    for (const auto& weights : outline) corners.push_back(vertexAt(triangle, weights));
    const bool mirrored = triangle.source_corner[1] != (triangle.source_corner[0] + 1) % 3;
    const auto add = [&](std::array<std::uint32_t, 3> of, std::array<bool, 3> walls) {
      if (mirrored) {  // edges 0, 1, 2 join 0-1, 1-2, 2-0: turned around, 0-2, 2-1, 1-0
        std::swap(of[1], of[2]);
        std::swap(walls[0], walls[2]);
      }
      addTriangle(of, origin, static_cast<std::uint8_t>((walls[0] ? 1 : 0) | (walls[1] ? 2 : 0) | (walls[2] ? 4 : 0)));
    };
    if (corners.size() == 3) {
      add({corners[0], corners[1], corners[2]}, {walled[0], walled[1], walled[2]});
      return;
    }
    Weights middle{};
    for (const auto& weights : outline)
      for (std::size_t k = 0; k < 3; ++k) middle[k] += weights[k] / static_cast<double>(outline.size());
    const auto centre = vertexAt(triangle, middle);
    for (std::size_t k = 0; k < corners.size(); ++k)
      add({centre, corners[k], corners[(k + 1) % corners.size()]}, {false, walled[k], false});
  }

  void addTriangle(const std::array<std::uint32_t, 3>& corners, const Origin& origin, std::uint8_t walled) {
    out_.primitive.indices.insert(out_.primitive.indices.end(), corners.begin(), corners.end());
    out_.source.push_back(origin.source);
    out_.region.push_back(origin.region);
    out_.hidden.push_back(origin.hidden);
    out_.walled.push_back(walled);
  }

  const FlatScene& flat_;
  const Primitive& file_;
  std::uint32_t first_, end_;
  double rounding_;
  EdgePoints edge_points_;
  std::map<std::pair<std::array<std::uint32_t, 3>, Weights>, std::uint32_t> known_;
  std::uint32_t first_region_ = 1, next_region_ = 1;  ///< 0: what is not cut
  CutPrimitive out_;
};

/// Lengths in the unit box.
CutScale cutScale(const FlatScene& flat, double texel) {
  const double least = std::min(texel, kLeastRoom / flat.scale);
  return {texel, least, kRounding * least};
}

/// Of an instance that is larger than its coordinates are exact.
CutScale scaleOn(const FlatScene& flat, std::uint32_t instance, CutScale scale) {
  scale.rounding = std::max(scale.rounding, 4.0 * flat.tolerance[instance]);
  return scale;
}

bool mayBeCut(const Scene& scene, std::uint32_t instance) {
  const auto& primitive = scene.primitives[scene.instances[instance].primitive];
  return !primitive.posed && !isSeeThrough(materialOf(scene, scene.instances[instance]));
}

}  // namespace

WallCuts cutAlongWalls(const Scene& scene, const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                       const Facets& facets, double texel, const std::vector<bool>& kept) {
  WallCuts cuts;
  const auto scale = cutScale(flat, texel);
  std::optional<WallFinder> finder;
  std::size_t work = 0, made = 0;
  bool is_too_much = false;
  std::map<std::uint32_t, std::vector<CutFacet>> cut;  // by instance
  for (std::uint32_t f = 0; f < facets.facets.size(); ++f) {
    interruptionPoint();
    const auto& facet = facets.facets[f];
    const auto instance = flat.triangles[facet.triangles.front()].instance;
    if (facet.area < kLeastFace * scale.least * scale.least || kept[instance] || !mayBeCut(scene, instance)) continue;
    const auto own = scaleOn(flat, instance, scale);
    if (own.rounding > kMostRounding * scale.least) continue;
    if (!finder) finder.emplace(scene, flat, neighbours, facets, scale);
    const FacetPlane plane(flat, facet);
    auto walls = finder->wallsOn(f, plane);
    if (walls.empty()) continue;
    std::vector<FacetCutter::Triangle> triangles;
    for (const auto t : facet.triangles) {
      triangles.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) triangles.back()[k] = plane.project(flat.points[flat.triangles[t].points[k]]);
    }
    FacetCutter cutter(std::move(triangles), std::move(walls), own);
    const bool is_cut = cutter.cut();
    work += 4 * cutter.wallCount() * cutter.pieces().size();
    made += is_cut ? cutter.pieces().size() : 0;
    if ((is_too_much = work > kMostWork || made > kMostMade + flat.triangles.size())) break;
    if (is_cut) cut[instance].push_back({facet, plane, std::move(cutter)});
  }
  std::size_t copied = 0;
  for (auto& [instance, parts] : cut) {
    copied += scene.primitives[scene.instances[instance].primitive].positions.size();
    if (copied > kMostCopied) {
      is_too_much = true;
      break;
    }
    cuts.add(instance, InstanceCutter(scene, flat, instance, scaleOn(flat, instance, scale).rounding).run(parts));
  }
  if (is_too_much || (finder && finder->gaveUp())) cuts.leaveRestWhole();
  return cuts;
}

}  // namespace radiosity::scene
