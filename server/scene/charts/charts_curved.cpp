#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <queue>

#include "common/task.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {
namespace {

constexpr double kSmallAngleDeg = 45.0;

/// Facet adjacency as offsets into one list; each neighbour once or more.
struct FacetGraph {
  std::vector<std::uint32_t> first, neighbour;
};

FacetGraph facetGraph(const std::vector<std::uint32_t>& neighbours, const Facets& facets) {
  FacetGraph graph;
  for (std::uint32_t f = 0; f < facets.facets.size(); ++f) {
    interruptionPoint();
    graph.first.push_back(static_cast<std::uint32_t>(graph.neighbour.size()));
    for (const std::uint32_t t : facets.facets[f].triangles)
      for (std::size_t e = 0; e < 3; ++e) {
        const std::uint32_t other = neighbours[std::size_t{3} * t + e];
        if (other == kNone || facets.of_triangle[other] == kNone || facets.of_triangle[other] == f) continue;
        graph.neighbour.push_back(facets.of_triangle[other]);
      }
  }
  graph.first.push_back(static_cast<std::uint32_t>(graph.neighbour.size()));
  return graph;
}

class Grower {
 public:
  Grower(const Facets& facets, const FacetGraph& graph, std::vector<bool>& taken, double small_area, double angle_deg)
      : facets_(facets),
        graph_(graph),
        taken_(taken),
        small_area_(small_area),
        cos_limit_(std::cos(angle_deg * M_PI / 180.0)),
        cos_small_(std::cos(std::max(angle_deg, kSmallAngleDeg) * M_PI / 180.0)) {}

  std::vector<std::uint32_t> grow(std::uint32_t seed) {
    group_.clear();
    sum_ = glm::dvec3(0.0);
    area_ = 0.0;
    queue_ = {};
    add(seed);
    while (!queue_.empty()) {
      const Candidate candidate = queue_.top();
      queue_.pop();
      if (!taken_[candidate.facet] && accepts(candidate.facet)) add(candidate.facet);
    }
    return group_;
  }

 private:
  struct Candidate {
    double deviation;
    std::uint32_t facet;
    bool operator<(const Candidate& other) const {  // the queue's top is the largest
      return deviation != other.deviation ? deviation > other.deviation : facet > other.facet;
    }
  };

  [[nodiscard]] double cosineTo(std::uint32_t facet) const {
    const double length = glm::length(sum_);
    return length > 0.0 ? glm::dot(sum_, facets_.facets[facet].normal) / length : -1.0;
  }
  [[nodiscard]] bool accepts(std::uint32_t facet) const {
    const double cosine = cosineTo(facet);
    return cosine >= cos_limit_ || (cosine >= cos_small_ && area_ + facets_.facets[facet].area <= small_area_);
  }
  void add(std::uint32_t facet) {
    taken_[facet] = true;
    group_.push_back(facet);
    sum_ += facets_.facets[facet].normal * facets_.facets[facet].area;
    area_ += facets_.facets[facet].area;
    for (std::uint32_t i = graph_.first[facet]; i < graph_.first[facet + 1]; ++i) {
      const std::uint32_t other = graph_.neighbour[i];
      if (taken_[other]) continue;
      const double cosine = cosineTo(other);
      if (cosine >= cos_small_) queue_.push({1.0 - cosine, other});
    }
  }

  const Facets& facets_;
  const FacetGraph& graph_;
  std::vector<bool>& taken_;
  double small_area_, cos_limit_, cos_small_;
  std::vector<std::uint32_t> group_;
  glm::dvec3 sum_{0.0};
  double area_ = 0.0;
  std::priority_queue<Candidate> queue_;
};

}  // namespace

std::vector<std::vector<std::uint32_t>> groupFacets(const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                                                    const Facets& facets, double planar_side, double small_area,
                                                    double angle_deg) {
  std::vector<std::vector<std::uint32_t>> groups;
  std::vector<bool> taken(facets.facets.size(), false);
  for (std::uint32_t f = 0; f < facets.facets.size(); ++f) {
    interruptionPoint();
    const Facets::Facet& facet = facets.facets[f];
    if (facet.area < planar_side * planar_side * 0.5) continue;  // cannot be wide enough, unless nearly hollow
    if (rectangleSides(flat, facet.triangles, facet.normal).y < planar_side) continue;
    taken[f] = true;
    groups.push_back({f});
  }
  const FacetGraph graph = facetGraph(neighbours, facets);
  Grower grower(facets, graph, taken, small_area, angle_deg);
  std::vector<std::uint32_t> order(facets.facets.size());
  std::iota(order.begin(), order.end(), 0U);
  for (const std::uint32_t f : order)  // facets come largest first
    if (!taken[f]) groups.push_back(grower.grow(f));
  return groups;
}

}  // namespace radiosity::scene
