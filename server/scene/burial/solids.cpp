#include "server/scene/burial/solids.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <numeric>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "common/parallel.h"
#include "server/geometry/flat_sides.h"
#include "server/geometry/triangle_rows.h"
#include "server/scene/burial/coverage.h"

namespace radiosity::scene {
namespace {

/// What lies on each other faces the same way: cosine of the angle between. Planes of such are no farther apart where
/// the scene is (unit box) unless they meet at an angle.
constexpr float kSameWay = 0.9999F;
constexpr double kSamePlane = 2e-5;
/// Before or behind a place, what covers it.
constexpr double kReachOfCover = 1e-6;
/// So many places of a leaf are looked at for what covers it.
constexpr std::uint32_t kPlaces = 16;
/// Surfaces that a thread is worth that looks for what covers them.
constexpr std::size_t kSurfacesAThread = 64;
/// Hits::work, some 0.2 ms, in which a way out along a surface is looked for: in a room it takes a tenth of that, among
/// thousands of solids that lie through each other a hundred times as much. What the nearest face takes.
constexpr std::uint64_t kMostWorkAlong = 30'000, kWorkOfFirst = 200;
/// So many rays that say the same are enough. More where a place would be lost.
constexpr std::uint32_t kAgreeOutside = 3, kAgreeInside = 6;
/// Of rays that are held against a single closed solid.
constexpr std::uint32_t kAgreeInClosed = 3;

/// Of a position in the triangle's plane.
glm::vec2 texelAt(const TriangleFrame& frame, const glm::vec3& position) {
  const glm::dvec3 u(frame.du), v(frame.dv), way = glm::dvec3(position) - glm::dvec3(frame.origin);
  const double uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v);
  const double along_u = glm::dot(way, u), along_v = glm::dot(way, v), determinant = uu * vv - uv * uv;
  return {(along_u * vv - along_v * uv) / determinant, (along_v * uu - along_u * uv) / determinant};
}

/// By leaf: a triangle that lies on it, or in the same plane. Leaf points do not tell of leaves that are covered.
std::vector<std::uint32_t> trianglesOn(const PatchScene& patches, const Surface& surface) {
  std::vector<std::uint32_t> on(std::size_t{surface.width} * surface.height, kNone);
  const glm::uvec2 most(surface.width - 1, surface.height - 1);
  for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
    glm::vec2 low(most), high(0.0F);
    std::array<glm::dvec2, 3> corners;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& texel = patches.vertices[patches.indices[std::size_t{3} * t + c]].texel;
      corners[c] = glm::dvec2(texel);
      low = glm::min(low, texel);
      high = glm::max(high, texel);
    }
    const glm::uvec2 first(glm::max(low, 0.0F)), last = glm::min(glm::uvec2(high), most);
    for (auto y = first.y; y <= last.y; ++y) {
      const auto extent = extentWithin(corners, y, y + 1.0);
      if (!(extent.x <= extent.y)) continue;
      const auto end = static_cast<std::uint32_t>(std::clamp(extent.y, 0.0, static_cast<double>(most.x)));
      for (auto x = std::max(first.x, static_cast<std::uint32_t>(std::max(extent.x, 0.0))); x <= end; ++x) {
        auto& triangle = on[std::size_t{y} * surface.width + x];
        for (std::uint32_t k = 0; k < kPlaces && triangle == kNone; ++k)
          if (triangleHolds(patches, t, glm::dvec2(x, y) + latticePoint(k, kPlaces), 0.0)) triangle = t;
      }
    }
  }
  if (surface.planar) std::ranges::replace(on, kNone, surface.first_triangle);
  return on;
}

