#include "server/scene/dark_air.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "common/parallel.h"

namespace radiosity::scene {
namespace {

/// Places on each side of a group, one for so many leaves, and in all.
constexpr double kLeavesAPlace = 16.0, kMostOfAGroup = 64.0, kMostPlaces = 32'768.0;
/// Of a place: paths before it counts as one that light may not reach, and rays that tell what it is in.
constexpr int kWalks = 8, kHops = 8, kMostHidden = 4, kMostOpen = 1;
/// Paths through a room. A hit within rounding of a wall of no thickness may go on beyond it, once in a million: fewer
/// than so many that come to light are no proof of it.
constexpr int kWalksARoom = 2048, kProof = 4;
/// Of a room so many places are kept, and a place that sees this many of them is in it: one may be beyond the wall.
constexpr std::size_t kPlacesKept = 64, kSights = 2, kMostRooms = 16;
/// What is as wide as this part of the scene, in all directions, lies around all else.
constexpr float kAroundAll = 0.9F;
/// Rooms reach farther than the places that were seen in them: into their corners, by this part of them, and rounding
/// (unit box).
constexpr float kBeyond = 0.1F, kAround = 1e-4F;

bool holds(const Bounds& bounds, const glm::vec3& point) {
  return glm::all(glm::lessThanEqual(bounds.min, point)) && glm::all(glm::lessThanEqual(point, bounds.max));
}

}  // namespace

DarkAir::DarkAir(const SideScene& scene, const geometry::RayScene& tree, double least_room)
    : scene_(scene), paths_(scene, tree), least_room_(least_room) {
  for (const auto& triangle : scene.triangles)
    for (const auto& corner : triangle) all_.add(corner);
}

DarkAir::End DarkAir::follow(Place at, const LightPaths::Near& near, Random& random, std::vector<Place>* seen) const {
  for (int hop = 0; hop < LightPaths::kHops; ++hop) {
    if (paths_.seesSource(at, near, random)) return End::kLight;
    const auto direction = LightPaths::drawDirection(at, random);
    geometry::Hit hit;
    if (!paths_.trace(at, direction, random, hit)) {
      if (paths_.skyShines(direction)) return End::kLight;
      return hop == 0 ? End::kOpen : End::kNowhere;
    }
    if (paths_.shines(hit)) return End::kLight;
    if (!paths_.goOn(direction, hit, at)) return hop == 0 ? End::kHidden : End::kNowhere;
    if (seen != nullptr) seen->push_back(at);
  }
  return End::kNowhere;
}

/// Within a solid, or something narrow, or in the open.
bool DarkAir::isNoRoom(const Place& at, Random& random) const {
  int hidden = 0, open = 0;
  float longest = 0.0F;
  for (int hop = 0; hop < kHops; ++hop) {
    const auto direction = LightPaths::drawDirection(at, random);
    geometry::Hit hit;
    Place next = at;
    if (!paths_.trace(at, direction, random, hit)) {
      ++open;
    } else {
      longest = std::max(longest, hit.t);
      hidden += paths_.goOn(direction, hit, next) ? 0 : 1;
    }
  }
  return hidden >= kMostHidden || open > kMostOpen || static_cast<double>(longest) < 0.5 * least_room_;
}

bool DarkAir::sees(const Place& at, const Place& there) const {
  const auto way = there.point - at.point;
  const double length = glm::length(way);
  if (length < 2.0 * LightPaths::kLift || glm::dot(way, at.normal) <= 0.0 || glm::dot(way, there.normal) >= 0.0)
    return false;
  return paths_.isFree(at, way / length, static_cast<float>(length));
}

DarkAir::Air DarkAir::airAt(const Place& at) const {
  for (const Room& room : rooms_) {
    if (!holds(room.bounds, glm::vec3(at.point))) continue;
    std::size_t seen = 0;
    for (const Place& there : room.places)
      if (sees(at, there) && ++seen == kSights) return room.is_dark ? Air::kDark : Air::kLit;
  }
  return Air::kUnknown;
}

/// The same, by what paths from there see as well; as if lit where one of them comes to light, or it is no room.
DarkAir::Air DarkAir::airAbout(const Place& at, std::uint64_t seed) const {
  Random random(seed);
  const auto near = paths_.nearTo(at.point);
  if (follow(at, near, random, nullptr) == End::kLight || isNoRoom(at, random)) return Air::kLit;
  if (const auto air = airAt(at); air != Air::kUnknown) return air;
  std::vector<Place> seen;
  for (int walk = 1; walk < kWalks; ++walk)
    if (follow(at, near, random, &seen) == End::kLight) return Air::kLit;
  for (const Place& place : seen)
    if (const auto air = airAt(place); air != Air::kUnknown) return air;
  return Air::kUnknown;
}

bool DarkAir::isRoom(const Bounds& bounds) const {
  const auto size = bounds.max - bounds.min;
  const auto narrowest = static_cast<double>(std::min({size.x, size.y, size.z}));
  return narrowest >= least_room_ && !glm::all(glm::greaterThanEqual(size, kAroundAll * (all_.max - all_.min)));
}

/// A room that nobody has been in.
void DarkAir::explore(const Place& at, std::uint64_t seed) {
  if (rooms_.size() >= kMostRooms) return;
  Random random(seed);
  const auto near = paths_.nearTo(at.point);
  Room room;
  room.places.push_back(at);
  std::vector<Place> seen;
  int lit = 0;
  for (int walk = 0; walk < kWalksARoom && lit < kProof; ++walk) {
    interruptionPoint();
    seen.clear();
    const Place from = room.places[LightPaths::drawIndex(room.places.size(), random)];
    if (follow(from, near, random, &seen) == End::kLight) {
      ++lit;
      continue;
    }
    for (const Place& place : seen) {
      room.bounds.add(glm::vec3(place.point));
      if (room.places.size() < kPlacesKept) {
        room.places.push_back(place);
      } else if (random() < 0.1) {
        room.places[LightPaths::drawIndex(kPlacesKept, random)] = place;
      }
    }
  }
  room.bounds.add(glm::vec3(at.point));
  room.is_dark = lit < kProof && isRoom(room.bounds);
  const auto beyond = kBeyond * (room.bounds.max - room.bounds.min) + kAround;
  room.bounds.min -= beyond;
  room.bounds.max += beyond;
  if (room.is_dark) bounds_.add(room.bounds);
  rooms_.push_back(std::move(room));
}

bool DarkAir::mayBeDark(const glm::dvec3& point) const {
  return std::ranges::any_of(rooms_,
                             [&](const Room& room) { return room.is_dark && holds(room.bounds, glm::vec3(point)); });
}

bool DarkAir::isDark(const Place& at, std::uint64_t seed) const {
  return mayBeDark(at.point) && airAbout(at, seed) == Air::kDark;
}

/// Walls of a room are not narrower than it.
bool DarkAir::isLarge(const SideScene::Group& group) const {
  Bounds bounds;
  for (auto t = group.first; t < group.first + group.count; ++t)
    for (const auto& corner : scene_.triangles[t]) bounds.add(corner);
  return group.count > 0 && static_cast<double>(glm::distance(bounds.min, bounds.max)) >= least_room_;
}

/// Adds those of some places that light may not reach.
void DarkAir::lookFrom(std::uint32_t g, std::uint32_t places, std::vector<Place>& unlit) const {
  const auto& group = scene_.groups[g];
  if (!isLarge(group)) return;
  Random random(0xDA12C000U + g);
  const auto near = paths_.nearTo(paths_.middleOf(group.first));
  for (std::uint32_t side = 0; side < (group.double_sided ? 2 : 1); ++side) {
    for (std::uint32_t i = 0; i < places; ++i) {
      const auto at = paths_.placeIn(group, side, random);
      if (follow(at, near, random, nullptr) == End::kLight) continue;
      if (!isNoRoom(at, random)) unlit.push_back(at);
    }
  }
}

bool DarkAir::find() {
  const auto wanted = [](const SideScene::Group& group) {
    return std::clamp(group.leaves / kLeavesAPlace, 1.0, kMostOfAGroup);
  };
  double all = 0.0;
  for (const auto& group : scene_.groups) all += wanted(group);
  const double part = std::min(1.0, kMostPlaces / std::max(all, 1.0));
  std::vector<std::vector<Place>> unlit(scene_.groups.size());
  inTurns(unlit.size(), [&](std::size_t g) {
    const auto places = std::max(1.0, part * wanted(scene_.groups[g]));
    lookFrom(static_cast<std::uint32_t>(g), static_cast<std::uint32_t>(places), unlit[g]);
  });
  std::uint64_t seed = 0;
  for (const auto& places : unlit) {
    for (const auto& at : places)
      if (++seed; airAbout(at, seed) == Air::kUnknown) explore(at, seed);
  }
  return !bounds_.empty();
}

}  // namespace radiosity::scene
