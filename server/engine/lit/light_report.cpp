#include "server/engine/lit/light_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <optional>

#include "common/task.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/values/material_of.h"
#include "server/solver/lamps/lost_light.h"

namespace radiosity::engine {
namespace {

using scene::kNone;

/// Lamps that are named, and surfaces of a room that is turned inside out; of more the number is told.
constexpr std::size_t kMostNamed = 20, kMostSurfaces = 3;
/// Lamps whose rays are followed after a solve: while they are, no edit is done, and 14,000 take 2 s.
constexpr std::size_t kMostAsked = 1'000;
/// Of the light that is sent: more on backs is told of. What does not arrive anywhere but for rounding.
constexpr double kMuchOnBacks = 0.05, kMuchInMirrors = 0.002, kNothing = 1e-12;
/// Chance may make a lamp's light look stronger than what is lost, of which it is a part.
constexpr double kMargin = 1.1;
constexpr const char* kOnSingle = "on backs of single-sided faces";
constexpr const char* kOnDark = "on sides of double-sided faces that were taken for dark";
constexpr const char* kLookCloser =
    "with more texels (--uniform --texels N) such sides are searched for light from more places";
constexpr const char* kTurnRound =
    "where a room's faces are turned outward, --double-sided (doubleSided of solve.configure) lights both sides";

double channelSum(const glm::vec3& v) {
  return static_cast<double>(v.x) + static_cast<double>(v.y) + static_cast<double>(v.z);
}

double channelSum(const std::array<double, 3>& v) { return v[0] + v[1] + v[2]; }

/// "/nodes/3 'Lamp'"
std::string nodeName(const scene::Document& document, std::size_t node) {
  const auto pointer = fmt::format("/nodes/{}", node);
  const nlohmann::json::json_pointer name(pointer + "/name");
  if (!document.gltf.contains(name) || !document.gltf.at(name).is_string()) return pointer;
  return fmt::format("{} '{}'", pointer, document.gltf.at(name).get_ref<const std::string&>());
}

/// "/nodes/3 'Lamp', material 'glow'"
std::string nameOf(const LitParts& parts, std::uint32_t instance) {
  const auto& placed = parts.scene.instances[instance];
  const auto name = placed.node != kNone ? nodeName(parts.document, placed.node) : std::string("?");
  const auto material = parts.scene.primitives[placed.primitive].material;
  if (material >= parts.scene.materials.size()) return name;
  const auto& called = parts.scene.materials[material].name;
  return name + (called.empty() ? fmt::format(", material {}", material) : fmt::format(", material '{}'", called));
}

/// What an instance's leaves that emit have come to.
struct EmittingLeaves {
  double power = 0.0;  ///< all channels, lux unit^2
  std::uint64_t leaves = 0, covered = 0, clear = 0, buried = 0;
  std::uint32_t covered_by = kNone;  ///< surface
};

class Lamps {
 public:
  explicit Lamps(const LitParts& parts) : parts_(parts), of_(parts.scene.instances.size()) {
    std::size_t side = 0;
    for (const auto& surface : parts.patches.surfaces) {
      interruptionPoint();
      for (std::uint32_t k = 0; k < 2; ++k) {
        if (surface.first_node[k] == kNone) continue;
        if (isLamp(surface.instance)) add(surface, k, parts.materials.emission.side(side));
        ++side;
      }
    }
  }

  /// Its material emits, and one sees it.
  [[nodiscard]] bool isLamp(std::uint32_t instance) const {
    const auto& placed = parts_.scene.instances[instance];
    const auto material = parts_.scene.primitives[placed.primitive].material;
    return placed.visible && material < parts_.scene.materials.size() &&
           scene::mayEmit(parts_.scene.materials[material]);
  }
  [[nodiscard]] const EmittingLeaves& of(std::uint32_t instance) const { return of_[instance]; }

  /// Why it shines with nothing.
  [[nodiscard]] std::string reason(std::uint32_t instance) const {
    const auto& lamp = of_[instance];
    const bool has_triangles = std::ranges::any_of(
        parts_.patches.surfaces, [&](const scene::Surface& surface) { return surface.instance == instance; });
    if (!has_triangles) return "none of its triangles has any area";
    if (lamp.leaves == 0) return "its emissive texture is black wherever its UVs are";
    if (lamp.covered_by != kNone && lamp.covered >= std::max(lamp.clear, lamp.buried))
      return "it lies under " + nameOf(parts_, parts_.patches.surfaces[lamp.covered_by].instance) +
             ", which faces the same way";
    if (lamp.clear > lamp.buried) return "its alpha lets everything through";
    return std::string("it lies inside a closed solid; ") + kTurnRound;
  }

 private:
  void add(const scene::Surface& surface, std::uint32_t side, const scene::SideColours::OfSide& emission) {
    auto& lamp = of_[surface.instance];
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const double bright = channelSum(emission[i]);
      if (!(bright > 0.0)) continue;
      const auto area = static_cast<double>(parts_.patches.node_area[surface.first_node[side] + i]);
      lamp.power += bright * area;
      ++lamp.leaves;
      if (area > 0.0) continue;
      if (const auto by = coverOf(surface.first_leaf + i, side); by != kNone) {
        ++lamp.covered;
        lamp.covered_by = by;
      } else if (parts_.patches.leaves[surface.first_leaf + i].triangle != kNone) {
        ++lamp.clear;
      } else {
        ++lamp.buried;
      }
    }
  }

