// Rooms that no light reaches although one may stand in them: closed huts, dark halves of divided rooms. Leaves that
// lie on both sides of their walls must not carry light in (dark_texels.h).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/bounds.h"
#include "server/scene/light_paths.h"

namespace radiosity::scene {

/// A random test, and the same for the same scene: a room that light enters by less than about one path in a thousand
/// counts as dark. What is narrower than `least_room` is none (a cupboard, a hollow leg), nor is what lies around all
/// else: nobody stands there, and a rim in the light would be seen. In `SideScene` groups are double-sided of which one
/// sees both sides. Refers to its parts.
class DarkAir {
 public:
  DarkAir(const SideScene& scene, const geometry::RayScene& tree, double least_room);

  /// Looks about from places on all that one sees. False: there is no dark room. A few rays a place, of which there are
  /// 32,768 at most, and up to 32,000 in each room that may be dark.
  [[nodiscard]] bool find();
  /// Around all dark rooms.
  [[nodiscard]] const Bounds& bounds() const { return bounds_; }
  /// False: the point lies in none.
  [[nodiscard]] bool mayBeDark(const glm::dvec3& point) const;
  /// Whether the place is in a dark room. `seed`: the same for no two places.
  [[nodiscard]] bool isDark(const LightPaths::Place& at, std::uint64_t seed) const;

 private:
  using Place = LightPaths::Place;
  /// What becomes of a path: it comes to light; its first hop ends on what nobody sees, or leaves the scene; or not.
  enum class End { kLight, kHidden, kOpen, kNowhere };
  enum class Air { kLit, kDark, kUnknown };
  /// Air in which all is in sight of each other, from one place to the next.
  struct Room {
    std::vector<Place> places;  ///< some
    Bounds bounds;              ///< around all that were seen
    bool is_dark = false;
  };
  [[nodiscard]] End follow(Place at, const LightPaths::Near& near, Random& random, std::vector<Place>* seen) const;
  [[nodiscard]] bool isNoRoom(const Place& at, Random& random) const;
  [[nodiscard]] Air airAt(const Place& at) const;
  [[nodiscard]] bool sees(const Place& at, const Place& there) const;
  [[nodiscard]] Air airAbout(const Place& at, std::uint64_t seed) const;
  void explore(const Place& at, std::uint64_t seed);
  [[nodiscard]] bool isRoom(const Bounds& bounds) const;
  [[nodiscard]] bool isLarge(const SideScene::Group& group) const;
  void lookFrom(std::uint32_t group, std::uint32_t places, std::vector<Place>& unlit) const;

  const SideScene& scene_;
  const LightPaths paths_;
  double least_room_;
  Bounds all_;
  std::vector<Room> rooms_;
  Bounds bounds_;
};

}  // namespace radiosity::scene
