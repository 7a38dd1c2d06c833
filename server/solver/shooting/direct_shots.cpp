#include "server/solver/shooting/direct_shots.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "server/solver/math/sampling.h"
#include "server/solver/transport/node_shots.h"
#include "server/solver/transport/shot_cost.h"

namespace radiosity::solver {
namespace {

/// So many lights shoot in each round. Of more, those take turns that send less than such a part of all, about so many
/// in a round.
constexpr std::size_t kFew = 256, kInTurn = 128;
/// One gather shot holds up to this many points: enough for the ratio of weighted visibilities to have little bias,
/// few enough to be shared out between workers.
constexpr std::uint32_t kPointsAShot = 8;

double lightSum(const glm::dvec3& v) { return v.x + v.y + v.z; }
double powerOf(const LightPolygon& light) { return light.area * lightSum(glm::dvec3(light.emission)); }

}  // namespace

DirectShots::DirectShots(const PlannerSettings& settings, std::size_t leaves) : settings_(settings), leaves_(leaves) {
  settings_.light_points = std::min(settings_.light_points, pointsAWave(leaves));
}

void DirectShots::take(const std::vector<LightPolygon>& lights) {
  std::unordered_map<std::uint32_t, std::size_t> known;
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    known.emplace(lights_[i].key, i);
    lights_[i].emission = glm::vec3(0.0F);  // its light is to be taken back, unless it is among those that follow
  }
  std::vector<ShotLight> fresh;
  for (const auto& light : lights) {
    const auto same = known.find(light.key);
    if (same == known.end()) {
      fresh.push_back({light, 1, {}, {}});
    } else {
      static_cast<LightPolygon&>(lights_[same->second]) = light;
    }
  }
  takeTurns(std::move(fresh));
}

/// Of each group of lights of like power one shoots in each round, so that rounds are alike.
void DirectShots::takeTurns(std::vector<ShotLight> lights) {
  std::vector<ShotLight*> weak;
  double power = 0.0;
  for (const auto& light : lights) power += solver::powerOf(light);
  if (lights.size() > kFew) {
    for (auto& light : lights)
      if (solver::powerOf(light) * kInTurn < power) weak.push_back(&light);
  }
  std::ranges::sort(weak, [](const ShotLight* a, const ShotLight* b) {
    return std::tuple(-solver::powerOf(*a), a->key) < std::tuple(-solver::powerOf(*b), b->key);
  });
  const auto cycle = static_cast<std::uint32_t>(std::max<std::size_t>(1, (weak.size() + kInTurn - 1) / kInTurn));
  for (std::uint32_t i = 0; i < weak.size(); ++i) {
    weak[i]->cycle = cycle;
    for (std::uint32_t half = 0; half < 2; ++half) {
      const auto first = mixKeys(settings_.seed, std::uint64_t{i / cycle} << 1U | half);
      weak[i]->turn[half] = static_cast<std::uint32_t>((first + i) % cycle);
    }
  }
  lights_.insert(lights_.end(), lights.begin(), lights.end());
}

double DirectShots::powerOf(const ShotLight& light, std::size_t half) const {
  return light.area * lightSum(glm::abs(light.undelivered(rounds_, half)));
}

void DirectShots::startRound(std::uint32_t rounds) {
  rounds_ = rounds;
  next_ = 0;
  due_power_ = {};
  for (const auto& light : lights_)
    for (std::size_t half = 0; half < 2; ++half) due_power_[half] += powerOf(light, half);
}

double DirectShots::owed() const {
  double power = 0.0;
  for (const auto& light : lights_) power += 0.5 * (powerOf(light, 0) + powerOf(light, 1));
  return power;
}

ShotBatch DirectShots::next(std::array<double, 3>& flux) {
  ShotBatch batch;
  batch.mode = settings_.mode;
  const auto most = pointsAWave(leaves_);
  for (; isDue() && batch.points.size() < most; ++next_) {
    auto& light = lights_[next_ / 2];
    const auto half = static_cast<std::uint32_t>(next_ % 2);
    const double power = powerOf(light, half);
    if (power <= 0.0) continue;
    const auto wanted = static_cast<std::uint32_t>(std::lround(settings_.light_points * power / due_power_[half]));
    const std::uint32_t shots = std::max(1U, (wanted + kPointsAShot - 1) / kPointsAShot);
    const std::uint32_t points = std::clamp(wanted, 2U, kPointsAShot);
    for (std::uint32_t k = 0; k < shots; ++k) addShot(light, half, k, shots, points, batch);
    const auto sent = light.undelivered(rounds_, half);
    for (int c = 0; c < 3; ++c) flux[static_cast<std::size_t>(c)] += 0.5 * light.area * sent[c];
    light.delivered[half] += sent;
  }
  if (!isDue()) ++gather_rounds_;
  return batch;
}

void DirectShots::addShot(const ShotLight& light, std::uint32_t half, std::uint32_t shot_index, std::uint32_t shots,
                          std::uint32_t points, ShotBatch& batch) const {
  const std::uint64_t key = mixKeys(settings_.seed, 0x4c49474854ULL + light.key);
  const std::uint32_t index = gather_rounds_ / light.cycle * 2 * shots + half * shots + shot_index;
  const glm::dvec4 jitter = sobol4(index, mixKeys(key, 1));
  const glm::dvec3 radiosity = light.undelivered(rounds_, half) / (2.0 * shots);
  GatherShot shot;
  std::copy(light.corners.begin(), light.corners.end(), shot.corners.begin());
  shot.corner_count = light.corner_count;
  shot.normal = light.normal;
  for (int c = 0; c < 3; ++c) shot.radiosity[static_cast<std::size_t>(c)] = radiosity[c];
  shot.resolution = settings_.light_resolution;
  shot.half = half;
  shot.receiver_jitter = glm::vec2(jitter.x, jitter.y);
  shot.spots = scene::SpotDraw::from(jitter.z);
  shot.first_point = static_cast<std::uint32_t>(batch.points.size());
  shot.point_count = points;
  for (std::uint32_t p = 0; p < points; ++p) {
    const std::uint32_t sequence = index * points + p;
    const glm::dvec4 sample = sobol4(sequence, key);
    batch.points.push_back(hemicubeAt(light.point(sample.x, sample.y), light.normal, sample.z, mixKeys(key, sequence)));
  }
  batch.gather.push_back(shot);
}

}  // namespace radiosity::solver