  [[nodiscard]] std::uint32_t coverOf(std::uint32_t leaf, std::uint32_t side) const {
    const auto& all = parts_.patches.covered;
    auto found = std::ranges::lower_bound(all, leaf, {}, &scene::PatchScene::Covered::leaf);
    while (found != all.end() && found->leaf == leaf && found->side != side) ++found;
    return found != all.end() && found->leaf == leaf ? found->surface : kNone;
  }

  const LitParts& parts_;
  std::vector<EmittingLeaves> of_;  ///< by instance
};

/// Names the first, and counts the others.
class Names {
 public:
  Names(std::vector<std::string>& into, const char* of_others) : into_(into), of_others_(of_others) {}
  template <typename Text>
  void add(const Text& text) {
    if (count_++ < kMostNamed) into_.push_back(text());
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  void finish() {
    if (count_ > kMostNamed) into_.push_back(fmt::format("{} more lamps {}", count_ - kMostNamed, of_others_));
  }

 private:
  std::vector<std::string>& into_;
  const char* of_others_;
  std::size_t count_ = 0;
};

/// Its back is there in the file, and was left without patches since no light was found to reach it.
bool isDoubleSided(const LitParts& parts, std::uint32_t instance) {
  return scene::materialOf(parts.scene, parts.scene.instances[instance]).double_sided;
}

std::string backsOf(const LitParts& parts, const solver::LostLight::Fate& fate) {
  if (fate.back_of == kNone) return "on backs of faces";
  const auto instance = parts.patches.surfaces[fate.back_of].instance;
  return std::string(isDoubleSided(parts, instance) ? kOnDark : kOnSingle) + ", those of " + nameOf(parts, instance);
}

/// Of what no ray of a lamp reaches.
std::string endOf(const LitParts& parts, const solver::LostLight::Fate& fate, bool is_light) {
  if (fate.beyond > std::max(fate.back, fate.sky)) return "its range ends before anything is met";
  if (fate.sky > 10 * fate.back) return is_light ? "all of it leaves the scene" : "it faces nothing but the void";
  if (fate.back > 10 * fate.sky) {
    return (is_light ? "it lies inside a solid: all of it ends "
                     : "it faces into a solid, or away from the room: all of it ends ") +
           backsOf(parts, fate);
  }
  return "it leaves the scene, or ends " + backsOf(parts, fate);
}

/// Nodes of visible lights that are no surfaces, in the order in which the importer meets them.
std::vector<std::size_t> lightNodes(const nlohmann::json& gltf) {
  using nlohmann::json;
  const auto nodes = gltf.value("nodes", json::array());
  const auto scenes = gltf.value("scenes", json::array());
  const auto shown = gltf.value("scene", std::size_t{0});
  if (shown >= scenes.size()) return {};
  std::vector<std::size_t> found, stack;
  const auto push = [&](const json& children) {
    for (auto child = children.rbegin(); child != children.rend(); ++child) stack.push_back(child->get<std::size_t>());
  };
  push(scenes[shown].value("nodes", json::array()));
  while (!stack.empty()) {
    const auto at = stack.back();
    stack.pop_back();
    const auto extensions = nodes.at(at).value("extensions", json::object());
    if (!extensions.value("KHR_node_visibility", json::object()).value("visible", true)) continue;
    for (const auto* name : {"KHR_lights_punctual", "EXT_lights_area", "EXT_lights_ies"})
      if (extensions.contains(name)) found.push_back(at);
    push(nodes.at(at).value("children", json::array()));
  }
  return found;
}

/// `part`: of the light, that ends on backs; `shares` of it.
void tellBacks(const LitParts& parts, const std::vector<solver::LostLight::Share>& shares, double part,
               std::vector<std::string>& into) {
  for (const bool is_double : {false, true}) {
    std::string surfaces;
    std::size_t count = 0;
    double of_these = shares.empty() && !is_double ? 1.0 : 0.0;
    for (const auto& share : shares) {
      if (isDoubleSided(parts, share.instance) != is_double) continue;
      of_these += share.part;
      if (count++ < kMostSurfaces)
        surfaces += fmt::format("{}{} ({:.0f} % of it)", count > 1 ? ", " : ": ", nameOf(parts, share.instance),
                                100.0 * share.part);
    }
    if (!(of_these >= 0.5) && !(of_these * part > kMuchOnBacks)) continue;  // of the light on backs, or of all
    if (count > kMostSurfaces) surfaces += fmt::format(" and {} more", count - kMostSurfaces);
    into.push_back(fmt::format("{:.0f} % of the light ends {}{}; {}", 100.0 * part * of_these,
                               is_double ? kOnDark : kOnSingle, surfaces, is_double ? kLookCloser : kTurnRound));
  }
}

std::string lightName(const LitParts& parts, std::size_t number) {
  const auto& light = parts.sources.lights[number];
  static constexpr std::array kKinds{"point", "spot", "directional", "rectangular area", "round area", "IES"};
  const char* kind = kKinds[static_cast<std::size_t>(light.kind)];
  const auto nodes = lightNodes(parts.document.gltf);
  if (nodes.size() != parts.sources.lights.size()) return fmt::format("{} light {}", kind, number);
  return fmt::format("{} light {}", kind, nodeName(parts.document, nodes[number]));
}

/// What lamps that are no surfaces send at mirrors.
void tellMirrors(const LitParts& parts, const solver::Solver& solver, double emitted,
                 std::vector<std::string>& warnings) {
  if (!solver.showsMirrors()) {
    if (parts.materials.specular.sideCount() > 0)
      warnings.emplace_back("metal and glass reflect nothing by this method; the default one shows what they do");
    if (!parts.patches.tints.empty())
      warnings.emplace_back("coloured glass passes all channels by this method as it does the one that passes best");
    return;
  }
  const double spread = solver.spreadByMirrors();
  if (!(spread > kMuchInMirrors * emitted)) return;
  warnings.push_back(fmt::format(
      "{:.1f} % of all light is what round, rough or small mirrors, or two mirrors in a row, reflect of point, spot, "
      "area and directional lights, suns and bright skies: it is spread as by a rough surface, since these are found "
      "in flat, "
      "smooth and large mirrors only; emissive surfaces instead of lights are reflected as they are",
      100.0 * spread / emitted));
}

}  // namespace

void LightReport::findDark(const LitParts& parts) {
  dark_.clear();
  dark_count_ = 0;
  const auto& instances = parts.scene.instances;
  const bool any = std::ranges::any_of(parts.scene.materials, &scene::mayEmit);
  if (!any) return;
  const Lamps lamps(parts);
  Names names(dark_, "shine with nothing");
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    if (!lamps.isLamp(i) || lamps.of(i).power > 0.0) continue;
    names.add([&] { return fmt::format("lamp {} shines with nothing: {}", nameOf(parts, i), lamps.reason(i)); });
  }
  names.finish();
  dark_count_ = names.count();
}

