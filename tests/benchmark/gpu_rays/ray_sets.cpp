#include "tests/benchmark/gpu_rays/ray_sets.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <optional>

#include "common/parallel.h"
#include "server/geometry/ray_scene.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/solver/math/sampling.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::benchmarks {
namespace {

constexpr std::uint64_t kSeed = 1;
constexpr float kFar = 4.0F;                 ///< farther than the unit box is wide
constexpr double kNearEnd = 1e-5;            ///< as of solver::LeafRays
constexpr std::uint32_t kFront = 1U << 31U;  ///< of rays.comp
constexpr std::size_t kMostExamined = 256;   ///< of answers that differ
constexpr std::size_t kLeavesOfBlock = 64;   ///< that are put in order together
/// What rounding moves (unit box); what lies within a millionth along a ray lies in one place.
constexpr double kTolerance = 4e-6;
/// How far triangles reach past their edges as a ray sees them, times the longest edge over that edge: twice what
/// geometry::RayScene has them do.
constexpr double kReach = 1e-6;

CastRay rayFrom(const solver::LeafRays::Place& place, const glm::dvec3& direction, double reach) {
  return {solver::LeafRays::startOf(place), place.triangle, glm::vec3(direction), static_cast<float>(reach)};
}

/// Cells of directions such that cells with near numbers are near each other.
std::uint32_t directionCell(const glm::vec3& direction) {
  const float sum = std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z);
  glm::vec2 flat(direction.x / sum, direction.z / sum);  // octahedron
  if (direction.y < 0.0F)
    flat = {(1.0F - std::abs(flat.y)) * (flat.x < 0.0F ? -1.0F : 1.0F),
            (1.0F - std::abs(flat.x)) * (flat.y < 0.0F ? -1.0F : 1.0F)};
  std::uint32_t cell = 0;
  for (int axis = 0; axis < 2; ++axis) {
    const auto along = static_cast<std::uint32_t>(std::clamp((flat[axis] + 1.0F) * 8.0F, 0.0F, 15.0F));
    for (std::uint32_t bit = 0; bit < 4; ++bit) cell |= (along >> bit & 1U) << (2 * bit + static_cast<unsigned>(axis));
  }
  return cell;
}

/// Where a ray meets the plane of a triangle, in double precision, how far outside of the triangle, and on which side.
struct Meeting {
  double t, outside, tolerance;
  bool front;
};
std::optional<Meeting> meet(const scene::Bvh::Triangle& triangle, const CastRay& ray) {
  const std::array<glm::dvec3, 3> c{glm::dvec3(triangle[0]), glm::dvec3(triangle[1]), glm::dvec3(triangle[2])};
  const glm::dvec3 cross = glm::cross(c[1] - c[0], c[2] - c[0]), origin(ray.origin), way(ray.direction);
  const double area = glm::length(cross);
  if (area == 0.0) return std::nullopt;
  const glm::dvec3 normal = cross / area;
  const double slope = glm::dot(normal, way);
  if (slope == 0.0) return std::nullopt;
  Meeting meeting{glm::dot(normal, c[0] - origin) / slope, -HUGE_VAL, 0.0, slope < 0.0};
  const glm::dvec3 point = origin + meeting.t * way;
  double longest = 0.0, shortest = HUGE_VAL;
  for (std::size_t k = 0; k < 3; ++k) {
    const glm::dvec3 edge = c[(k + 1) % 3] - c[k];
    const double length = glm::length(edge);
    longest = std::max(longest, length);
    shortest = std::min(shortest, length);
    meeting.outside = std::max(meeting.outside, glm::dot(glm::cross(edge, normal), point - c[k]) / length);
  }
  const double flat = std::abs(slope);
  meeting.tolerance = std::max({kTolerance, 0.1 * kTolerance / flat, kReach * longest / (flat * shortest)});
  return meeting;
}

