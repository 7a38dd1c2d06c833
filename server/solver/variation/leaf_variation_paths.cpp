// The paths of LeafVariation: where they go, and what is lacking by them.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>
#include <utility>

#include "common/parallel.h"
#include "server/solver/lamps/unhidden.h"
#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"
#include "server/solver/variation/leaf_variation.h"

namespace radiosity::solver {
namespace {

/// From farther away than so many widths of a leaf its light might as well be even: what sees all of it sees all parts
/// alike.
constexpr double kNear = 4.0;
/// Fewer tasks than these are not worth a thread's turn.
constexpr std::size_t kTasksAShare = 64;
/// And between two looks at the clock there are so many shares: some milliseconds, enough for many threads.
constexpr std::size_t kSharesATime = 32;

std::uint64_t keyOfLight(std::uint64_t path_key) { return mixKeys(path_key, 3); }

}  // namespace

/// By how strong lights are nothing is chosen: their light may change, and the paths stay.
template <typename Unhidden>
LeafVariation::Drawn LeafVariation::draw(std::size_t count, std::uint64_t key, const Unhidden& unhidden) {
  Drawn drawn;
  double all = 0.0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::array<double, 2> here = unhidden(i);
    const double worth = here[0] + here[1];
    if (worth <= 0.0) continue;
    all += worth;
    if (uniformFromKey(mixKeys(key, i)) * all < worth) drawn = {i, here, worth};  // a reservoir of one
  }
  drawn.chance = all > 0.0 ? drawn.chance / all : 0.0;
  return drawn;
}

std::uint64_t LeafVariation::keyOf(std::uint32_t receiver, std::uint32_t index, std::size_t half) const {
  const Side& side = rays_->sideOf(receiver);
  return mixKeys(mixKeys(mixKeys(seed_, side.key), receiver - side.first_value), 2 * std::uint64_t{index} + half);
}

/// Where a path goes on from either place.
glm::dvec3 LeafVariation::wayOn(std::uint64_t key, const Place& from) {
  const glm::dvec4 second = sobol4(0, mixKeys(key, 2));
  return cosineDirection(from.normal, second.x, second.y);
}

/// Of the lamp that was drawn for it.
glm::dvec3 LeafVariation::pointOn(const LightPolygon& lamp, std::uint64_t key) {
  const glm::dvec4 at = sobol4(0, keyOfLight(key));
  return {lamp.point(at.x, at.y)};
}

void LeafVariation::followLight(const std::array<Place, 2>& places, std::uint64_t key, const LeafLight& light,
                                Path& path) const {
  const auto drawn = draw(light.lights.size(), keyOfLight(key), [&](std::uint32_t i) -> std::array<double, 2> {
    const auto& lamp = light.lights[i];
    if (lamp.emission == glm::vec3(0.0F)) return {0.0, 0.0};
    return {unhiddenLight(lamp, places[0]), unhiddenLight(lamp, places[1])};
  });
  if (drawn.chance <= 0.0) return;
  const auto point = pointOn(light.lights[drawn.index], key);
  double factor = 0.0;
  const auto& lamp = light.lights[drawn.index];
  for (std::size_t p = 0; p < 2; ++p) {
    // Of a lamp that the place's plane cuts only what lies before it is seen: points behind it stand for nothing.
    const bool before = glm::dot(point - places[p].position, places[p].normal) > 0.0;
    if (drawn.unhidden[p] <= 0.0 || !before || !rays_->isOpen(places[p], point, glm::dvec3(lamp.normal))) continue;
    const auto seen =
        formFactorInFront(places[p].position, places[p].normal, std::span(lamp.corners.data(), lamp.corner_count));
    if (seen.front > 0.0) factor += (p == 0 ? 1.0 : -1.0) * seen.value / seen.front;
  }
  path.light = static_cast<std::uint16_t>(drawn.index);
  path.light_factor = static_cast<float>(factor / drawn.chance);
}

