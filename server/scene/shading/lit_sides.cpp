#include "server/scene/shading/lit_sides.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "common/parallel.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/shading/mesh_parts.h"
#include "server/scene/shading/opacity.h"

namespace radiosity::scene {
namespace {

constexpr float kFar = 4.0F;      ///< unit box; longer than its diagonal
constexpr double kLift = 1.0e-5;  ///< unit box; rays start so far before their surface, well above rounding
/// Each lamp gets some, however many there are.
constexpr std::size_t kFewestPhotons = 4096, kPhotonsALamp = 64, kMostPhotons = 65536;
constexpr int kPhotonHops = 6;
/// Half of the lamps that paths ask are among the nearest to where the path began: in a building most are elsewhere.
constexpr std::size_t kNearest = 4;
/// Groups times lamps for which the nearest are looked for.
constexpr double kMostPairs = 2e7;
/// After eight diffuse bounces little light is left in any scene.
constexpr int kHops = 8;
constexpr int kMostSheets = 16;  ///< that a ray passes where one can see through
constexpr std::uint32_t kFewestWalks = 12, kWalksAgain = 256, kMostWalks = 1024;
constexpr double kLeavesAWalk = 4.0;
/// In all, about: a scene of a million loose double-sided faces takes seconds, and its sides are looked at from two
/// places each.
constexpr double kMostRays = 8e6;
constexpr int kSealRays = 128;  ///< a part, at least, and two a group

/// splitmix64 (Steele, Lea and Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15U) {}
  double operator()() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15U;
    z = (z ^ z >> 30U) * 0xBF58476D1CE4E5B9U;
    z = (z ^ z >> 27U) * 0x94D049BB133111EBU;
    return static_cast<double>((z ^ z >> 31U) >> 11U) * 0x1.0p-53;
  }

 private:
  std::uint64_t state_;
};

glm::dvec3 perpendicular(const glm::dvec3& n) {
  return glm::normalize(std::abs(n.x) < 0.6 ? glm::cross(n, glm::dvec3(1, 0, 0)) : glm::cross(n, glm::dvec3(0, 1, 0)));
}

/// About `axis`, by the cosine of the angle between the two.
glm::dvec3 around(const glm::dvec3& axis, double cosine, double turn) {
  const glm::dvec3 u = perpendicular(axis), v = glm::cross(axis, u);
  const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), phi = 2.0 * M_PI * turn;
  return axis * cosine + sine * (std::cos(phi) * u + std::sin(phi) * v);
}

/// A place right before a side of a triangle.
struct Place {
  glm::dvec3 point, normal;
  std::uint32_t triangle;
};

class Probe {
 public:
  Probe(const SideScene& scene, const std::vector<std::array<bool, 2>>& asked, const geometry::RayScene* tree)
      : scene_(scene),
        asked_(asked),
        own_tree_(tree != nullptr ? geometry::RayScene() : raySceneOf(scene.triangles)),
        tree_(tree != nullptr ? *tree : own_tree_),
        light_(scene.groups.size()),
        shines_(scene.groups.size(), false) {
    group_of_.resize(scene.triangles.size());
    areas_.resize(scene.triangles.size());
    for (std::uint32_t g = 0; g < scene.groups.size(); ++g) {
      const auto& group = scene.groups[g];
      double sum = 0.0;
      for (auto t = group.first; t < group.first + group.count; ++t) {
        interruptionPoint();
        group_of_[t] = g;
        sum += areaOf(t);
        areas_[t] = sum;
        if (!scene.emits[t]) continue;
        lamps_.push_back(t);
        shines_[g] = true;
      }
    }
    const double sides = 2.0 * static_cast<double>(scene.groups.size()), rays_a_walk = 2.0 * kHops;
    walks_allowed_ = static_cast<std::uint32_t>(std::clamp(kMostRays / rays_a_walk / std::max(sides, 1.0), 2.0, 1e6));
    double sum = 0.0;
    for (const auto t : lamps_) lamp_areas_.push_back(sum += areaOf(t));
  }

  std::vector<std::array<SideLight, 2>> run(LookFor how) {
    findParts();
    findSealed();
    markLamps();
    sendPhotons();
    if (how == LookFor::kPhotonsAndPaths) {
      lookAll(kFewestWalks);
      lookAgain();
    }
    std::vector<std::array<SideLight, 2>> result(scene_.groups.size(), {SideLight::kLit, SideLight::kLit});
    for (std::size_t g = 0; g < result.size(); ++g)
      for (std::size_t side = 0; side < 2; ++side)
        if (asked_[g][side]) result[g][side] = light_[g][side];
    return result;
  }

