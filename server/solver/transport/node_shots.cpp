#include "server/solver/transport/node_shots.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Nodes of a block of so many by so many look at the same place of a receiver, those of the next block at the
/// opposite place, or at other spots.
constexpr std::uint32_t kJitterBlock = 4;

/// Rows of a leaf's spots that count for a sample of a light. Light and shadow of a lamp differ across a leaf; the
/// samples that follow draw the other rows, and with four at once places in gaps took most of the time of all images.
constexpr std::uint32_t kLightRows = 1;

/// Points of a polygon's sample, by its number, and of all before it.
std::uint32_t pointsOfSample(std::uint32_t index) {
  constexpr std::uint32_t kDoublings = std::bit_width(kMostNodePoints);
  return index == 0 ? 1 : index < kDoublings ? 1U << (index - 1) : kMostNodePoints;
}

/// Too thin to have an outline: it is scattered.
bool isSliver(const TexelPolygon& polygon) { return polygon.count < 3; }

std::uint32_t firstPointOf(std::uint32_t index) {
  constexpr std::uint32_t kDoublings = std::bit_width(kMostNodePoints);
  if (index <= kDoublings) return index == 0 ? 0 : 1U << (index - 1);
  return kMostNodePoints * (index - kDoublings + 1);
}

/// The halves draw rows of spots each for itself, and never from the same quarter at once. The opposite row would not
/// do: of so few rows two that are opposite are soon drawn by both halves, and what they do not show would not show in
/// the halves' difference either.
scene::SpotDraw spotsOf(std::uint32_t index, std::uint64_t key, bool second) {
  const auto first = scene::SpotDraw::from(sobol4(index, mixKeys(key, 3)).x);
  if (!second) return first;
  auto draw = scene::SpotDraw::from(sobol4(index, mixKeys(key, 4)).x);
  constexpr std::uint32_t kQuarter = scene::kSpotRows / 4;
  if (draw.row / kQuarter == first.row / kQuarter) draw.row = (draw.row + 2 * kQuarter) % scene::kSpotRows;
  return draw;
}

std::uint64_t blockOf(const NodePlace& node) {
  return (std::uint64_t{node.level} << 58) ^ (std::uint64_t{node.y / kJitterBlock} << 29) ^
         std::uint64_t{node.x / kJitterBlock};
}

}  // namespace

HemicubeFrame hemicubeAt(const glm::vec3& origin, const glm::vec3& normal, double rotation, std::uint64_t key) {
  const glm::vec3 helper = std::abs(normal.x) < 0.6F ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
  const glm::vec3 a = glm::normalize(glm::cross(helper, normal));
  const glm::vec3 b = glm::cross(normal, a);
  const double angle = 0.5 * std::numbers::pi * rotation;  // the hemicube has fourfold symmetry
  HemicubeFrame frame;
  frame.origin = origin;
  frame.normal = normal;
  frame.tangent = glm::normalize(a * static_cast<float>(std::cos(angle)) + b * static_cast<float>(std::sin(angle)));
  frame.lattice = static_cast<std::uint32_t>(mixKeys(key, 5) % (std::uint64_t{kLatticeSide} * kLatticeSide));
  return frame;
}

/// Unit box squared. Where a file's own coordinates unfold a surface texels differ in size.
double NodeShots::areaOf(const NodePlace& node, const TexelPolygon& polygon) const {
  const auto& surface = patches_.surfaces[sides_[node.side].surface];
  if (surface.planar) return polygon.area() * static_cast<double>(surface.texel_area);
  const auto& frame = patches_.triangles[flatTriangle(node)];
  return polygon.area() * static_cast<double>(glm::length(glm::cross(frame.du, frame.dv)));
}

bool NodeShots::isWhole(const NodePlace& node) const {
  const Side& side = sides_[node.side];
  const auto polygon = outlines_.node(side.surface, node.level, node.x, node.y);
  const auto area = static_cast<double>(patches_.node_area[nodeId(side, node)]);
  const double whole = areaOf(node, polygon);
  return std::abs(area - whole) <= 2e-3 * whole;
}

std::uint64_t NodeShots::key(const NodePlace& node) const {
  const std::uint64_t place = (std::uint64_t{node.level} << 58) ^ (std::uint64_t{node.y} << 29) ^ std::uint64_t{node.x};
  return mixKeys(mixKeys(seed_, sides_[node.side].key), place);
}

std::uint32_t NodeShots::pointsOf(const NodePlace& node, std::uint32_t index) const {
  if (!gathers(node)) return 1;
  const auto polygon = outlines_.node(sides_[node.side].surface, node.level, node.x, node.y);
  return isSliver(polygon) ? 1 : pointsOfSample(index);
}

void NodeShots::add(const NodePlace& node, std::size_t half, std::uint32_t index, std::uint32_t resolution,
                    ShotBatch& batch) const {
  if (gathers(node)) {
    addGather(node, half, index, resolution, batch);
  } else {
    addScatter(node, half, index, resolution, batch);
  }
}

/// A leaf of the node chosen with probability proportional to its area; (u, v) are uniform again on return.
std::uint32_t NodeShots::leafByArea(const NodePlace& node, double& u, double& v) const {
  return warpToLeaf(
      sides_[node.side], node, [&](std::uint32_t id) { return patches_.node_area[id]; }, u, v);
}