/// Of a part with a cavity in it, or a lining, whose faces are no part themselves, a ray from outside may meet those
/// alone: all count for all places.
void dropThoseThatHoldOthers(const PatchScene& patches, const std::vector<Hides>& hides,
                             std::vector<std::uint32_t>& part_of) {
  std::vector<Bvh::Triangle> others;
  std::unordered_map<std::uint32_t, Bounds> bounds;
  for (std::size_t t = 0; t < part_of.size(); ++t) {
    interruptionPoint();
    if (hides[patches.triangle_surface[t]] != Hides::kSolid) continue;
    Bvh::Triangle triangle;
    for (std::size_t c = 0; c < 3; ++c)
      triangle[c] = patches.vertices[patches.indices[std::size_t{3} * t + c]].position;
    if (part_of[t] == kNone) {
      others.push_back(triangle);
    } else {
      for (const auto& corner : triangle) bounds[part_of[t]].add(corner);
    }
  }
  const Bvh tree(std::move(others));
  const auto isDropped = [&](std::uint32_t part) {
    const auto found = bounds.find(part);
    return found != bounds.end() && tree.holdsOne(found->second.min, found->second.max);
  };
  std::unordered_map<std::uint32_t, bool> dropped;
  for (auto& part : part_of) {
    if (part == kNone) continue;
    const auto [at, is_new] = dropped.try_emplace(part, false);
    if (is_new) at->second = isDropped(part);
    if (at->second) part = kNone;
  }
}

/// As SolidParts takes it. A closed solid some of whose faces are sheets, or hide nothing, is open there.
std::vector<std::uint32_t> partOf(const PatchScene& patches, const std::vector<Hides>& hides) {
  const auto& solids = patches.solids;
  std::vector<bool> is_open(solids.bounds.size(), false);
  for (std::size_t t = 0; t < solids.solid_of.size(); ++t) {
    const auto solid = solids.solid_of[t];
    if (solid != kNone && hides[patches.triangle_surface[t]] != Hides::kSolid) is_open[solid] = true;
  }
  std::vector<std::uint32_t> part_of(patches.triangles.size(), kNone);
  const auto closed = static_cast<std::uint32_t>(solids.bounds.size());
  for (std::size_t t = 0; t < solids.solid_of.size(); ++t) {
    const auto solid = solids.solid_of[t], hollow = solids.hollow_of[t];
    if (solid != kNone) part_of[t] = 2 * solid + (is_open[solid] ? SolidParts::kHollow : SolidParts::kClosed);
    if (hollow != kNone) part_of[t] = 2 * (closed + hollow) + SolidParts::kHollow;
  }
  dropThoseThatHoldOthers(patches, hides, part_of);
  return part_of;
}

/// Of those at the same distance, whatever else there is in the tree.
RayHit firstOfTied(const Bvh& tree, const glm::dvec3& origin, const glm::dvec3& direction, const RayHit& nearest) {
  constexpr double kTied = 1e-9;
  std::vector<RayHit> hits;
  tree.collectHits(origin, direction, nearest.t - kTied, nearest.t + kTied, hits);
  const auto key = [](const RayHit& hit) { return std::tuple(hit.t, hit.front, hit.triangle); };
  return hits.empty() ? nearest : *std::ranges::min_element(hits, {}, key);
}

}  // namespace

/// Parted by the axis that they mostly face, and which way: in one tree walls across each other would lie in the same
/// boxes, so that every ray had to look into most of them.
struct Solids::Whole {
  std::array<Bvh, 6> trees;
  std::array<SolidTree, 6> ends;

  Whole(const std::vector<Bvh::Triangle>& triangles, const std::vector<glm::vec3>& normals) {
    std::array<std::vector<Bvh::Triangle>, 6> parts;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      const auto size = glm::abs(normals[t]);
      const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
      parts[static_cast<std::size_t>(2 * axis + (normals[t][axis] < 0.0F ? 1 : 0))].push_back(triangles[t]);
    }
    for (std::size_t k = 0; k < parts.size(); ++k) {
      trees[k] = Bvh(std::move(parts[k]));
      ends[k] = SolidTree(trees[k]);
    }
  }
};

Solids::~Solids() = default;

Solids::Solids(const PatchScene& patches, const std::vector<Hides>& hides) {
  std::vector<Bvh::Triangle> triangles, sheets;
  std::vector<std::uint32_t> part;
  const auto part_of = partOf(patches, hides);
  for (std::uint32_t t = 0; t < patches.triangles.size(); ++t) {
    interruptionPoint();
    const auto hiding = hides[patches.triangle_surface[t]];
    if (hiding == Hides::kNothing) continue;
    Bvh::Triangle triangle;
    for (std::size_t c = 0; c < 3; ++c)
      triangle[c] = patches.vertices[patches.indices[std::size_t{3} * t + c]].position;
    (hiding == Hides::kSolid ? triangles : sheets).push_back(triangle);
    (hiding == Hides::kSolid ? normal_ : sheet_normal_).push_back(patches.triangles[t].normal);
    if (hiding != Hides::kSolid) continue;
    surface_.push_back(patches.triangle_surface[t]);
    part.push_back(part_of[t]);
  }
  parts_ = SolidParts(triangles, part);
  corners_ = triangles;
  tree_ = Bvh(std::move(triangles));
  sheets_ = Bvh(std::move(sheets));
}

