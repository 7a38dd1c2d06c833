#include "server/scene/dark_texels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <map>
#include <optional>
#include <utility>

#include "common/parallel.h"
#include "server/scene/bvh.h"
#include "server/scene/coverage.h"
#include "server/scene/dark_air.h"

namespace radiosity::scene {
namespace {

/// Unit box: places are asked for so far before a surface and so far beside a wall that stands on it, well above
/// rounding; what ends lower stands on nothing.
constexpr double kLift = LightPaths::kLift, kBeside = 1e-5;
/// Walls nearly in the plane of a surface are lids on it (sine of the angle).
constexpr double kLeastSlope = 0.02;
/// Places along a wall, by texel, and how much farther than a texel each darkens: what lies between two of them.
constexpr double kPlacesATexel = 16.0, kAround = 1.0 / kPlacesATexel;
/// Of leaves that lie partly in a dark room, where they are looked for, in texels from its wall: the deeper the better.
constexpr std::array kDepths{0.3, 0.1, 0.03, 0.01};
/// Metres: what one may stand in is so wide.
constexpr double kLeastRoom = 0.8;
/// A piece of a wall on a surface: longer ones are as if of fewer texels.
constexpr double kMostPlaces = 1e6;

/// Where a wall cuts the plane right before a surface: ends, and the direction across it in that plane.
struct Foot {
  glm::dvec3 from, to, across;
};

using Corners = std::array<glm::dvec3, 3>;

std::optional<Foot> footOf(const Corners& wall, const glm::dvec3& normal, double height) {
  const auto face = glm::cross(wall[1] - wall[0], wall[2] - wall[0]);
  const auto across = face - normal * glm::dot(face, normal);
  const double length = glm::length(across);
  if (!(length > kLeastSlope * glm::length(face))) return std::nullopt;
  std::array<glm::dvec3, 2> end{};
  std::size_t ends = 0;
  for (std::size_t k = 0; k < 3 && ends < 2; ++k) {
    const auto &a = wall[k], &b = wall[(k + 1) % 3];
    const double above = glm::dot(a, normal) - height, beyond = glm::dot(b, normal) - height;
    if ((above > 0.0) != (beyond > 0.0)) end[ends++] = a + (b - a) * (above / (above - beyond));
  }
  if (ends < 2) return std::nullopt;
  return Foot{end[0], end[1], across / length};
}

/// Bilinear lookups of a side of a surface, and what they may not mix in.
class SideTexels {
 public:
  explicit SideTexels(const Surface& surface)
      : width_(static_cast<std::int32_t>(surface.width)),
        height_(static_cast<std::int32_t>(surface.height)),
        dark_(static_cast<std::size_t>(width_ + 2) * static_cast<std::size_t>(height_ + 2), false) {}

  /// All texels that lookups about the place mix in.
  void darken(const glm::dvec2& place) {
    forEach(place, [&](std::int32_t x, std::int32_t y) { dark_[at(x, y)] = true; });
  }
  [[nodiscard]] bool isDark(const glm::dvec2& place) const {
    bool all = true;
    forEach(place, [&](std::int32_t x, std::int32_t y) { all &= dark_[at(x, y)]; });
    return all;
  }
  void tell(std::uint32_t surface, std::uint32_t side, std::vector<PatchScene::DarkTexel>& texels) const {
    for (std::int32_t y = -1; y <= height_; ++y)
      for (std::int32_t x = -1; x <= width_; ++x)
        if (dark_[at(x, y)]) texels.push_back({surface, side, x, y});
  }

 private:
  [[nodiscard]] std::size_t at(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>(y + 1) * static_cast<std::size_t>(width_ + 2) + static_cast<std::size_t>(x + 1);
  }
  template <typename Visit>
  void forEach(const glm::dvec2& place, const Visit& visit) const {
    const auto low = glm::floor(place - 0.5 - kAround), high = glm::floor(place - 0.5 + kAround) + 1.0;
    const glm::dvec2 least(-1.0), most(width_, height_);
    const glm::ivec2 first(glm::clamp(low, least, most)), last(glm::clamp(high, least, most));
    for (auto y = first.y; y <= last.y; ++y)
      for (auto x = first.x; x <= last.x; ++x) visit(x, y);
  }

  std::int32_t width_, height_;
  std::vector<bool> dark_;
};

class DarkTexelFinder {
 public:
  DarkTexelFinder(const PatchScene& patches, const SideScene& sides, const DarkAir& air)
      : patches_(patches), sides_(sides), air_(air) {}

  DarkTexels run() {
    const Bounds around = air_.bounds();
    collect(around);
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
      for (std::uint32_t side = 0; side < 2; ++side) {
        if (patches_.surfaces[s].first_node[side] != kNone) darkenSide(s, side, around);
      }
    }
    DarkTexels found;
    for (const auto& [leaf, point] : leaves_) found.leaves.push_back({leaf, point});
    found.texels = std::move(texels_);
    return found;
  }