 private:
  [[nodiscard]] double areaOf(std::uint32_t t) const {
    const auto& c = scene_.triangles[t];
    return 0.5 * static_cast<double>(glm::length(glm::cross(c[1] - c[0], c[2] - c[0])));
  }
  [[nodiscard]] glm::dvec3 normalOf(std::uint32_t t) const {
    const auto& c = scene_.triangles[t];
    const glm::dvec3 a(c[0]), n = glm::cross(glm::dvec3(c[1]) - a, glm::dvec3(c[2]) - a);
    const double length = glm::length(n);
    return length > 0.0 ? n / length : glm::dvec3(0.0, 1.0, 0.0);
  }
  [[nodiscard]] const SideScene::Group& groupOf(std::uint32_t t) const { return scene_.groups[group_of_[t]]; }

  [[nodiscard]] Place placeOn(std::uint32_t triangle, std::uint32_t side, Random& random) const {
    const auto& c = scene_.triangles[triangle];
    const double root = std::sqrt(random()), v = random();
    const glm::dvec3 point =
        (1.0 - root) * glm::dvec3(c[0]) + root * (1.0 - v) * glm::dvec3(c[1]) + root * v * glm::dvec3(c[2]);
    const glm::dvec3 normal = side == 0 ? normalOf(triangle) : -normalOf(triangle);
    return {point + kLift * normal, normal, triangle};
  }

  [[nodiscard]] Place placeIn(const SideScene::Group& group, std::uint32_t side, Random& random) const {
    const auto first = areas_.begin() + group.first, end = first + group.count;
    const auto at = std::min(std::lower_bound(first, end, random() * *(end - 1)), end - 1);
    return placeOn(static_cast<std::uint32_t>(at - areas_.begin()), side, random);
  }

  /// Past what one can see through by chance, one time in two.
  [[nodiscard]] bool trace(const Place& from, const glm::dvec3& direction, Random& random, geometry::Hit& hit) const {
    glm::vec3 origin(from.point);
    auto own = from.triangle;
    float passed = 0.0F;
    for (int sheet = 0; sheet < kMostSheets; ++sheet) {
      hit = tree_.nearest({origin, glm::vec3(direction), kFar, own});
      if (!hit.found()) return false;
      origin += hit.t * glm::vec3(direction);
      hit.t = passed += hit.t;
      if (!groupOf(hit.triangle).see_through || random() < 0.5) return true;
      own = hit.triangle;
    }
    return true;
  }

  /// What one can see through hides nothing.
  [[nodiscard]] bool isFree(const Place& from, const glm::dvec3& way, float reach) const {
    glm::vec3 origin(from.point);
    auto own = from.triangle;
    for (int sheet = 0; sheet < kMostSheets; ++sheet) {
      const auto hit = tree_.nearest({origin, glm::vec3(way), reach, own});
      if (!hit.found()) return true;
      if (!groupOf(hit.triangle).see_through) return false;
      origin += hit.t * glm::vec3(way);
      reach -= hit.t;
      own = hit.triangle;
    }
    return false;
  }

  template <typename List>
  [[nodiscard]] static std::size_t drawIndex(const List& list, Random& random) {
    return std::min(static_cast<std::size_t>(random() * static_cast<double>(list.size())), list.size() - 1);
  }

  /// Lamps and lights about where a path begins.
  struct Near {
    std::vector<std::uint32_t> lamps, lights;
  };