bool Solids::near(const Bounds& box, std::uint32_t surface, std::size_t looks) const {
  const glm::vec3 margin(static_cast<float>(2.0 * kBurialLift));
  return tree_.touches(box.min - margin, box.max + margin, surface_, surface, looks);
}

Solids::Answer Solids::ask(const glm::vec3& position, const glm::vec3& normal, const SolidParts::Around& around,
                           Hits& hits, RayNotes* notes) const {
  const Start start{glm::dvec3(position) + kBurialLift * glm::dvec3(normal), normal, kNone, &around};
  hits.stop = hits.work + hits.most_of_place;
  if (const auto known = liesInClosed(start, hits, notes)) return {*known, true};
  auto answer = vote(start, hits, notes);
  answer.buried = answer.buried && !seesOutAlong(start, hits, notes);
  return answer;
}

Solids::Answer Solids::ask(const glm::vec3& position, const glm::vec3& normal, Hits& hits) const {
  findAround({position, position}, Facing{normal, glm::dot(normal, position)}, hits.around);
  return ask(position, normal, hits.around, hits);
}

/// Rays start a little before them.
void Solids::findAround(const Bounds& positions, const std::optional<Facing>& facing,
                        SolidParts::Around& around) const {
  const glm::vec3 lift(static_cast<float>(kBurialLift));
  std::optional<SolidParts::Plane> plane;
  if (facing) plane = {facing->normal, facing->height + 0.5F * lift.x};
  if (parts_.find({positions.min - lift, positions.max + lift}, plane, around)) return;
  std::call_once(whole_made_, [&] { whole_ = std::make_unique<const Whole>(corners_, normal_); });
  around.trees.clear();
  for (const auto& tree : whole_->ends) around.trees.push_back(&tree);
  around.in_hollow = around.is_crowded = true;
}

bool Solids::mayBury(const Bounds& positions, const glm::vec3& normal, const SolidParts::Around& around) const {
  const glm::vec3 lift = static_cast<float>(kBurialLift) * normal;
  const auto direction = BurialWays(normal).of(0);
  return around.in_hollow || std::ranges::any_of(around.trees, [&](const SolidTree* part) {
           return part->triangles().mayMeetBack(positions.min + lift, positions.max + lift, direction,
                                                kBurialRayLength);
         });
}

/// In a crowd a ray meets very many, and a look at each of those that may hold the place, by itself, soon finds one
/// that does. None: these do not tell.
std::optional<bool> Solids::liesInClosed(const Start& start, Hits& hits, RayNotes* notes) const {
  if (!start.around->is_crowded) return std::nullopt;
  const BurialWays ways(start.normal);
  bool on_sheet = false;  // then what the place lies in does not count, or others may
  double end = 0.0;
  const auto leaves = [&](const SolidTree& part, std::uint32_t way) {
    const auto direction = ways.of(way);
    const auto found =
        SolidTree::endOfSolid(std::array{&part}, start.origin, direction, kBurialRayLength, hits, hits.work, hits.stop);
    if (!found) return false;
    end = std::max(end, *found);
    const bool ends_on_sheet = !sheets_.empty() && sheets_.meets(start.origin, direction, 0.0, *found);
    on_sheet = on_sheet || ends_on_sheet;
    return !ends_on_sheet;
  };
  const auto holds = [&](const SolidTree& part) {
    std::uint32_t way = 0;
    for (end = 0.0; way < kAgreeInClosed && leaves(part, way); ++way) {
    }
    return way == kAgreeInClosed || hits.work >= hits.stop;
  };
  const auto found = parts_.anyHolds(glm::vec3(start.origin), hits.work, hits.stop, holds);
  if (!found || hits.work >= hits.stop || (on_sheet && !*found)) return std::nullopt;
  for (std::uint32_t way = 0; notes != nullptr && way < kAgreeInClosed; ++way)
    notes->add({start.origin, start.normal, start.triangle, way, *found ? end : kBurialRayLength});
  return found;
}