 private:
  static Bounds boundsOf(const Bvh::Triangle& triangle) {
    Bounds bounds;
    for (const auto& corner : triangle) bounds.add(corner);
    return bounds;
  }
  static bool meet(const Bounds& a, const Bounds& b) {
    constexpr float kNear = 1e-4F;
    return glm::all(glm::lessThanEqual(a.min - kNear, b.max)) && glm::all(glm::lessThanEqual(b.min - kNear, a.max));
  }

  /// What may be a wall of a dark room.
  void collect(const Bounds& around) {
    std::vector<Bvh::Triangle> walls;
    for (std::uint32_t t = 0; t < sides_.triangles.size(); ++t) {
      const auto& surface = patches_.surfaces[patches_.triangle_surface[t]];
      if (surface.see_through || !meet(boundsOf(sides_.triangles[t]), around)) continue;
      walls.push_back(sides_.triangles[t]);
      wall_.push_back(t);
    }
    walls_ = Bvh(std::move(walls));
  }

  void darkenSide(std::uint32_t s, std::uint32_t side, const Bounds& around) {
    const Surface& surface = patches_.surfaces[s];
    if (!meet({surface.bounds_min, surface.bounds_max}, around)) return;
    std::optional<SideTexels> texels;
    std::vector<std::uint32_t> near;
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
      interruptionPoint();
      auto box = boundsOf(sides_.triangles[t]);
      if (!meet(box, around)) continue;
      box.min = glm::max(box.min, around.min) - 2.0F * static_cast<float>(kLift);
      box.max = glm::min(box.max, around.max) + 2.0F * static_cast<float>(kLift);
      near.clear();
      if (!walls_.collectNear(box.min, box.max, SIZE_MAX, near)) continue;
      std::ranges::sort(near);
      for (const auto wall : near) {
        if (wall_[wall] == t) continue;
        if (!texels) texels.emplace(surface);
        darkenAlong({s, side, t}, wall_[wall], *texels);
      }
    }
    if (texels) texels->tell(s, side, texels_);
  }