/// Whether what was told of a ray is true but for rounding.
bool isTrue(const std::vector<scene::Bvh::Triangle>& triangles, const CastRay& ray, bool any, std::uint32_t told) {
  double nearest = static_cast<double>(ray.reach), tolerance = 0.0;
  if (!any && told != scene::kNone) {
    if ((told & ~kFront) >= triangles.size()) return false;
    const auto meeting = meet(triangles[told & ~kFront], ray);
    if (!meeting || meeting->outside > meeting->tolerance || meeting->t < -meeting->tolerance) return false;
    if (meeting->front != ((told & kFront) != 0)) return false;
    nearest = std::min(nearest, meeting->t);
    tolerance = meeting->tolerance;
  }
  bool may_meet = false;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto meeting = t == ray.own ? std::nullopt : meet(triangles[t], ray);
    if (!meeting) continue;
    const double either = tolerance + meeting->tolerance;
    const bool clearly = meeting->outside < -either && meeting->t > either && meeting->t < nearest - either;
    if (clearly && !(any && told == 1)) return false;
    may_meet = may_meet || (meeting->outside < either && meeting->t > -either && meeting->t < nearest + either);
  }
  return !any || told == 0 || may_meet;
}

}  // namespace

Result<std::unique_ptr<RayScene>> RayScene::load(const std::string& name, std::uint64_t texels) {
  if (name.starts_with("room:")) {
    const auto quads = static_cast<std::uint32_t>(std::stoul(name.substr(5)));
    return std::unique_ptr<RayScene>(new RayScene(test::randomRoom(quads, static_cast<std::uint32_t>(texels), 5)));
  }
  const auto document = scene::loadDocument(name);
  if (!document) return tl::unexpected(document.error());
  const auto imported = scene::importScene(*document);
  if (!imported) return tl::unexpected(imported.error());
  scene::ChartOptions charts;
  charts.texel_budget = texels;
  auto built = scene::buildPatchScene(*imported, charts);
  if (!built) return tl::unexpected(built.error());
  auto patches = std::make_shared<const scene::PatchScene>(std::move(*built));
  const auto materials = scene::shadePatches(*imported, *patches);
  auto made = std::unique_ptr<RayScene>(new RayScene(std::move(patches)));
  if (const auto lamp = made->brightest(materials); lamp != scene::kNone)
    made->lamp_ = made->rays_->placeOn(lamp, glm::dvec2(0.5));
  return made;
}

RayScene::RayScene(std::shared_ptr<const scene::PatchScene> patches)
    : patches_(std::move(patches)), triangles_(patches_->triangles.size()), sides_(solver::makeSides(*patches_)) {
  for (std::size_t i = 0; i < patches_->indices.size(); ++i)
    triangles_[i / 3][i % 3] = patches_->vertices[patches_->indices[i]].position;
  rays_ = std::make_unique<solver::LeafRays>(*patches_, sides_);
  for (const auto& side : sides_)
    for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
      if (rays_->areaOf(value) > 0.0) leaves_.push_back(value);
}

/// kNone: none shines.
std::uint32_t RayScene::brightest(const scene::PatchMaterials& materials) const {
  float most = 0.0F;
  std::uint32_t which = scene::kNone;
  for (const auto value : leaves_) {
    const auto& side = rays_->sideOf(value);
    const auto light = materials.emission[side.first_node + value - side.first_value];
    if (const float sum = light.x + light.y + light.z; sum > most) most = sum, which = value;
  }
  return which;
}

RaySet RayScene::leafRays(std::uint32_t of_each) const {
  RaySet set;
  set.rays.resize(leaves_.size() * of_each);
  inTurns(leaves_.size(), [&](std::size_t leaf) {
    const solver::Sobol4 points(solver::mixKeys(kSeed, leaves_[leaf]));
    for (std::uint32_t k = 0; k < of_each; ++k) {
      const auto at = points(k);
      const auto place = rays_->placeOn(leaves_[leaf], {at.z, at.w});
      set.rays[leaf * of_each + k] = rayFrom(place, solver::cosineDirection(place.normal, at.x, at.y), kFar);
    }
  });
  return set;
}

RaySet RayScene::lampRays(std::uint32_t of_each) const {
  RaySet set;
  set.any = true;
  for (const auto value : leaves_) {
    const solver::Sobol4 points(solver::mixKeys(kSeed, value));
    for (std::uint32_t k = 0; k < of_each; ++k) {
      const auto at = points(k);
      const auto place = rays_->placeOn(value, {at.z, at.w});
      const glm::dvec3 way = lamp_.position - glm::dvec3(solver::LeafRays::startOf(place));
      const double length = glm::length(way);
      if (glm::dot(way, place.normal) <= 0.0 || glm::dot(way, lamp_.normal) > 0.0 || length < 2.0 * kNearEnd) continue;
      set.rays.push_back(rayFrom(place, way / length, length - kNearEnd));
    }
  }
  return set;
}