void LeafVariation::followSource(const std::array<Place, 2>& places, std::uint64_t key, const LeafLight& light,
                                 Path& path) const {
  const auto drawn = draw(light.sources.size(), mixKeys(key, 4), [&](std::uint32_t i) -> std::array<double, 2> {
    const auto& source = light.sources[i];
    if (source.intensity == glm::dvec3(0.0)) return {0.0, 0.0};
    return {unhiddenSource(source, places[0]), unhiddenSource(source, places[1])};
  });
  if (drawn.chance <= 0.0) return;
  const auto at = sobol4(0, mixKeys(key, 5));
  double factor = 0.0;
  for (std::size_t p = 0; p < 2; ++p) {
    const auto look = lookAt(light.sources[drawn.index], places[p], {at.x, at.y});
    if (look.brings > 0.0 && rays_->isOpen(places[p], places[p].position + look.way))
      factor += (p == 0 ? 1.0 : -1.0) * look.brings;
  }
  path.source = static_cast<std::uint16_t>(drawn.index);
  path.source_factor = static_cast<float>(factor / drawn.chance);
}

double LeafVariation::nearest() const { return kNear * rays_->greatestWidth(); }

bool LeafVariation::isNear(const LeafRays::Sight& sight) const {
  return sight.end.value < LeafRays::kSky && sight.distance <= kNear * rays_->widthOf(sight.end.value);
}

LeafVariation::Way LeafVariation::firstWay(std::uint32_t receiver, std::uint64_t key) const {
  const glm::dvec4 at = sobol4(0, key), first = sobol4(0, mixKeys(key, 1));
  const auto from = rays_->placeOn(receiver, {at.x, at.y});
  return {from, cosineDirection(from.normal, first.x, first.y), {first.z, first.w}};
}

/// Where a path passes the leaf near by, and the other place of that. False: no leaf is near that way.
bool LeafVariation::findPlaces(std::uint32_t receiver, std::uint64_t key, std::array<Place, 2>& places) const {
  const auto way = firstWay(receiver, key);
  const auto sight = rays_->look(way.from, way.direction, nearest());
  if (!isNear(sight)) return false;
  places = {sight.end, rays_->placeOn(sight.end.value, way.at)};
  return true;
}

void LeafVariation::follow(const Task& task, std::size_t half, const LeafLight& light, std::vector<Path>& paths) const {
  std::array<Place, 2> places;
  auto known = knownFrom(task.receiver, half);
  for (auto k = task.first; k < task.end; ++k) {
    if (isKnown(task.receiver, k)) {
      while (!known.empty() && known.front().number < numberOf(task.receiver, k)) known = known.subspan(1);
      if (known.empty() || known.front().number != numberOf(task.receiver, k)) continue;  // no leaf is near that way
      if (known.front().kept != scene::kNone) {
        paths.push_back(kept_[half][known.front().kept]);
        continue;
      }
    }
    Path path;
    path.index = static_cast<std::uint16_t>(k & 0x7FFF);
    path.receiver = task.receiver;
    const auto key = keyOf(task.receiver, k, half);
    if (!findPlaces(path.receiver, key, places)) continue;
    path.by = places[0].value;
    for (std::size_t p = 0; p < 2; ++p) {
      const auto seen = rays_->look(places[p], wayOn(key, places[p]));
      path.seen[p] = seen.end.value;
      if (isNear(seen)) path.sees_near = 1;
    }
    followLights(places, key, light, path);
    paths.push_back(path);
  }
}

void LeafVariation::followLights(const std::array<Place, 2>& places, std::uint64_t key, const LeafLight& light,
                                 Path& path) const {
  path.light_factor = path.source_factor = 0.0F;
  followLight(places, key, light, path);
  followSource(places, key, light, path);
}

/// Other lights shine than did: where paths go stays as it is. Of what is switched off, and on again, it is kept what
/// paths have of it.
void LeafVariation::takeOtherLights(const LeafLight& light, std::uint64_t shining) {
  std::array<std::vector<Lit>, 2> lit;
  for (std::size_t half = 0; half < 2; ++half) {
    lit[half].reserve(paths_[half].size());
    for (const auto& path : paths_[half])
      lit[half].push_back({path.light, path.source, path.light_factor, path.source_factor});
  }
  lit.swap(lit_before_);
  const bool is_known = std::exchange(lit_before_for_, std::exchange(traced_for_, 0)) == shining;
  for (std::size_t half = 0; half < 2; ++half) {
    const std::size_t known = is_known ? lit[half].size() : 0;
    for (std::size_t i = 0; i < known; ++i) {
      auto& path = paths_[half][i];
      path.light = lit[half][i].light;
      path.source = lit[half][i].source;
      path.light_factor = lit[half][i].light_factor;
      path.source_factor = lit[half][i].source_factor;
    }
    followOtherLights(light, half, known);
  }
}