  [[nodiscard]] Near nearTo(const glm::dvec3& place) const {
    Near near;
    const auto sources = static_cast<double>(lamps_.size() + scene_.lights.size());
    if (static_cast<double>(scene_.groups.size()) * sources > kMostPairs) return near;
    const auto take = [](std::vector<std::pair<double, std::uint32_t>>& all, std::vector<std::uint32_t>& into) {
      const auto few = std::min(kNearest, all.size());
      std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(few), all.end());
      for (std::size_t i = 0; i < few; ++i) into.push_back(all[i].second);
    };
    std::vector<std::pair<double, std::uint32_t>> lamps, lights;
    for (const auto t : lamps_) lamps.emplace_back(glm::distance(place, middleOf(t)), t);
    for (std::uint32_t i = 0; i < scene_.lights.size(); ++i) {
      if (scene_.lights[i].kind != LightKind::kDirectional)
        lights.emplace_back(glm::distance(place, scene_.lights[i].position), i);
    }
    take(lamps, near.lamps);
    take(lights, near.lights);
    return near;
  }
  [[nodiscard]] glm::dvec3 middleOf(std::uint32_t t) const {
    const auto& c = scene_.triangles[t];
    return glm::dvec3(c[0] + c[1] + c[2]) / 3.0;
  }

  [[nodiscard]] std::uint32_t drawLamp(Random& random) const {
    const auto at = std::ranges::lower_bound(lamp_areas_, random() * lamp_areas_.back());
    return lamps_[std::min<std::size_t>(static_cast<std::size_t>(at - lamp_areas_.begin()), lamps_.size() - 1)];
  }
  [[nodiscard]] std::uint32_t drawLampSide(std::uint32_t lamp, Random& random) const {
    return groupOf(lamp).double_sided && random() < 0.5 ? 1 : 0;
  }

  [[nodiscard]] bool seesLamp(const Place& at, const Near& near, Random& random) const {
    const auto lamp =
        near.lamps.empty() || random() < 0.5 ? drawLamp(random) : near.lamps[drawIndex(near.lamps, random)];
    const Place there = placeOn(lamp, drawLampSide(lamp, random), random);
    const glm::dvec3 way = there.point - at.point;
    if (glm::dot(way, at.normal) <= 0.0 || glm::dot(way, there.normal) >= 0.0) return false;
    const double length = glm::length(way);
    return length > 0.0 && isFree(at, way / length, static_cast<float>(length - kLift));
  }

  /// Of one with a size, any of its points.
  [[nodiscard]] static glm::dvec3 pointOf(const PunctualLight& light, Random& random) {
    if (!(light.half.x > 0.0) || light.kind == LightKind::kDirectional) return light.position;
    if (light.kind == LightKind::kPoint)
      return light.position + light.half.x * around({0, 1, 0}, 1.0 - 2.0 * random(), random());
    const auto up = glm::cross(light.direction, light.across);
    if (light.kind == LightKind::kRectangle)
      return light.position + (2.0 * random() - 1.0) * light.half.x * light.across +
             (2.0 * random() - 1.0) * light.half.y * up;
    const auto rim = around(light.direction, 0.0, random());
    return light.position + light.half.x * std::sqrt(random()) * rim;
  }

  [[nodiscard]] bool seesLight(const Place& at, const Near& near, Random& random) const {
    const bool any = near.lights.empty() || random() < 0.5;
    const auto& light =
        scene_.lights[any ? drawIndex(scene_.lights, random) : near.lights[drawIndex(near.lights, random)]];
    if (light.kind == LightKind::kDirectional)
      return glm::dot(light.direction, at.normal) < 0.0 && isFree(at, -light.direction, kFar);
    const glm::dvec3 way = pointOf(light, random) - at.point;
    const double length = glm::length(way);
    if (!(length > 0.0) || glm::dot(way, at.normal) <= 0.0 || (light.range > 0.0 && length >= light.range))
      return false;
    if (light.kind == LightKind::kSpot && -glm::dot(way, light.direction) < length * std::cos(light.outer_cone_rad))
      return false;
    const bool is_flat = light.kind == LightKind::kRectangle || light.kind == LightKind::kDisc;
    if (is_flat && glm::dot(way, light.direction) >= 0.0) return false;
    return isFree(at, way / length, static_cast<float>(length));
  }

  [[nodiscard]] bool skyShines(const glm::dvec3& direction) const { return isBright(scene_.sky, direction.y > 0.0); }

  /// Where a path that met a surface goes on: before the side that it came from. False: that side absorbs.
  [[nodiscard]] bool goOn(const glm::dvec3& direction, const geometry::Hit& hit, Place& at) const {
    if (!hit.front && !groupOf(hit.triangle).double_sided) return false;
    const glm::dvec3 normal = hit.front ? normalOf(hit.triangle) : -normalOf(hit.triangle);
    at = {at.point + static_cast<double>(hit.t) * direction + kLift * normal, normal, hit.triangle};
    return true;
  }

  /// Whether a path from there comes to light. `open`: set where it leaves the scene.
  [[nodiscard]] bool findsLight(Place at, const Near& near, Random& random, bool& open) const {
    for (int hop = 0; hop < kHops; ++hop) {
      if (!lamps_.empty() && seesLamp(at, near, random)) return true;
      if (!scene_.lights.empty() && seesLight(at, near, random)) return true;
      const auto direction = around(at.normal, std::sqrt(random()), random());
      geometry::Hit hit;
      if (!trace(at, direction, random, hit)) {
        open = true;
        return skyShines(direction);
      }
      if (scene_.emits[hit.triangle] && (hit.front || groupOf(hit.triangle).double_sided)) return true;
      if (!goOn(direction, hit, at)) return false;
    }
    return false;
  }

  void findParts() {
    std::vector<std::uint32_t> instances;
    for (const auto& group : scene_.groups) instances.push_back(group.instance);
    parts_ = findMeshParts(scene_.triangles, group_of_, instances);
    // A group without triangles is of no part.
    std::ranges::replace(parts_.of_group, kNone, 0U);
  }

  /// Sides of parts from which one sees nothing but the same side of the same part: the inside of a closed solid.
  void findSealed() {
    const auto parts = parts_.closed.size();
    std::vector<std::vector<std::uint32_t>> groups(parts);
    for (std::uint32_t g = 0; g < scene_.groups.size(); ++g) groups[parts_.of_group[g]].push_back(g);
    sealed_.assign(parts, {false, false});
    inTurns(parts, [&](std::size_t part) {
      if (!parts_.closed[part]) return;
      for (std::uint32_t side = 0; side < 2; ++side)
        sealed_[part][side] = isSealed(static_cast<std::uint32_t>(part), groups[part], side);
    });
  }

  [[nodiscard]] bool isSealed(std::uint32_t part, const std::vector<std::uint32_t>& groups, std::uint32_t side) const {
    Random random(2 * std::uint64_t{part} + side + 1);
    const auto rays = std::max<std::size_t>(2, kSealRays / std::max<std::size_t>(groups.size(), 1));
    for (const auto g : groups) {
      const auto& group = scene_.groups[g];
      // Of a closed shell that shines all over the front is taken for the side that one sees.
      if (!group.double_sided || group.see_through || (shines_[g] && side == 0)) return false;
      for (std::size_t ray = 0; ray < rays; ++ray) {
        const Place at = placeIn(group, side, random);
        const auto direction = around(at.normal, std::sqrt(random()), random());
        const auto hit = tree_.nearest({glm::vec3(at.point), glm::vec3(direction), kFar, at.triangle});
        if (!hit.found()) return false;
        if (parts_.of_group[group_of_[hit.triangle]] != part || hit.front != (side == 0)) return false;
      }
    }
    return !groups.empty();
  }

  void sendPhotons() {
    const auto sources = (lamps_.empty() ? 0 : 1) + (scene_.lights.empty() ? 0 : 1);
    if (sources == 0) return;
    Random random(0x50A0);
    const auto lamps = static_cast<std::size_t>(std::ranges::count(shines_, true)) + scene_.lights.size();
    const auto photons = std::clamp(kPhotonsALamp * lamps, kFewestPhotons, kMostPhotons);
    for (std::size_t photon = 0; photon < photons; ++photon) {
      const bool from_lamp = !lamps_.empty() && (scene_.lights.empty() || photon % 2 == 0);
      from_lamp ? sendFromLamp(random) : sendFromLight(random);
    }
  }

  void sendFromLamp(Random& random) {
    const auto lamp = drawLamp(random);
    const auto side = drawLampSide(lamp, random);
    if (sealed_[parts_.of_group[group_of_[lamp]]][side]) return;
    const Place at = placeOn(lamp, side, random);
    follow(at, around(at.normal, std::sqrt(random()), random()), random);
  }

  void sendFromLight(Random& random) {
    const auto& light = scene_.lights[drawIndex(scene_.lights, random)];
    if (light.kind == LightKind::kDirectional) return;  // the paths that look for it find it
    const bool spot = light.kind == LightKind::kSpot;
    const bool is_flat = light.kind == LightKind::kRectangle || light.kind == LightKind::kDisc;
    const double least = spot ? std::cos(std::min(light.outer_cone_rad, M_PI)) : is_flat ? 0.0 : -1.0;
    const auto direction =
        around(spot || is_flat ? light.direction : glm::dvec3(0, 1, 0), 1.0 - random() * (1.0 - least), random());
    const auto from = light.half.x > 0.0 ? pointOf(light, random) : light.position;
    follow({from, direction, kNone}, direction, random);
  }

  void follow(Place at, glm::dvec3 direction, Random& random) {
    for (int hop = 0; hop < kPhotonHops; ++hop) {
      geometry::Hit hit;
      if (!trace(at, direction, random, hit) || !goOn(direction, hit, at)) return;
      light_[group_of_[hit.triangle]][hit.front ? 0 : 1] = SideLight::kLit;
      direction = around(at.normal, std::sqrt(random()), random());
    }
  }

  void markLamps() {
    for (std::uint32_t g = 0; g < scene_.groups.size(); ++g)
      for (std::size_t side = 0; side < 2; ++side)
        if (shines_[g] && !sealed_[parts_.of_group[g]][side]) light_[g][side] = SideLight::kLit;
  }

  /// From at least so many places.
  void lookAll(std::uint32_t fewest) {
    inTurns(scene_.groups.size(), [&](std::size_t g) {
      for (std::uint32_t side = 0; side < 2; ++side) look(static_cast<std::uint32_t>(g), side, fewest);
    });
  }

  /// Where light reaches one side of a part it is likely to reach the others: these are looked at from more places.
  void lookAgain() {
    std::vector<std::array<bool, 2>> lit(parts_.closed.size(), {false, false});
    for (std::size_t g = 0; g < light_.size(); ++g)
      for (std::size_t side = 0; side < 2; ++side)
        if (light_[g][side] == SideLight::kLit) lit[parts_.of_group[g]][side] = true;
    inTurns(scene_.groups.size(), [&](std::size_t g) {
      for (std::uint32_t side = 0; side < 2; ++side)
        if (lit[parts_.of_group[g]][side]) look(static_cast<std::uint32_t>(g), side, kWalksAgain);
    });
  }

  void look(std::uint32_t g, std::uint32_t side, std::uint32_t fewest) {
    const auto& group = scene_.groups[g];
    auto& light = light_[g][side];
    if (!asked_[g][side] || light == SideLight::kLit || group.count == 0) return;
    if (sealed_[parts_.of_group[g]][side]) return;
    const auto walks = std::min(
        walks_allowed_,
        std::clamp(static_cast<std::uint32_t>(std::min(group.leaves, 1e6) / kLeavesAWalk), fewest, kMostWalks));
    Random random((2 * std::uint64_t{g} + side + 1) << 20U | fewest);
    const Near near = nearTo(middleOf(group.first));
    bool open = light == SideLight::kDark || !parts_.closed[parts_.of_group[g]];
    for (std::uint32_t walk = 0; walk < walks; ++walk) {
      if (!findsLight(placeIn(group, side, random), near, random, open)) continue;
      light = SideLight::kLit;
      return;
    }
    light = open ? SideLight::kDark : SideLight::kSealed;
  }

  const SideScene& scene_;
  const std::vector<std::array<bool, 2>>& asked_;
  geometry::RayScene own_tree_;  ///< where none was at hand
  const geometry::RayScene& tree_;
  std::vector<std::array<SideLight, 2>> light_;  ///< by group and side; first kSealed
  std::vector<bool> shines_;                     ///< by group: some of its triangles do
  MeshParts parts_;
  std::vector<std::array<bool, 2>> sealed_;   ///< by part and side
  std::vector<std::uint32_t> group_of_;       ///< by triangle
  std::vector<double> areas_;                 ///< by triangle: of its group's up to and with it
  std::vector<std::uint32_t> lamps_;          ///< triangles that shine
  std::vector<double> lamp_areas_;            ///< likewise, summed up
  std::uint32_t walks_allowed_ = kMostWalks;  ///< from a side
};

}  // namespace