void NodeShots::addGather(const NodePlace& node, std::size_t half, std::uint32_t index, std::uint32_t resolution,
                          ShotBatch& batch) const {
  const Side& side = sides_[node.side];
  const auto& surface = patches_.surfaces[side.surface];
  const auto& frame = patches_.triangles[flatTriangle(node)];
  const auto polygon = outlines_.node(side.surface, node.level, node.x, node.y);
  if (isSliver(polygon)) return addScatter(node, half, index, resolution, batch);
  const bool whole = isWhole(node);
  const auto at = [&](const glm::dvec2& texel) {
    return frame.origin + static_cast<float>(texel.x) * frame.du + static_cast<float>(texel.y) * frame.dv;
  };
  GatherShot shot;
  shot.normal = side.side == 0 ? frame.normal : -frame.normal;
  shot.corner_count = polygon.count;
  const bool turned = glm::dot(glm::cross(frame.du, frame.dv), shot.normal) < 0.0F;
  for (std::uint32_t k = 0; k < polygon.count; ++k)
    shot.corners[turned ? polygon.count - 1 - k : k] = at(polygon.corner[k]);
  const double area = areaOf(node, polygon);
  const auto shining = static_cast<double>(patches_.node_area[nodeId(side, node)]);
  shot.fill = whole ? 1.0F : static_cast<float>(std::min(1.0, shining / area));
  shot.triangle = flatTriangle(node);
  shot.side = side.side;
  shot.resolution = resolution;
  const std::uint64_t node_key = mixKeys(key(node), half);
  // The halves look at opposite places of a texel: what is linear in it cancels in their mean and shows in their
  // difference. So do blocks of nodes, or it would show for the whole surface at once; inside a block all look at one
  // place, since what single nodes bring to it changes steeply close by, and the sum of neighbours does not. Of spots
  // each block has its own rows: few rows are a poor mean over a texel that something covers in part.
  const glm::dvec4 jitter = sobol4(index, mixKeys(mixKeys(seed_, side.key), 2));
  const bool opposite = (half + node.x / kJitterBlock + node.y / kJitterBlock) % 2 != 0;
  shot.receiver_jitter = glm::vec2(opposite ? 1.0 - glm::dvec2(jitter) : glm::dvec2(jitter));
  shot.spots = spotsOf(index, mixKeys(mixKeys(seed_, side.key), blockOf(node)), half != 0);
  shot.first_point = static_cast<std::uint32_t>(batch.points.size());
  shot.point_count = pointsOfSample(index);
  shot.spot_rows = shot.point_count;  // as many places of a receiver as before, looked at from each point
  const auto first = firstPointOf(index);
  for (auto p = first; p < first + shot.point_count; ++p) {
    glm::dvec4 sample = sobol4(p, node_key);
    glm::dvec2 texel = polygon.point(sample.x, sample.y);
    if (!whole) {
      const auto leaf = leafByArea(node, sample.x, sample.y);
      const auto& place = patches_.leaves[surface.first_leaf + leaf];
      texel = patches_.spotAt(place, leaf % side.width, leaf / side.width, glm::vec2(sample)).texel;
    }
    batch.points.push_back(hemicubeAt(at(texel), shot.normal, sample.z, mixKeys(node_key, p)));
  }
  batch.gather.push_back(shot);
}

void NodeShots::addScatter(const NodePlace& node, std::size_t half, std::uint32_t index, std::uint32_t resolution,
                           ShotBatch& batch) const {
  const Side& side = sides_[node.side];
  const std::uint64_t node_key = mixKeys(key(node), half);
  glm::dvec4 sample = sobol4(index, node_key);
  const auto leaf = leafByArea(node, sample.x, sample.y);
  const auto& place = patches_.leaves[patches_.surfaces[side.surface].first_leaf + leaf];
  const auto [texel, index_of_triangle] =
      patches_.spotAt(place, leaf % side.width, leaf / side.width, glm::vec2(sample));
  const auto& triangle = patches_.triangles[index_of_triangle];
  ScatterShot shot;
  shot.frame = hemicubeAt(triangle.origin + texel.x * triangle.du + texel.y * triangle.dv,
                          side.side == 0 ? triangle.normal : -triangle.normal, sample.z, mixKeys(node_key, index));
  shot.resolution = resolution;
  shot.level_bias = static_cast<float>(sample.w);
  batch.scatter.push_back(shot);
}

void NodeShots::add(const LightPolygon& light, std::size_t half, std::uint32_t index, std::uint32_t points,
                    std::uint32_t resolution, ShotBatch& batch) const {
  const std::uint64_t light_key = mixKeys(seed_, 0x4c49474854ULL + light.key), half_key = mixKeys(light_key, half);
  const glm::dvec4 jitter = sobol4(index, mixKeys(light_key, 1));
  GatherShot shot;
  std::copy(light.corners.begin(), light.corners.end(), shot.corners.begin());
  shot.corner_count = light.corner_count;
  shot.normal = light.normal;
  shot.spot_rows = kLightRows;
  shot.resolution = resolution;
  shot.receiver_jitter = glm::vec2(half == 0 ? glm::dvec2(jitter) : 1.0 - glm::dvec2(jitter));
  shot.spots = spotsOf(index, light_key, half != 0);
  shot.first_point = static_cast<std::uint32_t>(batch.points.size());
  shot.point_count = points;
  shot.own_points_key = half_key;
  shot.first_draw = index * points;
  for (std::uint32_t p = 0; p < points; ++p) {
    const std::uint32_t sequence = shot.first_draw + p;
    const glm::dvec4 sample = sobol4(sequence, half_key);
    batch.points.push_back(
        hemicubeAt(light.point(sample.x, sample.y), light.normal, sample.z, mixKeys(half_key, sequence)));
  }
  batch.gather.push_back(shot);
}

}  // namespace radiosity::solver
