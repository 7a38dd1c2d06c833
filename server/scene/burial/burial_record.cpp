#include "server/scene/burial/burial_record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <numbers>
#include <tuple>

#include "server/geometry/solid_parts.h"
#include "server/scene/values/lineage.h"

namespace radiosity::scene {
namespace {

/// Rays along a surface rise by this part of their length: through any gap that is wider than a thousandth of its
/// depth.
constexpr double kGrazing = 2e-4;
/// Boxes are larger by this (unit box) than what is in them: well above what rounding moves rays and positions.
constexpr float kMargin = 1e-5F;
/// And by this where it is places in them that count: rays start a little before these.
constexpr auto kPlacesMargin = static_cast<float>(4.0 * kBurialLift);
/// Rays that pass the boxes around all that changed are held against so many surfaces of it one by one.
constexpr std::size_t kMostBoxes = 128;
constexpr std::uint32_t kHemisphere = kFirstWayAlong - 1, kAlong = kBurialWays - kFirstWayAlong;

/// Of the four bits that number a way into the hemisphere.
static_assert(kHemisphere == 16);
constexpr std::uint32_t reversed(std::uint32_t i) {
  return (i & 1U) << 3U | (i & 2U) << 1U | (i & 4U) >> 1U | (i & 8U) >> 3U;
}

/// About the normal, and how far up and away from it.
struct Turn {
  double cosine, sine, up, out;
};
/// By way. Odd angles, so that no ray runs along modelled edges; into the hemisphere each lies between the others, and
/// the first few are spread as all are.
const std::array<Turn, kBurialWays>& turns() {
  static const auto all = [] {
    std::array<Turn, kBurialWays> made{};
    const auto set = [&](std::uint32_t way, double angle, double up, double out) {
      made[way] = {std::cos(angle), std::sin(angle), up, out};
    };
    for (std::uint32_t i = 0; i < kHemisphere; ++i) {
      const double square = (reversed(i) + 0.5) / kHemisphere;
      set(1 + i, 0.3217 + 2.0 * M_PI * i / std::numbers::phi, std::sqrt(1.0 - square), std::sqrt(square));
    }
    for (std::uint32_t i = 0; i < kAlong; ++i) set(kFirstWayAlong + i, 0.2871 + 2.0 * M_PI * i / kAlong, kGrazing, 1.0);
    return made;
  }();
  return all;
}

/// Those of which some surface is marked. `part_of`: by triangle, one of `count`, or kNone.
std::vector<bool> partsWithMarked(const PatchScene& patches, std::span<const std::uint32_t> part_of, std::size_t count,
                                  const std::vector<bool>& marked) {
  std::vector<bool> parts(count, false);
  for (std::size_t t = 0; t < part_of.size(); ++t) {
    if (part_of[t] != kNone && marked[patches.triangle_surface[t]]) parts[part_of[t]] = true;
  }
  return parts;
}

/// Marks the other surfaces of closed solids, and of what is hollow, that have one among those marked.
void markParts(const PatchScene& patches, std::vector<bool>& marked) {
  const auto& solids = patches.solids;
  const auto solid = partsWithMarked(patches, solids.solid_of, solids.bounds.size(), marked);
  const auto hollow = partsWithMarked(patches, solids.hollow_of, solids.hollows.size(), marked);
  for (std::size_t t = 0; t < solids.solid_of.size(); ++t) {
    const bool is_of_solid = solids.solid_of[t] != kNone && solid[solids.solid_of[t]];
    const bool is_of_hollow = solids.hollow_of[t] != kNone && hollow[solids.hollow_of[t]];
    if (is_of_solid || is_of_hollow) marked[patches.triangle_surface[t]] = true;
  }
}

/// Around what is marked and has faces that are no part of anything.
void addLoose(const PatchScene& patches, const std::vector<bool>& marked, Bounds& box) {
  const auto& solids = patches.solids;
  for (std::size_t t = 0; t < solids.solid_of.size(); ++t) {
    const auto& surface = patches.surfaces[patches.triangle_surface[t]];
    if (solids.solid_of[t] != kNone || solids.hollow_of[t] != kNone || !marked[patches.triangle_surface[t]]) continue;
    box.add(surface.bounds_min - kMargin);
    box.add(surface.bounds_max + kMargin);
  }
}

/// Marks the surfaces of parts that reach into a box.
void markPartsIn(const PatchScene& patches, const Bounds& box, std::vector<bool>& marked) {
  const auto& solids = patches.solids;
  const auto reaches = [&](const ClosedSolids::Bounds& part) {
    return glm::all(glm::lessThanEqual(part.low, box.max)) && glm::all(glm::lessThanEqual(box.min, part.high));
  };
  for (std::size_t t = 0; t < solids.solid_of.size(); ++t) {
    const auto solid = solids.solid_of[t], hollow = solids.hollow_of[t];
    if ((solid != kNone && reaches(solids.bounds[solid])) || (hollow != kNone && reaches(solids.hollows[hollow])))
      marked[patches.triangle_surface[t]] = true;
  }
}

/// Whether leaves are looked at in as many places.
bool sameOf(BurialRecord::Pass pass, const BurialPlaces& a, const BurialPlaces& b) {
  return a.many == b.many && a.finer == b.finer && a.work_each == b.work_each &&
         (pass == BurialRecord::Pass::kFew ? a.few == b.few : a.beside == b.beside);
}

}  // namespace

BurialWays::BurialWays(const glm::vec3& normal) : n_(normal) {
  const glm::dvec3 reference = std::abs(n_.x) < 0.8 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  u_ = glm::normalize(glm::cross(reference, n_));
  v_ = glm::cross(n_, u_);
}

glm::dvec3 BurialWays::of(std::uint32_t way) const {
  if (way == 0) return n_ + 0.0713 * u_ + 0.0427 * v_;
  const auto& turn = turns()[way];
  return turn.up * n_ + turn.out * (turn.cosine * u_ + turn.sine * v_);
}

bool RayFan::mayMeet(std::span<const ChangedBox> boxes) const {
  const glm::dvec3 low(origins.min), high(origins.max);
  const glm::dvec3 middle = 0.5 * (low + high), half = 0.5 * (high - low) + static_cast<double>(kMargin);
  const BurialWays all(normal);
  for (std::uint32_t way = 0; way < kBurialWays; ++way) {
    if ((ways >> way & 1U) == 0) continue;
    const auto direction = all.of(way);
    for (const auto& box : boxes) {
      if (sweeps(middle, half, direction, reach, box)) return true;
    }
  }
  return false;
}

void RayNotes::add(const Ray& ray) {
  const auto isWhole = [](double reach) { return reach >= kBurialRayLength; };
  const auto same = [&](const RayFan& fan) {
    return fan.from == ray.from && fan.normal == ray.normal && isWhole(fan.reach) == isWhole(ray.reach);
  };
  auto fan = std::ranges::find_if(fans_, same);
  if (fan == fans_.end()) {
    fans_.push_back({{}, ray.normal, ray.from, 0, 0.0});
    fan = std::prev(fans_.end());
  }
  fan->origins.add(glm::vec3(ray.origin));
  fan->ways |= 1U << ray.way;
  fan->reach = std::max(fan->reach, ray.reach);
}

void BurialRecord::sort() {
  std::ranges::sort(leaves, {}, [](const Leaf& leaf) { return std::tuple(leaf.leaf, leaf.side, leaf.pass); });
}

const BurialRecord::Leaf* BurialRecord::find(std::uint32_t leaf, std::uint32_t side, Pass pass) const {
  const auto key = [](const Leaf& entry) { return std::tuple(entry.leaf, entry.side, entry.pass); };
  const auto found = std::ranges::lower_bound(leaves, std::tuple(leaf, side, pass), {}, key);
  return found == leaves.end() || key(*found) != std::tuple(leaf, side, pass) ? nullptr : &*found;
}

FormerBurial::FormerBurial(const PatchScene& before, const BurialRecord& record, const PatchScene& after,
                           std::vector<std::uint32_t> surface_before, const std::vector<Hides>& hides)
    : before_(before), record_(record), after_(after), surface_before_(std::move(surface_before)) {
  std::vector<bool> stayed(before.surfaces.size(), false);
  const auto add = [&](const Surface& surface) {
    boxes_.push_back({surface.bounds_min - kMargin, surface.bounds_max + kMargin});
  };
  findChanged(hides);
  for (std::uint32_t s = 0; s < after.surfaces.size(); ++s) {
    const auto former = surface_before_[s];
    if (former != kNone) {
      stayed[former] = true;
    } else if (hides[s] != Hides::kNothing) {
      add(after.surfaces[s]);
    }
  }
  for (std::uint32_t s = 0; s < before.surfaces.size(); ++s) {
    if (!stayed[s] && record.hides[s] != Hides::kNothing) add(before.surfaces[s]);
  }
  if (boxes_.size() <= kMostBoxes) parts_ = boxes_;
  joinBoxes(boxes_);
  Bounds all;
  for (const auto& box : boxes_) {
    all.add(box.low);
    all.add(box.high);
  }
  if (!boxes_.empty()) around_.push_back({all.min, all.max});
}

/// What is a part of a closed solid that has changed counts as changed itself: the solid may be closed no longer, or
/// just so now, and then its faces count for other places than before (SolidParts). So do all places in it, of which
/// more is asked where it is open, and parts that hold, or held, something that is no part itself.
void FormerBurial::findChanged(const std::vector<Hides>& hides) {
  std::vector<bool> gone(before_.surfaces.size(), true), is_new(after_.surfaces.size(), false);
  for (std::uint32_t s = 0; s < is_new.size(); ++s) {
    const auto former = surface_before_[s];
    is_new[s] = former == kNone || record_.hides[former] != hides[s];
    if (!is_new[s]) gone[former] = false;
  }
  const auto forgetThose = [&] {
    for (std::uint32_t s = 0; s < is_new.size(); ++s) {
      auto& former = surface_before_[s];
      if (former == kNone || !(is_new[s] || gone[former])) continue;
      is_new[s] = gone[former] = true;
      former = kNone;
    }
  };
  const auto isTooMany = [](const ClosedSolids& solids) {
    return solids.bounds.size() + solids.hollows.size() > SolidParts::kMostParts;
  };
  if (isTooMany(before_.solids) || isTooMany(after_.solids)) is_new.assign(is_new.size(), true);
  markParts(before_, gone);
  markParts(after_, is_new);
  forgetThose();
  Bounds loose;
  addLoose(before_, gone, loose);
  addLoose(after_, is_new, loose);
  if (!loose.empty()) {
    markPartsIn(before_, loose, gone);
    markPartsIn(after_, loose, is_new);
    forgetThose();
  }
  addParts(before_, gone);
  addParts(after_, is_new);
}

/// Around places of which more or less is asked.
void FormerBurial::addParts(const PatchScene& patches, const std::vector<bool>& changed) {
  const auto& solids = patches.solids;
  const auto add = [&](std::span<const std::uint32_t> part_of, std::span<const ClosedSolids::Bounds> bounds) {
    const auto parts = partsWithMarked(patches, part_of, bounds.size(), changed);
    for (std::size_t i = 0; i < parts.size(); ++i)
      if (parts[i]) boxes_.push_back({bounds[i].low - kPlacesMargin, bounds[i].high + kPlacesMargin});
  };
  add(solids.solid_of, solids.bounds);
  add(solids.hollow_of, solids.hollows);
}

const BurialRecord::Leaf* FormerBurial::find(std::uint32_t surface, std::uint32_t leaf, std::uint32_t side,
                                             BurialRecord::Pass pass, const BurialPlaces& places) const {
  const auto former = surface_before_[surface];
  if (former == kNone || record_.covered[former] || !sameOf(pass, record_.places, places)) return nullptr;
  const auto* found = record_.find(before_.surfaces[former].first_leaf + leaf, side, pass);
  const auto meets = [&](const RayFan& fan) {
    return fan.mayMeet(around_) && fan.mayMeet(boxes_) && (parts_.empty() || fan.mayMeet(parts_));
  };
  return found == nullptr || std::ranges::any_of(found->found->fans, meets) ? nullptr : found;
}

BuriedPart FormerBurial::renumbered(const BurialRecord::Found& found, std::uint32_t surface) const {
  const Surface& to = after_.surfaces[surface];
  const auto number = [&](std::uint32_t& triangle) {
    if (triangle != kNone) triangle = triangle - found.first_triangle + to.first_triangle;
  };
  BuriedPart after = *found.buried;
  after.leaf = after.leaf - found.first_leaf + to.first_leaf;
  number(after.point.triangle);
  for (auto& triangle : after.visible.triangles) number(triangle);
  return after;
}

}  // namespace radiosity::scene
