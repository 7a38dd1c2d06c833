#include "server/scene/light_paths.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "common/parallel.h"
#include "server/scene/emitters.h"

namespace radiosity::scene {
namespace {

/// Half of the lamps that paths ask are among the nearest to where the path began: in a building most are elsewhere.
constexpr std::size_t kNearest = 4;
/// Groups times lamps for which the nearest are looked for.
constexpr double kMostPairs = 2e7;
constexpr int kMostSheets = 16;  ///< that a ray passes where one can see through

glm::dvec3 perpendicular(const glm::dvec3& n) {
  return glm::normalize(std::abs(n.x) < 0.6 ? glm::cross(n, glm::dvec3(1, 0, 0)) : glm::cross(n, glm::dvec3(0, 1, 0)));
}

}  // namespace

glm::dvec3 LightPaths::around(const glm::dvec3& axis, double cosine, double turn) {
  const glm::dvec3 u = perpendicular(axis), v = glm::cross(axis, u);
  const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), phi = 2.0 * M_PI * turn;
  return axis * cosine + sine * (std::cos(phi) * u + std::sin(phi) * v);
}

std::size_t LightPaths::drawIndex(std::size_t count, Random& random) {
  return std::min(static_cast<std::size_t>(random() * static_cast<double>(count)), count - 1);
}

glm::dvec3 LightPaths::drawDirection(const Place& from, Random& random) {
  const double cosine = std::sqrt(random()), turn = random();
  return around(from.normal, cosine, turn);
}

LightPaths::LightPaths(const SideScene& scene, const geometry::RayScene& tree) : scene_(scene), tree_(tree) {
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
      if (scene.emits[t]) lamps_.push_back(t);
    }
  }
  double sum = 0.0;
  for (const auto t : lamps_) lamp_areas_.push_back(sum += areaOf(t));
}

double LightPaths::areaOf(std::uint32_t t) const {
  const auto& c = scene_.triangles[t];
  return 0.5 * static_cast<double>(glm::length(glm::cross(c[1] - c[0], c[2] - c[0])));
}

glm::dvec3 LightPaths::normalOf(std::uint32_t t) const {
  const auto& c = scene_.triangles[t];
  const glm::dvec3 a(c[0]), n = glm::cross(glm::dvec3(c[1]) - a, glm::dvec3(c[2]) - a);
  const double length = glm::length(n);
  return length > 0.0 ? n / length : glm::dvec3(0.0, 1.0, 0.0);
}

glm::dvec3 LightPaths::middleOf(std::uint32_t t) const {
  const auto& c = scene_.triangles[t];
  return glm::dvec3(c[0] + c[1] + c[2]) / 3.0;
}

LightPaths::Place LightPaths::placeOn(std::uint32_t triangle, std::uint32_t side, Random& random) const {
  const auto& c = scene_.triangles[triangle];
  const double root = std::sqrt(random()), v = random();
  const glm::dvec3 point =
      (1.0 - root) * glm::dvec3(c[0]) + root * (1.0 - v) * glm::dvec3(c[1]) + root * v * glm::dvec3(c[2]);
  const glm::dvec3 normal = side == 0 ? normalOf(triangle) : -normalOf(triangle);
  return {point + kLift * normal, normal, triangle};
}

LightPaths::Place LightPaths::placeIn(const SideScene::Group& group, std::uint32_t side, Random& random) const {
  const auto first = areas_.begin() + group.first, end = first + group.count;
  const auto at = std::min(std::lower_bound(first, end, random() * *(end - 1)), end - 1);
  return placeOn(static_cast<std::uint32_t>(at - areas_.begin()), side, random);
}

std::uint32_t LightPaths::drawLamp(Random& random) const {
  const auto at = std::ranges::lower_bound(lamp_areas_, random() * lamp_areas_.back());
  return lamps_[std::min<std::size_t>(static_cast<std::size_t>(at - lamp_areas_.begin()), lamps_.size() - 1)];
}

std::uint32_t LightPaths::drawLampSide(std::uint32_t lamp, Random& random) const {
  return groupOf(lamp).double_sided && random() < 0.5 ? 1 : 0;
}

LightPaths::Near LightPaths::nearTo(const glm::dvec3& place) const {
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

bool LightPaths::trace(const Place& from, const glm::dvec3& direction, Random& random, geometry::Hit& hit) const {
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

bool LightPaths::isFree(const Place& from, const glm::dvec3& way, float reach) const {
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

bool LightPaths::goOn(const glm::dvec3& direction, const geometry::Hit& hit, Place& at) const {
  if (!hit.front && !groupOf(hit.triangle).double_sided) return false;
  const glm::dvec3 normal = hit.front ? normalOf(hit.triangle) : -normalOf(hit.triangle);
  at = {at.point + static_cast<double>(hit.t) * direction + kLift * normal, normal, hit.triangle};
  return true;
}

bool LightPaths::seesLamp(const Place& at, const Near& near, Random& random) const {
  const auto lamp =
      near.lamps.empty() || random() < 0.5 ? drawLamp(random) : near.lamps[drawIndex(near.lamps.size(), random)];
  const Place there = placeOn(lamp, drawLampSide(lamp, random), random);
  const glm::dvec3 way = there.point - at.point;
  if (glm::dot(way, at.normal) <= 0.0 || glm::dot(way, there.normal) >= 0.0) return false;
  const double length = glm::length(way);
  return length > 0.0 && isFree(at, way / length, static_cast<float>(length - kLift));
}

bool LightPaths::seesLight(const Place& at, const Near& near, Random& random) const {
  const bool any = near.lights.empty() || random() < 0.5;
  const auto& light =
      scene_.lights[any ? drawIndex(scene_.lights.size(), random) : near.lights[drawIndex(near.lights.size(), random)]];
  if (light.kind == LightKind::kDirectional)
    return glm::dot(light.direction, at.normal) < 0.0 && isFree(at, -light.direction, kFar);
  const glm::dvec3 way = light.position - at.point;
  const double length = glm::length(way);
  if (!(length > 0.0) || glm::dot(way, at.normal) <= 0.0 || (light.range > 0.0 && length >= light.range)) return false;
  if (light.kind == LightKind::kSpot && -glm::dot(way, light.direction) < length * std::cos(light.outer_cone_rad))
    return false;
  return isFree(at, way / length, static_cast<float>(length));
}

bool LightPaths::skyShines(const glm::dvec3& direction) const {
  return isBright(direction.y > 0.0 ? scene_.sky.upper : scene_.sky.lower);
}

bool LightPaths::seesSource(const Place& at, const Near& near, Random& random) const {
  if (!lamps_.empty() && seesLamp(at, near, random)) return true;
  return !scene_.lights.empty() && seesLight(at, near, random);
}

bool LightPaths::shines(const geometry::Hit& hit) const {
  return scene_.emits[hit.triangle] && (hit.front || groupOf(hit.triangle).double_sided);
}

bool LightPaths::findsLight(Place at, const Near& near, Random& random, bool& open) const {
  for (int hop = 0; hop < kHops; ++hop) {
    if (seesSource(at, near, random)) return true;
    const auto direction = around(at.normal, std::sqrt(random()), random());
    geometry::Hit hit;
    if (!trace(at, direction, random, hit)) {
      open = true;
      return skyShines(direction);
    }
    if (shines(hit)) return true;
    if (!goOn(direction, hit, at)) return false;
  }
  return false;
}

}  // namespace radiosity::scene