  /// A triangle of a side of a surface.
  struct Ground {
    std::uint32_t surface, side, triangle;
  };
  [[nodiscard]] glm::dvec3 normalOf(const Ground& ground) const {
    const glm::dvec3 normal(patches_.triangles[ground.triangle].normal);
    return ground.side == 0 ? normal : -normal;
  }
  [[nodiscard]] glm::dvec2 texelAt(const Ground& ground, const glm::dvec3& point) const {
    const auto& frame = patches_.triangles[ground.triangle];
    const glm::dvec3 way = point - glm::dvec3(frame.origin), u(frame.du), v(frame.dv);
    const double uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v);
    const double along_u = glm::dot(way, u), along_v = glm::dot(way, v), determinant = uu * vv - uv * uv;
    return {(along_u * vv - along_v * uv) / determinant, (along_v * uu - along_u * uv) / determinant};
  }

  void darkenAlong(const Ground& ground, std::uint32_t wall, SideTexels& texels) {
    const auto normal = normalOf(ground);
    const auto& corners = sides_.triangles[wall];
    const double plane = glm::dot(glm::dvec3(patches_.triangles[ground.triangle].origin), normal);
    const auto foot =
        footOf({glm::dvec3(corners[0]), glm::dvec3(corners[1]), glm::dvec3(corners[2])}, normal, plane + kLift);
    if (!foot) return;
    const auto [first, last] = partOn(ground, *foot);
    const double length = glm::length(texelAt(ground, foot->to) - texelAt(ground, foot->from)) * (last - first);
    if (!(first < last)) return;
    const double places = std::min(kMostPlaces, std::ceil(length * kPlacesATexel) + 1.0);
    // Not on the ends, where other walls begin.
    const double inset = 2.0 * kBeside / std::max(glm::distance(foot->from, foot->to), 8.0 * kBeside);
    const double low = std::max(first, inset), high = std::min(last, 1.0 - inset);
    for (double i = 0.0; i <= places; ++i) {
      const auto at = glm::mix(foot->from, foot->to, low + (high - low) * i / places);
      for (const double to : {-kBeside, kBeside}) darkenAt(ground, at, to * foot->across, texels);
    }
  }

  /// Which part of the foot lies about a triangle's box of texels.
  [[nodiscard]] std::pair<double, double> partOn(const Ground& ground, const Foot& foot) const {
    const auto a = texelAt(ground, foot.from), b = texelAt(ground, foot.to);
    double first = 0.0, last = 1.0;
    for (int axis = 0; axis < 2; ++axis) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& vertex = patches_.vertices[patches_.indices[3 * std::size_t{ground.triangle} + k]];
        low = std::min(low, static_cast<double>(vertex.texel[axis]) - kAround);
        high = std::max(high, static_cast<double>(vertex.texel[axis]) + kAround);
      }
      const double step = b[axis] - a[axis];
      if (step == 0.0) {
        if (a[axis] < low || a[axis] > high) return {1.0, 0.0};
        continue;
      }
      const double enters = (low - a[axis]) / step, leaves = (high - a[axis]) / step;
      first = std::max(first, std::min(enters, leaves));
      last = std::min(last, std::max(enters, leaves));
    }
    return {first, last};
  }

  void darkenAt(const Ground& ground, const glm::dvec3& foot, const glm::dvec3& beside, SideTexels& texels) {
    const auto texel = texelAt(ground, foot + beside);
    if (!triangleHolds(patches_, ground.triangle, texel)) return;
    const auto leaf = leafAt(ground, texel);
    if (texels.isDark(texel) && leaves_.contains(leaf)) return;
    if (!isDark(ground, texel)) return;
    texels.darken(texel);
    if (!leaves_.contains(leaf)) leaves_[leaf] = deepest(ground, foot, beside, leaf);
  }

  [[nodiscard]] std::uint32_t leafAt(const Ground& ground, const glm::dvec2& texel) const {
    const Surface& surface = patches_.surfaces[ground.surface];
    const glm::dvec2 most(surface.width - 1, surface.height - 1);
    const glm::uvec2 at(glm::clamp(glm::floor(texel), glm::dvec2(0.0), most));
    return surface.first_leaf + at.y * surface.width + at.x;
  }

  [[nodiscard]] bool isDark(const Ground& ground, const glm::dvec2& texel) {
    const auto& frame = patches_.triangles[ground.triangle];
    const auto point = glm::dvec3(frame.origin) + texel.x * glm::dvec3(frame.du) + texel.y * glm::dvec3(frame.dv);
    const auto normal = normalOf(ground);
    return air_.isDark({point + kLift * normal, normal, ground.triangle}, 0xDA12C0000000U + ++asked_);
  }

  /// A place of the leaf in the same dark room, as far from the wall as may be.
  [[nodiscard]] LeafPoint deepest(const Ground& ground, const glm::dvec3& foot, const glm::dvec3& beside,
                                  std::uint32_t leaf) {
    const auto nearest = texelAt(ground, foot + beside);
    const auto way = glm::normalize(nearest - texelAt(ground, foot));
    for (const double depth : kDepths) {
      const auto texel = nearest + depth * way;
      if (!triangleHolds(patches_, ground.triangle, texel) || leafAt(ground, texel) != leaf) continue;
      if (isDark(ground, texel)) return {glm::vec2(texel), ground.triangle};
    }
    return {glm::vec2(nearest), ground.triangle};
  }

  const PatchScene& patches_;
  const SideScene& sides_;
  const DarkAir& air_;
  Bvh walls_;
  std::vector<std::uint32_t> wall_;  ///< by triangle of the tree
  std::vector<PatchScene::DarkTexel> texels_;
  std::map<std::uint32_t, LeafPoint> leaves_;
  std::uint64_t asked_ = 0;
};

/// As DarkAir wants it.
SideScene seenSides(const PatchScene& patches, const Scene& scene, const Sky& sky) {
  auto sides = sideSceneOf(patches, scene, sky);
  for (std::size_t s = 0; s < patches.surfaces.size(); ++s)
    sides.groups[s].double_sided = patches.surfaces[s].shows_back;
  return sides;
}

DarkTexels findIn(const PatchScene& patches, const SideScene& sides, const geometry::RayScene& tree) {
  DarkAir air(sides, tree, kLeastRoom / patches.scale);
  if (!air.find()) return {};
  return DarkTexelFinder(patches, sides, air).run();
}

}  // namespace

DarkTexels findDarkTexels(const PatchScene& patches, const Scene& scene, const Sky& sky,
                          const geometry::RayScene& tree) {
  const auto sides = seenSides(patches, scene, sky);
  return sides.shines() ? findIn(patches, sides, tree) : DarkTexels{};
}

void darkenTexels(PatchScene& patches, const Scene& scene, const Sky& sky) {
  const auto sides = seenSides(patches, scene, sky);
  if (!sides.shines()) return;
  auto found = findIn(patches, sides, raySceneOf(sides.triangles));
  patches.dark_texels = std::move(found.texels);
  for (const auto& [leaf, point] : found.leaves) {
    auto& kept = patches.leaves[leaf];
    kept = {point.texel, point.triangle, false, true, kept.beneath};
  }
}

}  // namespace radiosity::scene
