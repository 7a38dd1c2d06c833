#include "server/solver/lamps/caustic_paths.h"

#include <algorithm>
#include <array>
#include <bit>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "server/solver/lamps/unhidden.h"
#include "server/solver/math/microfacets.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

/// A place nearer to the plane of a lamp than this (unit box) gets nothing of it.
constexpr double kInLampsPlane = 1e-5;
/// Of all paths, those that begin anywhere on what reflects, however little of the lamp's light its middle gets.
constexpr double kAnywhere = 0.1;
/// By so many leaves is told how much all reflect.
constexpr std::size_t kEnoughLeaves = 1024;
constexpr std::uint64_t kStretchKey = 0x53545245ULL, kFirstRay = 0x4649525354ULL;
/// Of all paths, those that leave their lamp into any direction.
constexpr double kPartAnywhere = 1.0 / CausticPaths::kOneAnywhere;

/// Part of what leaves a point of a lamp that comes to a place, by area there; `way`: to that point.
double densityAt(const LightPolygon& lamp, const LeafRays::Place& place, const glm::dvec3& way) {
  const double leaves = -glm::dot(glm::dvec3(lamp.normal), way), arrives = glm::dot(place.normal, way);
  if (leaves <= kInLampsPlane || arrives <= 0.0) return 0.0;
  const double square = glm::dot(way, way);
  return arrives * leaves / (std::numbers::pi * square * square);
}

}  // namespace

std::shared_ptr<const CausticPaths> CausticPaths::find(std::span<const Side> sides,
                                                       std::shared_ptr<const LeafRays> rays,
                                                       std::shared_ptr<const SpecularLeaves> mirrors,
                                                       std::span<const LightPolygon> polygons) {
  if (!mirrors || polygons.empty() || polygons.size() > kMostLamps) return nullptr;
  const std::shared_ptr<CausticPaths> found(new CausticPaths());
  for (const auto& side : sides) {
    for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value) {
      if (!mirrors->has(value) || rays->areaOf(value) <= 0.0) continue;
      found->leaves_.push_back(value);
      found->weight_.push_back(static_cast<float>(rays->areaOf(value)) * channelSum(mirrors->meanReflectance(value)) /
                               3.0F);
      found->covered_.push_back(static_cast<float>(rays->coveredAreaOf(value)));
    }
  }
  if (found->leaves_.empty()) return nullptr;
  for (const auto& lamp : polygons) found->keys_.push_back(mixKeys(mirrors->key(), lamp.key));
  found->polygons_.assign(polygons.begin(), polygons.end());
  found->rays_ = std::move(rays);
  found->mirrors_ = std::move(mirrors);
  for (const auto& lamp : polygons) found->part_.push_back(found->litPart(lamp));
  return found;
}

/// Of leaves that no image is in, where some are given.
double CausticPaths::litPart(const LightPolygon& lamp, const LampImages* but_images) const {
  const auto step = (leaves_.size() + kEnoughLeaves - 1) / kEnoughLeaves;
  double lit = 0.0;
  for (std::size_t first = 0; first < leaves_.size();
       first += step) {  // any of each stretch, so that none is a pattern
    const auto i = std::min(first + static_cast<std::size_t>(mixKeys(kStretchKey, first) % step), leaves_.size() - 1);
    if (but_images != nullptr && but_images->isIn(leaves_[i])) continue;
    lit += static_cast<double>(weight_[i]) * unhiddenLight(lamp, rays_->placeOn(leaves_[i], {0.5, 0.5}));
  }
  return lamp.area > 0.0 ? lit * static_cast<double>(step) / lamp.area : 0.0;
}

double CausticPaths::partOutside(const LampImages* images) const {
  if (images == nullptr) return 1.0;
  double outside = 0.0, all = 0.0;
  for (std::size_t i = 0; i < polygons_.size(); ++i) {
    outside += litPart(polygons_[i], images);
    all += part_[i];
  }
  return all > 0.0 ? outside / all : 0.0;
}

CausticPaths::Starts CausticPaths::startsOf(std::size_t lamp) const {
  Starts starts;
  const auto& polygon = polygons_[lamp];
  double lit = 0.0, all = 0.0;
  std::vector<double> weights(leaves_.size());
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    const double weight = static_cast<double>(weight_[i]);
    weights[i] = weight * unhiddenLight(polygon, rays_->placeOn(leaves_[i], {0.5, 0.5}));
    lit += weights[i];
    all += weight;
  }
  if (!(all > 0.0)) return starts;
  const double anywhere = lit > 0.0 ? kAnywhere : 1.0;
  double below = 0.0;
  starts.below_.reserve(leaves_.size());
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    below += anywhere * static_cast<double>(weight_[i]) / all + (lit > 0.0 ? (1.0 - anywhere) * weights[i] / lit : 0.0);
    starts.below_.push_back(below);
  }
  return starts;
}

