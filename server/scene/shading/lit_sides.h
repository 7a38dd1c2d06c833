// Which sides of double-sided surfaces light can reach: only those get patches and texels. Exporters mark every wall
// double-sided, although one side of it faces the room and the other the void; without this, such a room would cost
// twice the texels of its single-sided twin. A step of buildPatchScene (charts.h). Plain values, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "server/geometry/bvh.h"
#include "server/geometry/ray_scene.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// What a side of a surface can hope for.
enum class SideLight : std::uint8_t {
  kSealed,  ///< inside a closed solid: no light, and nobody looks at it
  kDark,    ///< no light, but one sees it, such as the outside of a lit room
  kLit,     ///< light may reach some of it
};

/// The scene as this test sees it: triangles in groups, which are charts, or surfaces.
struct SideScene {
  struct Group {
    std::uint32_t first = 0, count = 0;  ///< triangles
    std::uint32_t instance = 0;          ///< only triangles of one instance hang together
    bool double_sided = false;
    bool see_through = false;  ///< passesLight()
    double leaves = 0.0;       ///< about; larger sides are looked at from more places
  };
  std::vector<Bvh::Triangle> triangles;  ///< unit box, counter-clockwise seen from the front; group after group
  std::vector<bool> emits;               ///< by triangle
  std::vector<Group> groups;
  std::vector<PunctualLight> lights;  ///< positions and ranges in the unit box
  Sky sky;

  [[nodiscard]] bool shines() const;
};

/// Whether light that falls on one side may come out on the other. Translucent sheets scatter it; that a path goes
/// straight on is enough to find out where it may come to.
[[nodiscard]] bool passesLight(const Material& material);

/// By group and side; kLit for what is not asked, and everywhere in a scene without light. `asked`: by group and side.
///
/// Photons from the lamps mark what they meet. A side that none meets is looked at from random places: paths go from
/// there through the open space, as light would come, until they see a lamp, the sun or the sky. Paths never cross a
/// surface, so that a box that is sunk into a lit floor has a dark inside. Only what is closed all around can be
/// sealed. A random test: what little of a side receives light may be missed. The same scene gives the same answer.
/// Some milliseconds for a furnished room. `tree`: of the scene's triangles; null: one is built, O(n log n).
enum class LookFor { kPhotonsAndPaths, kPhotonsAlone };
[[nodiscard]] std::vector<std::array<SideLight, 2>> lightOnSides(const SideScene& scene,
                                                                 const std::vector<std::array<bool, 2>>& asked,
                                                                 LookFor how = LookFor::kPhotonsAndPaths,
                                                                 const geometry::RayScene* tree = nullptr);

/// What was decided about the sides of a surface. A scene is laid out alike by whoever decides the same, whatever its
/// lamps are then (buildAgain(), burial_record.h).
inline constexpr unsigned kFlipped = 1, kBackLit = 2, kShowsBack = 4, kLeftCoarse = 8;
/// By surface; empty: none is double-sided.
using SideBits = std::vector<std::uint8_t>;
/// `patches`: built from `scene`, or from one that has the same geometry.
[[nodiscard]] SideBits sidesOf(const Scene& scene, const PatchScene& patches);

/// Texels of area above which a chart has more than one unless it is left coarse: of those without, both sides are
/// below one and a half.
inline constexpr double kCoarse = 2.25;
/// Whether a surface that is wider than a texel has one for all of it, since no light reaches its sides.
[[nodiscard]] bool isLeftCoarse(const Scene& scene, const PatchScene& patches, const Surface& surface);

/// What rays meet of these, or of the triangles of `patches`. O(n log n). Throws std::bad_alloc.
[[nodiscard]] geometry::RayScene raySceneOf(std::span<const geometry::Triangle> triangles);
[[nodiscard]] geometry::RayScene raySceneOf(const PatchScene& patches);

/// Whether light of `next`, or of the sky, reaches a side of `patches` that was left without patches because light of
/// `before` did not. Both scenes have the geometry of `patches`. Nothing is traced unless `next` has a lamp or a sky
/// that `before` has not. `tree`: of the triangles of `patches`, asked for where something is to be traced; one is
/// built where there is none.
using TreeAtHand = std::function<std::shared_ptr<const geometry::RayScene>()>;
[[nodiscard]] bool reachesDarkSides(const PatchScene& patches, const Scene& before, const Sky& sky_before,
                                    const Scene& next, const Sky& sky_next, const TreeAtHand& tree = {});

/// The lights of a scene in the unit box of `centre` and `scale`.
[[nodiscard]] std::vector<PunctualLight> lightsInUnitBox(const Scene& scene, const glm::dvec3& centre, double scale);

}  // namespace radiosity::scene