/// A first ray that meets no back decides, unless it may have left a hollow by its open end, and so do some that agree.
/// Otherwise the majority of all.
Solids::Answer Solids::vote(const Start& start, Hits& hits, RayNotes* notes) const {
  const BurialWays ways(start.normal);
  std::uint32_t leave = 0, stay = 0;
  bool agreed = true;
  for (std::uint32_t way = 0; way < kFirstWayAlong; ++way) {
    const auto ray = follow(start, way, ways.of(way), hits, notes);
    if (ray == Ray::kGivesUp) return {leave > stay, false};
    agreed = agreed && ray != Ray::kEndsOnSheet;
    if (ray == Ray::kLeaves) {
      ++leave;
    } else {
      ++stay;
      if (way == 0 && !start.around->in_hollow && std::ranges::all_of(hits, &RayHit::front)) return {};
    }
    if (leave == 0 && stay == kAgreeOutside) return {false, agreed};
    if (stay == 0 && leave == kAgreeInside) return {true, true};
    if (2 * std::max(leave, stay) > kFirstWayAlong) break;
  }
  return {leave > stay, false};
}

/// Whether a ray along the surface gets, before it leaves a solid, to where most rays leave none, or out of the
/// scene. What it meets first may be a part of the surface, in a hollow, or of another that is buried as well.
bool Solids::seesOutAlong(const Start& start, Hits& hits, RayNotes* notes) const {
  const BurialWays ways(start.normal);
  const auto most = std::min(hits.work + kMostWorkAlong, hits.stop);
  for (auto way = kFirstWayAlong; way < kBurialWays && hits.work < most; ++way) {
    const auto direction = ways.of(way);
    const auto ray = follow(start, way, direction, hits, notes);
    if (ray == Ray::kGivesUp) return false;
    if (ray == Ray::kLeaves) continue;
    auto there = firstMet(start, direction);
    hits.work += kWorkOfFirst;
    if (!there) return true;
    const glm::vec3 origin(there->origin - kBurialLift * glm::dvec3(there->normal));
    findAround({origin, origin}, Facing{there->normal, glm::dot(there->normal, origin)}, hits.beyond);
    there->around = &hits.beyond;
    const auto lies_in = liesInClosed(*there, hits, notes);
    if (hits.gave_up) return false;
    if (!(lies_in ? *lies_in : vote(*there, hits, notes).buried)) return !hits.gave_up;
  }
  return false;
}

/// Before the nearest face, or the sheet that it meets earlier. What it may lie in is not known yet.
std::optional<Solids::Start> Solids::firstMet(const Start& start, const glm::dvec3& direction) const {
  auto face = tree_.nearestHit(start.origin, direction, 0.0, kBurialRayLength);
  if (face) face = firstOfTied(tree_, start.origin, direction, *face);
  const double reach = face ? face->t : kBurialRayLength;
  const auto sheet = sheets_.empty() ? std::nullopt : sheets_.nearestHit(start.origin, direction, 0.0, reach);
  if (!sheet && !face) return std::nullopt;
  const double t = sheet ? sheet->t : face->t;
  glm::vec3 facing = sheet ? sheet_normal_[sheet->triangle] : normal_[face->triangle];
  if (sheet && !sheet->front) facing = -facing;
  const auto triangle = sheet ? static_cast<std::uint32_t>(normal_.size()) + sheet->triangle : face->triangle;
  return Start{start.origin + t * direction + kBurialLift * glm::dvec3(facing), facing, triangle, nullptr};
}

/// Where a ray from the place ends, if the place lies in a solid: before a sheet, or where it leaves the solid.
/// Otherwise leaves what it met in `hits`, in order: of the parts that the place may lie in, and no others.
Solids::Ray Solids::follow(const Start& start, std::uint32_t way, const glm::dvec3& direction, Hits& hits,
                           RayNotes* notes) const {
  const auto end =
      SolidTree::endOfSolid(start.around->trees, start.origin, direction, kBurialRayLength, hits, hits.work, hits.stop);
  if (!end && hits.work >= hits.stop) {
    hits.gave_up = true;
    return Ray::kGivesUp;
  }
  if (notes != nullptr) notes->add({start.origin, start.normal, start.triangle, way, end.value_or(kBurialRayLength)});
  if (!end) return Ray::kStays;
  return !sheets_.empty() && sheets_.meets(start.origin, direction, 0.0, *end) ? Ray::kEndsOnSheet : Ray::kLeaves;
}

