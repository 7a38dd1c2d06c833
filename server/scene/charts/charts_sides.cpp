// Which sides of double-sided charts get patches, by light or as decided before.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/scene/charts/build.h"
#include "server/scene/charts/charts.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/shading/lit_sides.h"
#include "server/scene/shading/opacity.h"
#include "server/scene/values/material_of.h"

namespace radiosity::scene {
namespace {

const Material& materialOf(const Scene& scene, const Chart& chart) {
  return materialOf(scene, scene.instances[chart.instance]);
}

SideScene sideSceneOf(const SidedCharts& of) {
  SideScene sides;
  sides.lights = lightsInUnitBox(of.scene, of.flat.centre, of.flat.scale);
  sides.sky = of.sky;
  const Emitters emitters(of.scene, of.cuts);
  for (const Chart& chart : of.charts) {
    const Material& material = materialOf(of.scene, chart);
    const auto first = static_cast<std::uint32_t>(sides.triangles.size());
    for (const auto t : chart.triangles) {
      auto& corners = sides.triangles.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) corners[k] = glm::vec3(of.flat.points[of.flat.triangles[t].points[k]]);
      sides.emits.push_back(emitters.shines(chart.instance, of.flat.triangles[t].source));
    }
    sides.groups.push_back({first, static_cast<std::uint32_t>(chart.triangles.size()), chart.instance,
                            material.double_sided, passesLight(material), chart.area / (of.texel * of.texel)});
  }
  return sides;
}

void flip(FlatScene& flat, Chart& chart) {
  chart.flipped = true;
  for (const auto t : chart.triangles) {
    FlatTriangle& triangle = flat.triangles[t];
    std::swap(triangle.points[1], triangle.points[2]);
    std::swap(triangle.source_corner[1], triangle.source_corner[2]);
    const unsigned walled = triangle.walled;  // edge 0 becomes edge 2, and that edge 0
    triangle.walled = static_cast<std::uint8_t>((walled & 2U) | (walled & 1U) << 2U | (walled & 4U) >> 2U);
    triangle.normal = -triangle.normal;
  }
  for (auto& corners : chart.corners) {
    std::swap(corners[1], corners[2]);
    if (chart.from_file) continue;
    for (auto& corner : corners) corner.x = chart.size.x - corner.x;
  }
  chart.axis_u = -chart.axis_u;
  chart.normal = -chart.normal;
}

/// Of the front and the back of the file's triangles.
std::array<SideLight, 2> lightBefore(const FormerScene& former, const Surface& surface) {
  const bool dark = isLeftCoarse(former.scene, former.patches, surface);
  std::array<SideLight, 2> light{dark ? SideLight::kDark : SideLight::kLit,
                                 surface.shows_back ? SideLight::kDark : SideLight::kSealed};
  if (surface.first_node[1] != kNone) light[1] = SideLight::kLit;
  if (surface.flipped) std::swap(light[0], light[1]);
  return light;
}

/// Which sides of which charts are asked for; empty: no chart is double-sided.
std::vector<std::array<bool, 2>> doubleSided(const SidedCharts& of) {
  std::vector<std::array<bool, 2>> asked;
  bool any = false;
  for (const Chart& chart : of.charts) {
    const bool is_double = materialOf(of.scene, chart).double_sided;
    asked.push_back({is_double, is_double});
    any |= is_double;
  }
  if (!any) asked.clear();
  return asked;
}

}  // namespace

void litSides(const SidedCharts& of, const FormerScene* before, const std::vector<const Surface*>& former) {
  const auto asked = doubleSided(of);
  if (asked.empty()) return;
  const auto sides = sideSceneOf(of);
  const bool shines = sides.shines();
  const auto light = lightOnSides(sides, asked);
  for (std::size_t c = 0; c < of.charts.size(); ++c) {
    if (!asked[c][0]) continue;
    Chart& chart = of.charts[c];
    auto [front, back] = light[c];
    bool turn = back > front;
    if (before != nullptr && former[c] != nullptr) {
      // What had texels before an edit keeps them, so that an edit elsewhere, or without light, moves nothing here.
      const auto [front_before, back_before] = lightBefore(*before, *former[c]);
      front = shines ? std::max(front, front_before) : front_before;
      back = shines ? std::max(back, back_before) : back_before;
      turn = back > front || (back == front && former[c]->flipped);
    }
    // What lights one of its sides shines from both.
    if (materialOf(of.scene, chart).isTranslucent()) front = back = SideLight::kLit;
    if (turn) {
      flip(of.flat, chart);
      std::swap(front, back);
    }
    // The black texels of all have no alpha: what one can see through keeps its own.
    const bool see_through = isSeeThrough(materialOf(of.scene, chart));
    chart.back_lit = back == SideLight::kLit || (see_through && back == SideLight::kDark);
    chart.shows_back = back != SideLight::kSealed;
    chart.dark = front != SideLight::kLit && !see_through && !chart.from_file;
  }
}

Result<void> takeSides(const SidedCharts& of, const SideBits& sides) {
  const auto asked = doubleSided(of);
  if (sides.size() != asked.size())
    return fail(ErrorCode::kBadInput,
                fmt::format("{} charts have a choice of sides, of {}", sides.size(), asked.size()));
  constexpr unsigned kAll = kFlipped | kBackLit | kShowsBack | kLeftCoarse;
  for (std::size_t c = 0; c < sides.size(); ++c) {
    const unsigned bits = sides[c];
    const bool fits = bits <= (asked[c][0] ? kAll : 0U) && ((bits & kBackLit) == 0U || (bits & kShowsBack) != 0U);
    if (!fits) return fail(ErrorCode::kBadInput, fmt::format("the sides of chart {} cannot be {}", c, bits));
    Chart& chart = of.charts[c];
    if ((bits & kFlipped) != 0U) flip(of.flat, chart);
    chart.back_lit = (bits & kBackLit) != 0U;
    chart.shows_back = (bits & kShowsBack) != 0U;
    chart.dark = (bits & kLeftCoarse) != 0U;
  }
  return {};
}

SideBits sidesOf(const Scene& scene, const PatchScene& patches) {
  const auto isDouble = [&](const Surface& surface) { return materialOf(scene, surface).double_sided; };
  SideBits sides;
  if (std::ranges::none_of(patches.surfaces, isDouble)) return sides;
  for (const Surface& surface : patches.surfaces) {
    const unsigned bits = (surface.flipped ? kFlipped : 0U) | (surface.first_node[1] != kNone ? kBackLit : 0U) |
                          (surface.shows_back ? kShowsBack : 0U) |
                          (isLeftCoarse(scene, patches, surface) ? kLeftCoarse : 0U);
    sides.push_back(static_cast<std::uint8_t>(bits));
  }
  return sides;
}

}  // namespace radiosity::scene
