#include "server/scene/lit_sides.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "common/parallel.h"
#include "server/scene/emitters.h"
#include "server/scene/light_paths.h"
#include "server/scene/mesh_parts.h"

namespace radiosity::scene {
namespace {

/// Each lamp gets some, however many there are.
constexpr std::size_t kFewestPhotons = 4096, kPhotonsALamp = 64, kMostPhotons = 65536;
constexpr int kPhotonHops = 6;
constexpr std::uint32_t kFewestWalks = 12, kWalksAgain = 256, kMostWalks = 1024;
constexpr double kLeavesAWalk = 4.0;
/// In all, about: a scene of a million loose double-sided faces takes seconds, and its sides are looked at from two
/// places each.
constexpr double kMostRays = 8e6;
constexpr int kSealRays = 128;  ///< a part, at least, and two a group

using Place = LightPaths::Place;

class Probe {
 public:
  Probe(const SideScene& scene, const std::vector<std::array<bool, 2>>& asked, const geometry::RayScene* tree)
      : scene_(scene),
        asked_(asked),
        own_tree_(tree != nullptr ? geometry::RayScene() : raySceneOf(scene.triangles)),
        tree_(tree != nullptr ? *tree : own_tree_),
        paths_(scene, tree_),
        light_(scene.groups.size()),
        shines_(scene.groups.size(), false) {
    for (const auto lamp : paths_.lamps()) shines_[paths_.groupNumber(lamp)] = true;
    const double sides = 2.0 * static_cast<double>(scene.groups.size()), rays_a_walk = 2.0 * LightPaths::kHops;
    walks_allowed_ = static_cast<std::uint32_t>(std::clamp(kMostRays / rays_a_walk / std::max(sides, 1.0), 2.0, 1e6));
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
  void findParts() {
    std::vector<std::uint32_t> instances;
    for (const auto& group : scene_.groups) instances.push_back(group.instance);
    parts_ = findMeshParts(scene_.triangles, paths_.groups(), instances);
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
        const Place at = paths_.placeIn(group, side, random);
        const auto direction = LightPaths::around(at.normal, std::sqrt(random()), random());
        const auto hit = tree_.nearest({glm::vec3(at.point), glm::vec3(direction), LightPaths::kFar, at.triangle});
        if (!hit.found()) return false;
        if (parts_.of_group[paths_.groupNumber(hit.triangle)] != part || hit.front != (side == 0)) return false;
      }
    }
    return !groups.empty();
  }

  void sendPhotons() {
    const auto sources = (paths_.lamps().empty() ? 0 : 1) + (scene_.lights.empty() ? 0 : 1);
    if (sources == 0) return;
    Random random(0x50A0);
    const auto lamps = static_cast<std::size_t>(std::ranges::count(shines_, true)) + scene_.lights.size();
    const auto photons = std::clamp(kPhotonsALamp * lamps, kFewestPhotons, kMostPhotons);
    for (std::size_t photon = 0; photon < photons; ++photon) {
      const bool from_lamp = !paths_.lamps().empty() && (scene_.lights.empty() || photon % 2 == 0);
      from_lamp ? sendFromLamp(random) : sendFromLight(random);
    }
  }

  void sendFromLamp(Random& random) {
    const auto lamp = paths_.drawLamp(random);
    const auto side = paths_.drawLampSide(lamp, random);
    if (sealed_[parts_.of_group[paths_.groupNumber(lamp)]][side]) return;
    const Place at = paths_.placeOn(lamp, side, random);
    follow(at, LightPaths::around(at.normal, std::sqrt(random()), random()), random);
  }

  void sendFromLight(Random& random) {
    const auto& light = scene_.lights[LightPaths::drawIndex(scene_.lights.size(), random)];
    if (light.kind == LightKind::kDirectional) return;  // the paths that look for it find it
    const bool spot = light.kind == LightKind::kSpot;
    const double least = spot ? std::cos(std::min(light.outer_cone_rad, M_PI)) : -1.0;
    const auto direction =
        LightPaths::around(spot ? light.direction : glm::dvec3(0, 1, 0), 1.0 - random() * (1.0 - least), random());
    follow({light.position, direction, kNone}, direction, random);
  }

  void follow(Place at, glm::dvec3 direction, Random& random) {
    for (int hop = 0; hop < kPhotonHops; ++hop) {
      geometry::Hit hit;
      if (!paths_.trace(at, direction, random, hit) || !paths_.goOn(direction, hit, at)) return;
      light_[paths_.groupNumber(hit.triangle)][hit.front ? 0 : 1] = SideLight::kLit;
      direction = LightPaths::around(at.normal, std::sqrt(random()), random());
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
    const auto near = paths_.nearTo(paths_.middleOf(group.first));
    bool open = light == SideLight::kDark || !parts_.closed[parts_.of_group[g]];
    for (std::uint32_t walk = 0; walk < walks; ++walk) {
      if (!paths_.findsLight(paths_.placeIn(group, side, random), near, random, open)) continue;
      light = SideLight::kLit;
      return;
    }
    light = open ? SideLight::kDark : SideLight::kSealed;
  }

  const SideScene& scene_;
  const std::vector<std::array<bool, 2>>& asked_;
  geometry::RayScene own_tree_;  ///< where none was at hand
  const geometry::RayScene& tree_;
  const LightPaths paths_;
  std::vector<std::array<SideLight, 2>> light_;  ///< by group and side; first kSealed
  std::vector<bool> shines_;                     ///< by group: some of its triangles do
  MeshParts parts_;
  std::vector<std::array<bool, 2>> sealed_;   ///< by part and side
  std::uint32_t walks_allowed_ = kMostWalks;  ///< from a side
};

}  // namespace

bool SideScene::shines() const {
  return isBright(sky.upper) || isBright(sky.lower) || !lights.empty() || std::ranges::find(emits, true) != emits.end();
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
    lights.push_back(light);
  }
  return lights;
}

}  // namespace radiosity::scene