/// Paths from `first` on.
void LeafVariation::followOtherLights(const LeafLight& light, std::size_t half, std::size_t first) {
  const auto paths = std::span(paths_[half]).subspan(first);
  const auto isDark = [](const auto& strength) { return strength == decltype(strength + strength)(0); };
  if (std::ranges::all_of(light.lights, isDark, &LightPolygon::emission) &&
      std::ranges::all_of(light.sources, isDark, &PunctualLights::Source::intensity)) {
    for (auto& path : paths) path.light_factor = path.source_factor = 0.0F;
    return;
  }
  inShares(paths.size() / kTasksAShare, [&](std::size_t share, std::size_t shares) {
    std::array<Place, 2> places;
    for (auto i = share; i < paths.size(); i += shares) {
      auto& path = paths[i];
      const auto key = keyOf(path.receiver, path.index, half);
      if (findPlaces(path.receiver, key, places)) followLights(places, key, light, path);
    }
  });
}

/// The order of paths, and so the bits of their sums, does not depend on how many threads share them, nor on how often
/// it stops. False: it stopped at `end`.
bool LeafVariation::trace(std::span<const Task> tasks, const LeafLight& light, Clock::time_point end) {
  if (tasks.empty()) return true;
  const std::size_t shares = std::max<std::size_t>(1, tasks.size() / kTasksAShare);
  auto& found = under_way_.found;
  const bool is_same = under_way_.lights == traced_for_ && std::ranges::equal(under_way_.tasks, tasks);
  if (!is_same || found.size() != shares) {  // memory may have ended in the midst of this, too
    under_way_ = {{tasks.begin(), tasks.end()}, traced_for_};
    found.resize(shares);
  }
  while (under_way_.done < shares) {
    const auto first = under_way_.done;
    const auto last = end == Clock::time_point::max() ? shares : std::min(shares, first + kSharesATime);
    inTurns(last - first, [&](std::size_t turn) {
      const auto share = first + turn;
      found[share] = {};  // memory may have ended in the midst of it
      for (auto i = share * tasks.size() / shares; i < (share + 1) * tasks.size() / shares; ++i) {
        for (std::size_t half = 0; half < 2; ++half) follow(tasks[i], half, light, found[share][half]);
      }
    });
    under_way_.done = last;
    if (last < shares && Clock::now() >= end) return false;
  }
  for (std::size_t half = 0; half < 2; ++half) {  // all room first: without memory nothing is to be there twice
    std::size_t more = 0;
    for (const auto& share : found) more += share[half].size();
    paths_[half].reserve(paths_[half].size() + more);
  }
  for (const auto& share : found) {
    for (std::size_t half = 0; half < 2; ++half)
      paths_[half].insert(paths_[half].end(), share[half].begin(), share[half].end());
  }
  under_way_ = {};
  return true;
}

/// By one path, times the paths of the receiver.
LeafVariation::Lack LeafVariation::lacking(const Path& path, const LeafLight& light, std::size_t half) const {
  const auto radiosity = [&](std::uint32_t value) {
    if (value == LeafRays::kNothing) return glm::vec3(0.0F);
    if (value >= LeafRays::kSky)
      return light.sky != nullptr ? glm::vec3(light.sky->at(value - LeafRays::kSky)) : glm::vec3(0.0F);
    const auto own = light.reflectance[value] * light.irradiance[half][value] + light.emission[value];
    return light.passed[half].empty() ? own : own + light.passed[half][value];
  };
  glm::vec3 direct(0.0F);
  if (path.light_factor != 0.0F) direct += path.light_factor * light.lights[path.light].emission;
  if (path.source_factor != 0.0F) direct += path.source_factor * glm::vec3(light.sources[path.source].intensity);
  const bool is_known = light.sights != nullptr && light.sights->isParted(path.by);
  const auto reflected = is_known ? glm::vec3(0.0F) : radiosity(path.seen[0]) - radiosity(path.seen[1]);
  const glm::vec3 by = light.reflectance[path.by];
  if (path.sees_near != 0) return {by * direct, by * reflected};
  return {by * (direct + reflected), glm::vec3(0.0F)};
}

}  // namespace radiosity::solver