Coincidence::Coincidence(PatchScene& patches) : patches_(patches), rank_(patches.triangles.size()) {
  std::vector<std::uint32_t> order(rank_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::uint32_t t) { return patches.seenOrder(t); });
  for (std::uint32_t i = 0; i < order.size(); ++i) rank_[order[i]] = i;
  std::vector<Bvh::Triangle> triangles;
  for (std::size_t t = 0; t < patches.triangles.size(); ++t)
    triangles.push_back({patches.vertices[patches.indices[3 * t]].position,
                         patches.vertices[patches.indices[3 * t + 1]].position,
                         patches.vertices[patches.indices[3 * t + 2]].position});
  std::vector<glm::vec3> normals;
  for (const auto& triangle : patches.triangles) normals.push_back(triangle.normal);
  faces_ = CoveringFaces(triangles, normals, rank_);
  tree_ = Bvh(std::move(triangles));
}

void Coincidence::run() {
  std::uint64_t count = 0;
  std::pair<std::uint32_t, std::uint32_t> first{kNone, kNone};
  const auto coplanar = coplanarWithOthers();
  std::vector<std::array<std::uint32_t, 2>> cover(patches_.surfaces.size());
  const auto findCover = [&](std::size_t i) {
    const auto s = static_cast<std::uint32_t>(i);
    for (std::uint32_t side = 0; side < 2; ++side)
      cover[s][side] = isLit(s, side) ? coveredBy(s, side, coplanar[slot(s, side)]) : kNone;
  };
  inTurns(cover.size(), findCover, cover.size() / kSurfacesAThread);
  for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
    interruptionPoint();
    auto by = kNone;
    for (const auto other : cover[s]) {
      covered_.push_back(other != kNone);
      if (by == kNone) by = other;
    }
    if (by == kNone) continue;
    if (count++ == 0) first = {by, s};
  }
  if (count == 0) return;
  patches_.warnings.push_back(
      fmt::format("{} surfaces lie exactly on another one that faces the same way and is seen instead, since it emits, "
                  "is opaque or is earlier (the first: surface {} of instance {} on surface {} of instance {})",
                  count, first.second, patches_.surfaces[first.second].instance, first.first,
                  patches_.surfaces[first.first].instance));
}

std::vector<bool> Coincidence::covered() const {
  std::vector<bool> of_surface(patches_.surfaces.size());
  for (std::uint32_t s = 0; s < of_surface.size(); ++s) of_surface[s] = covered_[slot(s, 0)] || covered_[slot(s, 1)];
  return of_surface;
}

glm::vec3 Coincidence::facing(std::uint32_t triangle, std::uint32_t side) const {
  const auto& normal = patches_.triangles[triangle].normal;
  return side == 0 ? normal : -normal;
}

/// The earliest that covers the triangle there.
Coincidence::Over Coincidence::over(std::uint32_t triangle, std::uint32_t side, const glm::vec3& position,
                                    std::uint64_t& work) const {
  const auto facing = this->facing(triangle, side);
  const auto own = patches_.triangle_surface[triangle];
  const auto sideOf = [&](const RayHit& hit) {
    return glm::dot(patches_.triangles[hit.triangle].normal, facing) > 0.0F ? 0U : 1U;
  };
  const auto counts = [&](const RayHit& hit) {
    const auto s = patches_.triangle_surface[hit.triangle];
    return s != own && std::abs(glm::dot(patches_.triangles[hit.triangle].normal, facing)) > kSameWay &&
           isLit(s, sideOf(hit));
  };
  const auto first = faces_.find({position, facing, kSameWay, kReachOfCover, rank_[triangle]}, counts, work);
  return first ? Over{first->triangle, sideOf(*first)} : Over{};
}

void Coincidence::keepCovered() {
  for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
    interruptionPoint();
    for (std::uint32_t side = 0; side < 2; ++side)
      if (covered_[slot(s, side)]) keepCovered(s, side);
  }
  std::ranges::stable_sort(patches_.covered, {}, &PatchScene::Covered::leaf);
}