std::vector<std::uint32_t> RayScene::leafHits(std::uint32_t of_each) const {
  std::vector<std::uint32_t> number(sides_.empty() ? 0 : sides_.back().first_value + sides_.back().leaf_count);
  const auto count = static_cast<std::uint32_t>(leaves_.size());
  std::ranges::fill(number, count);
  for (std::uint32_t leaf = 0; leaf < count; ++leaf) number[leaves_[leaf]] = leaf;
  std::vector<std::uint32_t> hits(leaves_.size() * of_each);
  inTurns(leaves_.size(), [&](std::size_t leaf) {
    const solver::Sobol4 points(solver::mixKeys(kSeed, leaves_[leaf]));
    for (std::uint32_t k = 0; k < of_each; ++k) {
      const auto at = points(k);
      const auto place = rays_->placeOn(leaves_[leaf], {at.z, at.w});
      const auto value = rays_->look(place, solver::cosineDirection(place.normal, at.x, at.y)).end.value;
      hits[leaf * of_each + k] = value < number.size() ? number[value] : count;
    }
  });
  return hits;
}

RaySet inOrder(const RaySet& set, RayOrder order, std::uint32_t of_each) {
  if (order == RayOrder::kByLeaf) return set;
  std::vector<std::uint32_t> which(set.rays.size());
  std::iota(which.begin(), which.end(), 0U);
  const auto leaves = set.rays.size() / of_each;
  if (order == RayOrder::kByNumber) {
    for (std::size_t i = 0; i < which.size(); ++i)
      which[i] = static_cast<std::uint32_t>(i % leaves * of_each + i / leaves);
  } else {
    const auto size = kLeavesOfBlock * of_each;
    std::vector<std::uint32_t> cells(set.rays.size());
    for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = directionCell(set.rays[i].direction);
    inTurns((which.size() + size - 1) / size, [&](std::size_t block) {
      const auto begin = which.begin() + static_cast<std::ptrdiff_t>(block * size);
      const auto end = which.begin() + static_cast<std::ptrdiff_t>(std::min((block + 1) * size, which.size()));
      std::stable_sort(begin, end, [&](auto a, auto b) { return cells[a] < cells[b]; });
    });
  }
  RaySet ordered;
  ordered.any = set.any;
  ordered.rays.reserve(set.rays.size());
  for (const auto i : which) ordered.rays.push_back(set.rays[i]);
  return ordered;
}

Answers askProcessor(const std::vector<scene::Bvh::Triangle>& triangles, const RaySet& set) {
  const auto tree = geometry::RayScene::build(triangles).value();
  Answers answers;
  answers.hits.resize(set.rays.size());
  constexpr std::size_t kAtOnce = 4096;
  const auto begin = std::chrono::steady_clock::now();
  inTurns((set.rays.size() + kAtOnce - 1) / kAtOnce, [&](std::size_t part) {
    for (std::size_t i = part * kAtOnce; i < std::min((part + 1) * kAtOnce, set.rays.size()); ++i) {
      const auto& ray = set.rays[i];
      const auto hit = tree.nearest({ray.origin, ray.direction, ray.reach, ray.own});
      answers.hits[i] = set.any       ? (hit.found() ? 1 : 0)
                        : hit.found() ? hit.triangle | (hit.front ? kFront : 0)
                                      : scene::kNone;
    }
  });
  answers.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return answers;
}

Differences compare(const std::vector<scene::Bvh::Triangle>& triangles, const RaySet& set,
                    const std::vector<std::uint32_t>& right, const std::vector<std::uint32_t>& told) {
  Differences differences;
  for (std::size_t i = 0; i < set.rays.size(); ++i) {
    if (right[i] == told[i]) continue;
    ++differences.all;
    if (differences.examined == kMostExamined) continue;
    ++differences.examined;
    if (!isTrue(triangles, set.rays[i], set.any, told[i])) ++differences.wrong;
  }
  return differences;
}

}  // namespace radiosity::benchmarks