bool passesLight(const Material& material) { return isSeeThrough(material) || material.isTranslucent(); }

bool SideScene::shines() const {
  return isBright(sky, true) || isBright(sky, false) || !lights.empty() ||
         std::ranges::find(emits, true) != emits.end();
}

std::vector<std::array<SideLight, 2>> lightOnSides(const SideScene& scene,
                                                   const std::vector<std::array<bool, 2>>& asked, LookFor how,
                                                   const geometry::RayScene* tree) {
  if (!scene.shines()) return {scene.groups.size(), {SideLight::kLit, SideLight::kLit}};
  return Probe(scene, asked, tree).run(how);
}

std::vector<PunctualLight> lightsInUnitBox(const Scene& scene, const glm::dvec3& centre, double scale) {
  std::vector<PunctualLight> lights;
  for (PunctualLight light : scene.lights) {
    if (!isBright(light.intensity)) continue;
    light.position = (light.position - centre) / scale;
    light.range /= scale;
    light.half /= scale;
    lights.push_back(light);
  }
  if (scene.sky && scene.sky->sun && isBright(scene.sky->sun->illuminance)) {
    const auto& sun = *scene.sky->sun;
    lights.push_back({.kind = LightKind::kDirectional, .direction = -sun.direction, .intensity = sun.illuminance});
  }
  return lights;
}

}  // namespace radiosity::scene