void Coincidence::keepCovered(std::uint32_t s, std::uint32_t side) {
  const Surface& surface = patches_.surfaces[s];
  const auto triangle_on = trianglesOn(patches_, surface);
  for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
    if (patches_.node_area[surface.first_node[side] + i] > 0.0F || triangle_on[i] == kNone) continue;
    const TriangleFrame& frame = patches_.triangles[triangle_on[i]];
    // The middle of a texel that is wider than the surface may lie beside both.
    const glm::dvec2 corner(i % surface.width, i / surface.width);
    Over seen;
    std::uint64_t work = 0;
    for (std::uint32_t k = 0; k < kPlaces && seen.triangle == kNone; ++k) {
      seen = over(triangle_on[i], side, positionAt(frame, corner + latticePoint(k, kPlaces)), work);
    }
    if (seen.triangle == kNone) continue;
    const auto texel = texelAt(patches_.triangles[seen.triangle], positionAt(frame, corner + 0.5));
    patches_.covered.push_back(
        {surface.first_leaf + i, side, patches_.triangle_surface[seen.triangle], seen.side, texel});
  }
}

/// By surface and side: planar, in one plane with another that reaches into its bounds, and facing the same way.
/// Planes are sorted into cells of distance; twice, so that no pair lies on both sides of a cell's end.
std::vector<bool> Coincidence::coplanarWithOthers() const {
  std::vector<bool> found(2 * patches_.surfaces.size(), false);
  for (const double shift : {0.0, 0.5}) {
    auto planes = planesByDistance(shift);
    std::vector<FlatSide> together;
    for (auto first = planes.begin(), end = first; first != planes.end(); first = end) {
      end = std::find_if(first, planes.end(), [&](const Plane& plane) { return plane.cell != first->cell; });
      together.clear();
      interruptionPoint();
      for (auto plane = first; plane != end; ++plane) {
        const Surface& surface = patches_.surfaces[plane->surface];
        together.push_back(
            {surface.bounds_min, surface.bounds_max, facing(surface.first_triangle, plane->side), plane->surface});
      }
      const auto company = findCompany(together, {static_cast<float>(kSamePlane), kSameWay});
      for (std::size_t i = 0; i < company.size(); ++i)
        if (company[i])
          found[slot(first[static_cast<std::ptrdiff_t>(i)].surface, first[static_cast<std::ptrdiff_t>(i)].side)] = true;
    }
  }
  return found;
}

/// Of lit sides; cells are moved by `shift` of their width.
std::vector<Coincidence::Plane> Coincidence::planesByDistance(double shift) const {
  std::vector<Plane> planes;
  for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
    const Surface& surface = patches_.surfaces[s];
    for (std::uint32_t side = 0; side < 2; ++side) {
      if (!surface.planar || !isLit(s, side)) continue;
      const auto distance = static_cast<double>(
          glm::dot(facing(surface.first_triangle, side), patches_.triangles[surface.first_triangle].origin));
      planes.push_back({static_cast<std::int64_t>(std::floor(distance / kSamePlane + shift)), s, side});
    }
  }
  std::ranges::stable_sort(planes, {}, &Plane::cell);
  return planes;
}

bool Coincidence::mayCover(std::uint32_t s, std::uint32_t side, const Bounds& box) const {
  const glm::vec3 margin(2.0e-6F);
  return covered_[slot(s, side)] && tree_.touches(box.min - margin, box.max + margin, patches_.triangle_surface, s);
}

/// A surface found right before some of this surface's leaf points, or `closely`, at one of them at least.
std::uint32_t Coincidence::coveredBy(std::uint32_t s, std::uint32_t side, bool closely) const {
  const Surface& surface = patches_.surfaces[s];
  const std::uint32_t leaves = surface.width * surface.height;
  std::uint64_t work = 0;
  const std::uint32_t step = closely ? 1U : std::max(1U, leaves / 16);
  for (std::uint32_t i = step / 2; i < leaves; i += step) {
    const LeafPoint& point = patches_.leaves[surface.first_leaf + i];
    if (point.triangle == kNone) continue;
    const auto position = positionAt(patches_.triangles[point.triangle], glm::dvec2(point.texel));
    const auto seen = over(point.triangle, side, position, work);
    if (seen.triangle != kNone) return patches_.triangle_surface[seen.triangle];
  }
  return kNone;
}

}  // namespace radiosity::scene
