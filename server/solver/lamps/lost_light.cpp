#include "server/solver/lamps/lost_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include "common/task.h"
#include "server/solver/lamps/lamp_of_light.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Rays by which backs are found: shares are known to a few hundredths, which is enough to name the largest.
constexpr std::uint32_t kBackRays = 4096;
constexpr std::uint64_t kKey = 0x10573A11;  ///< of samples
constexpr double kTwoPi = 2.0 * std::numbers::pi;

double lightSum(const glm::vec3& v) {
  return static_cast<double>(v.x) + static_cast<double>(v.y) + static_cast<double>(v.z);
}

glm::dvec3 tangentOf(const glm::dvec3& axis) {
  return glm::normalize(glm::cross(axis, std::abs(axis.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
}

/// Uniform over the cap around the axis whose cosines are at least `least`.
glm::dvec3 inCap(const glm::dvec3& axis, double least, double u, double v) {
  const double cosine = 1.0 - u * (1.0 - least), sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
  const auto s = tangentOf(axis), t = glm::cross(axis, s);
  return cosine * axis + sine * (std::cos(kTwoPi * v) * s + std::sin(kTwoPi * v) * t);
}

/// Of its picture, all of it, and its sun.
std::vector<PunctualLights::Source> lampsOfSky(const scene::PatchScene& patches, scene::Sky sky) {
  sky.upper = sky.lower = glm::vec3(0.0F);
  PunctualLights lights(patches, {}, {});
  lights.setRaysSeeSky(false);
  return lights.makeSources(patches, {{}, sky});
}

glm::dvec3 towards(const PunctualLights::Source& source, const glm::dvec2& at) {
  if (source.kind == PunctualLights::Source::Kind::kDirectional) return glm::dvec3(source.direction);
  return glm::dvec3(lampRay(source.lamp(), {at.x, at.y, 0.0, 0.0}).origin);
}

}  // namespace

std::vector<double> fluxes(const scene::PatchScene& patches, const LightSources& sources) {
  const PunctualLights none(patches, {}, {});
  std::vector<double> each;
  const auto add = [&](const LightSources& one) {
    double flux = 0.0;
    for (const auto& source : none.makeSources(patches, one))
      flux += source.flux_per_intensity * (source.intensity.x + source.intensity.y + source.intensity.z);
    each.push_back(flux);
  };
  for (const auto& light : sources.lights) add({{light}, {}});
  add({{}, {sources.sky.upper, glm::vec3(0.0F)}});
  add({{}, {glm::vec3(0.0F), sources.sky.lower}});
  auto rest = sources.sky;
  rest.upper = rest.lower = glm::vec3(0.0F);
  add({{}, rest});
  return each;
}

/// Cumulative flux, so that a number in [0, 1) draws one in proportion.
class LostLight::Senders {
 public:
  void add(std::uint32_t number, double flux) {
    if (!(flux > 0.0)) return;
    numbers_.push_back(number);
    sums_.push_back((sums_.empty() ? 0.0 : sums_.back()) + flux);
  }
  [[nodiscard]] bool empty() const { return numbers_.empty(); }
  [[nodiscard]] std::uint32_t at(double u) const {
    const auto found = std::ranges::upper_bound(sums_, u * sums_.back());
    return numbers_[static_cast<std::size_t>(
        std::min<std::ptrdiff_t>(found - sums_.begin(), static_cast<std::ptrdiff_t>(numbers_.size()) - 1))];
  }

 private:
  std::vector<std::uint32_t> numbers_;
  std::vector<double> sums_;
};

LostLight::LostLight(const scene::PatchScene& patches, const scene::PatchMaterials& materials,
                     std::shared_ptr<const LeafRays> rays)
    : patches_(patches), materials_(materials), sides_(makeSides(patches)), rays_(std::move(rays)) {
  if (!rays_) rays_ = std::make_shared<const LeafRays>(patches_, sides_);
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const auto instance = patches_.surfaces[sides_[s].surface].instance;
    if (instance >= sides_of_.size()) sides_of_.resize(instance + std::size_t{1});
    sides_of_[instance].push_back(s);
  }
  const auto box = sceneBox(patches);
  middle_ = 0.5 * (glm::dvec3(box[0]) + glm::dvec3(box[1]));
  radius_ = 0.5 * glm::distance(glm::dvec3(box[0]), glm::dvec3(box[1]));
}

LostLight::Ray LostLight::ofLeaf(std::uint32_t value, std::uint32_t index, std::uint64_t key) const {
  const auto at = sobol4(index, key);
  const auto place = rays_->placeOn(value, {at.z, at.w});
  return {place, cosineDirection(place.normal, at.x, at.y)};
}

LostLight::Ray LostLight::fromFar(const glm::dvec3& towards, double u, double v) const {
  const auto s = tangentOf(towards), t = glm::cross(towards, s);
  const double r = radius_ * std::sqrt(u);
  LeafRays::Place from;
  from.position = middle_ + 1.01 * radius_ * towards + r * std::cos(kTwoPi * v) * s + r * std::sin(kTwoPi * v) * t;
  return {from, -towards};
}

std::optional<LampRays> LostLight::leaving(const scene::PunctualLight& light) {
  if (light.kind == scene::LightKind::kDirectional || !hasSizeOrWeb(light)) return std::nullopt;
  // The cone only weighs rays within the angle that is asked for below, too.
  const auto web = light.web ? std::span<const float>(light.web->table) : std::span<const float>();
  return LampRays({lampShape(patches_, light, {}), web}, webs_);
}

LostLight::Ray LostLight::ofLamp(const scene::PunctualLight& light, const LampRays* leaving, std::uint32_t index,
                                 std::uint64_t key) const {
  const auto at = sobol4(index, key);
  if (light.kind == scene::LightKind::kDirectional) return fromFar(-light.direction, at.x, at.y);
  LeafRays::Place from;
  if (leaving != nullptr) {
    const auto ray = (*leaving)({at.x, at.y, at.z, at.w});
    from.position = glm::dvec3(ray.origin);
    if (light.kind != scene::LightKind::kSpot) return {from, glm::dvec3(ray.direction), ray.weight};
    return {from, inCap(light.direction, std::cos(light.outer_cone_rad), at.x, at.y)};
  }
  from.position = (light.position - patches_.centre) / patches_.scale;
  const double least = light.kind == scene::LightKind::kSpot ? std::cos(light.outer_cone_rad) : -1.0;
  return {from, inCap(light.direction, least, at.x, at.y)};
}

bool LostLight::follow(const Ray& ray, std::uint64_t key, double range, Fate& fate) const {
  LeafRays::Place end;
  const auto seen = rays_->see(ray.from, ray.direction, key, end);
  if (LeafRays::isSky(seen)) {
    ++fate.sky;
  } else if (range > 0.0 && glm::distance(end.position, ray.from.position) > range) {
    ++fate.beyond;
  } else if (seen == LeafRays::kNothing) {
    ++fate.back;
    if (end.triangle != scene::kNone) fate.back_of = patches_.triangle_surface[end.triangle];
  } else {
    fate.arrives = true;
  }
  return fate.arrives;
}

LostLight::Fate LostLight::ofInstance(std::uint32_t instance) const {
  Fate fate;
  if (instance >= sides_of_.size()) return fate;
  Senders leaves;
  for (const auto s : sides_of_[instance]) {
    const auto& side = sides_[s];
    const auto emission = materials_.emission.side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      leaves.add(side.first_value + leaf,
                 lightSum(emission[leaf]) * static_cast<double>(patches_.node_area[side.first_node + leaf]));
  }
  if (leaves.empty()) return fate;
  const auto key = mixKeys(kKey, instance);
  for (std::uint32_t i = 0; i < kRays; ++i) {
    const auto value = leaves.at(uniformFromKey(mixKeys(key, i)));
    if (follow(ofLeaf(value, i, key), mixKeys(key, ~std::uint64_t{i}), 0.0, fate)) break;
  }
  return fate;
}

LostLight::Fate LostLight::ofLight(const scene::PunctualLight& light) {
  Fate fate;
  bool sends = false;
  const auto rays = leaving(light);
  for (std::uint32_t i = 0; i < kRays; ++i) {
    const auto ray = ofLamp(light, rays ? &*rays : nullptr, i, kKey);
    if (!(ray.weight > 0.0)) continue;
    sends = true;
    if (follow(ray, mixKeys(kKey, i), light.range / patches_.scale, fate)) break;
  }
  fate.arrives = fate.arrives || !sends;  // of a beam that none of them met nothing is known
  return fate;
}

std::vector<LostLight::Share> LostLight::backs(std::span<const glm::vec3> irradiance, const LightSources& sources) {
  Senders senders;
  std::uint32_t number = 0;  // leaf values come first
  for (const auto& side : sides_) {
    const auto emission = materials_.emission.side(side.number), reflectance = materials_.reflectance.side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf, ++number) {
      const auto node = side.first_node + leaf;
      auto light = emission[leaf] + reflectance[leaf] * irradiance[node];
      if (side.other != scene::kNone && materials_.transmittance.sideCount() > 0)
        light += materials_.transmittance.side(side.number)[leaf] * irradiance[sides_[side.other].first_node + leaf];
      senders.add(number, lightSum(light) * static_cast<double>(patches_.node_area[node]));
    }
  }
  const auto first_light = number;
  const auto first_sky = first_light + static_cast<std::uint32_t>(sources.lights.size());
  auto powers = fluxes(patches_, sources);
  powers.pop_back();
  for (const double flux : powers) senders.add(number++, flux);
  const auto first_lamp = number;
  const auto lamps = lampsOfSky(patches_, sources.sky);
  for (const auto& lamp : lamps)
    senders.add(number++, lamp.flux_per_intensity * glm::dot(lamp.intensity, glm::dvec3(1.0)));
  std::map<std::uint32_t, std::uint32_t> met;  // by instance
  std::uint32_t all = 0, last = scene::kNone;
  std::optional<LampRays> rays;
  for (std::uint32_t i = 0; i < kBackRays && !senders.empty(); ++i) {
    const auto sender = senders.at((i + 0.5) / kBackRays);  // all draws of one sender follow each other
    const bool is_light = sender >= first_light && sender < first_sky;
    if (sender != std::exchange(last, sender)) {
      interruptionPoint();
      if (is_light) rays = leaving(sources.lights[sender - first_light]);
    }
    const auto at = sobol4(i, kKey);
    const auto up = glm::dvec3(0.0, sender == first_sky ? 1.0 : -1.0, 0.0);
    const auto ray = sender < first_light ? ofLeaf(sender, i, kKey)
                     : sender < first_sky
                         ? ofLamp(sources.lights[sender - first_light], rays ? &*rays : nullptr, i, kKey)
                     : sender < first_lamp ? fromFar(inCap(up, 0.0, at.z, at.w), at.x, at.y)
                                           : fromFar(towards(lamps[sender - first_lamp], {at.z, at.w}), at.x, at.y);
    if (!(ray.weight > 0.0)) continue;
    Fate fate;
    (void)follow(ray, mixKeys(kKey, i), 0.0, fate);
    if (fate.back_of == scene::kNone) continue;
    ++met[patches_.surfaces[fate.back_of].instance];
    ++all;
  }
  std::vector<Share> shares;
  for (const auto& [instance, count] : met) shares.push_back({instance, static_cast<double>(count) / all});
  std::ranges::stable_sort(shares, std::ranges::greater{}, &Share::part);
  return shares;
}

}  // namespace radiosity::solver