double CausticPaths::Starts::chanceOf(std::size_t which) const {
  return (below_[which] - (which > 0 ? below_[which - 1] : 0.0)) / below_.back();
}

CausticPaths::Starts::Start CausticPaths::Starts::at(double number) const {
  const double sum = number * below_.back();
  const auto found = std::min(std::ranges::upper_bound(below_, sum), std::prev(below_.end()));
  const double before = found == below_.begin() ? 0.0 : *std::prev(found), width = *found - before;
  const double along = width > 0.0 ? std::clamp((sum - before) / width, 0.0, std::nextafter(1.0, 0.0)) : 0.0;
  return {static_cast<std::size_t>(found - below_.begin()), along};
}

/// `density`: of the paths that are sent towards leaves, by area there. A place is reached both ways, and the balance
/// of both (Veach 1997) bounds what one path brings: towards leaves alone those next to a lamp would get all from a
/// few, and anywhere alone what is small and far away is seldom met.
CausticPaths::Light CausticPaths::between(const LightPolygon& lamp, const glm::dvec3& from, const glm::dvec3& to,
                                          double density) const {
  const auto arrival = rays_->arriveAt({from, glm::dvec3(lamp.normal)}, to);
  if (!(arrival.passage.part > 0.0) || !reflects(arrival.end.value)) return {};
  const auto way = from - arrival.end.position;
  const double reached = densityAt(lamp, arrival.end, way) * arrival.passage.part;
  if (!(reached > 0.0)) return {};
  const double chance = (1.0 - kPartAnywhere) * density + kPartAnywhere * reached;
  return {arrival.end, -glm::normalize(way), lamp.area * reached / chance * arrival.passage.tint};
}

CausticPaths::Light CausticPaths::towards(std::size_t lamp, const Starts& starts, const glm::dvec4& draw) const {
  const auto [which, along] = starts.at(draw.x);
  const double chance = starts.chanceOf(which), area = static_cast<double>(covered_[which]);
  if (!(chance > 0.0 && area > 0.0)) return {};
  const auto to = rays_->placeOn(leaves_[which], {along, draw.y}).position;
  return between(polygons_[lamp], glm::dvec3(polygons_[lamp].point(draw.z, draw.w)), to, chance / area);
}

CausticPaths::Light CausticPaths::anywhere(std::size_t lamp, const Starts& starts, const glm::dvec4& draw,
                                           std::uint64_t key) const {
  const auto& polygon = polygons_[lamp];
  const glm::dvec3 from(polygon.point(draw.z, draw.w)), normal(polygon.normal);
  LeafRays::Place met;
  const auto value = rays_->see({from, normal}, cosineDirection(normal, draw.x, draw.y), key, met);
  if (!reflects(value)) return {};
  // Towards leaves no path goes where one has no area, and another stands for it.
  if (value != met.value) return between(polygon, from, met.position, 0.0);
  const auto found = std::ranges::lower_bound(leaves_, value);
  if (found == leaves_.end() || *found != value) return {};
  const auto which = static_cast<std::size_t>(found - leaves_.begin());
  const double area = static_cast<double>(covered_[which]);
  return area > 0.0 ? between(polygon, from, met.position, starts.chanceOf(which) / area) : Light{};
}

std::size_t CausticPaths::follow(std::size_t lamp, const Starts& starts, Way way, const glm::dvec4& draw,
                                 std::uint64_t key, std::span<Arrival, kMostArrivals> arrivals) const {
  auto light =
      way == Way::kAnywhere ? anywhere(lamp, starts, draw, mixKeys(key, kFirstRay)) : towards(lamp, starts, draw);
  if (light.flux == glm::dvec3(0.0)) return 0;
  std::size_t count = 0;
  auto value = light.met.value;
  for (std::size_t hop = 0; hop < SpecularLeaves::kMostHops && reflects(value); ++hop) {
    key = mixKeys(key, hop);
    const auto reflection = reflectByMicrofacets(light.met.normal, light.direction, mirrors_->roughness(value), key);
    for (const double edge : reflection.edges())
      light.flux *= glm::dvec3(mirrors_->reflectance(value, static_cast<float>(edge)));
    light.direction = reflection.direction;
    const auto from = light.met;
    LeafRays::Panes panes;
    value = rays_->see(from, light.direction, mixKeys(key, 1), light.met, nullptr, &panes);
    light.flux *= panes.tint;
    if (LeafRays::isSky(value) || value == LeafRays::kNothing) break;
    if (mirrors_->isGlass(value)) continue;
    arrivals[count] = {light.met, light.direction, light.flux};
    arrivals[count++].place.value = value;
  }
  return count;
}

}  // namespace radiosity::solver