void LightReport::findLost(const LitParts& parts, solver::Solver& solver) {
  lost_.clear();
  const auto energy = solver.energy();
  tellMirrors(parts, solver, channelSum(energy.emitted), lost_);
  const double emitted = channelSum(energy.emitted), on_backs = channelSum(energy.backface);
  const double lost = std::max(0.0, channelSum(energy.escaped)) + std::max(0.0, on_backs);
  if (!(lost > kNothing * emitted)) return;
  std::optional<solver::LostLight> rays;  // made where something is to be asked
  const auto ask = [&]() -> solver::LostLight& {
    if (!rays) rays.emplace(parts.patches, parts.materials, solver.rays());
    return *rays;
  };
  Names names(lost_, "light nothing");
  std::size_t lamps_that_may = 0;
  const auto mayBeLost = [&](double power) {
    return power > 0.0 && power <= kMargin * lost && ++lamps_that_may <= kMostAsked;
  };
  const Lamps lamps(parts);
  for (std::uint32_t i = 0; i < parts.scene.instances.size(); ++i) {
    if (!mayBeLost(lamps.of(i).power)) continue;
    interruptionPoint();
    const auto fate = ask().ofInstance(i);
    if (fate.arrives) continue;
    names.add([&] { return fmt::format("lamp {} lights nothing: {}", nameOf(parts, i), endOf(parts, fate, false)); });
  }
  const auto powers = solver::fluxes(parts.patches, parts.sources);
  for (std::size_t i = 0; i < parts.sources.lights.size(); ++i) {
    if (!mayBeLost(powers[i])) continue;
    interruptionPoint();
    const auto fate = ask().ofLight(parts.sources.lights[i]);
    if (fate.arrives) continue;
    names.add([&] { return fmt::format("{} lights nothing: {}", lightName(parts, i), endOf(parts, fate, true)); });
  }
  names.finish();
  if (lamps_that_may > kMostAsked)
    lost_.push_back(fmt::format("whether {} more lamps light anything is not known", lamps_that_may - kMostAsked));
  if (on_backs > kMuchOnBacks * emitted)
    tellBacks(parts, ask().backs(solver.irradiance(), parts.sources), on_backs / emitted, lost_);
}

std::string LightReport::unlit(double power, const solver::EnergyParts& energy, bool is_solved) const {
  if (power <= 0.0) {
    if (dark_count_ == 0) return "nothing shines";
    return dark_count_ == 1 ? "the only lamp shines with nothing (see the warnings)"
                            : fmt::format("all {} lamps shine with nothing (see the warnings)", dark_count_);
  }
  const auto arrives = channelSum(energy.absorbed) + channelSum(energy.specular);  // metal has light to show, too
  if (!is_solved || arrives > kNothing * channelSum(energy.emitted)) return {};
  const bool on_backs = channelSum(energy.backface) > channelSum(energy.escaped);
  return on_backs ? "all of it ends on backs of faces, which are not lit" : "all of it leaves the scene";
}

}  // namespace radiosity::engine
