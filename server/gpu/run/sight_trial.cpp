#include "server/gpu/run/sight_trial.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <numbers>
#include <utility>

namespace radiosity::gpu {
namespace {

constexpr std::uint32_t kLamps = 4, kPointsOfLamp = 8;
/// Of the room's width.
constexpr float kLampSide = 1.0F / 15.0F;
constexpr int kTimes = 2;
/// A trial in a room says little of other scenes, so that less than this is no reason to leave rays.
constexpr double kClearlyFaster = 1.25;

/// In [0, 1): the multiples of an irrational number spread evenly.
float spread(std::uint32_t i, double step) { return static_cast<float>(std::fmod((i + 0.5) * step, 1.0)); }

/// A square that looks down, below the ceiling.
solver::GatherShot lampShot(const glm::vec3& middle, float side) {
  solver::GatherShot shot;
  shot.corner_count = 4;
  const std::array<glm::vec2, 4> corners{glm::vec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}};
  for (std::size_t c = 0; c < corners.size(); ++c)
    shot.corners[c] = middle + 0.5F * side * glm::vec3(corners[c].x, 0.0F, corners[c].y);
  shot.normal = {0.0F, -1.0F, 0.0F};
  shot.radiosity = {1.0, 1.0, 1.0};
  return shot;
}

/// Seconds that the batch takes, the shorter of two times.
Result<double> timeTrial(const solver::ShotBatch& batch, solver::Transport& transport) {
  using Clock = std::chrono::steady_clock;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kTimes; ++i) {  // the first one, in which drivers compile shaders, does not count
    const auto start = Clock::now();
    const auto done = transport.measure(batch, [](std::size_t, solver::LinkSample&&) {});
    if (!done) return tl::unexpected(done.error());
    if (i > 0) least = std::min(least, std::chrono::duration<double>(Clock::now() - start).count());
  }
  return least;
}

}  // namespace

solver::ShotBatch trialBatch(const scene::PatchScene& room) {
  const auto box = solver::sceneBox(room);
  const float side = kLampSide * (box[1].x - box[0].x);
  solver::ShotBatch batch;
  for (std::uint32_t lamp = 0; lamp < kLamps; ++lamp) {
    const glm::vec3 part(0.25F + 0.5F * static_cast<float>(lamp % 2), 0.97F,
                         0.25F + 0.5F * static_cast<float>(lamp / 2));
    const glm::vec3 middle = glm::mix(box[0], box[1], part);
    auto shot = lampShot(middle, side);
    shot.first_point = static_cast<std::uint32_t>(batch.points.size());
    shot.point_count = kPointsOfLamp;
    for (std::uint32_t k = 0; k < kPointsOfLamp; ++k) {
      const glm::vec3 beside(spread(k, std::numbers::phi) - 0.5F, 0.0F, spread(k, std::numbers::sqrt2) - 0.5F);
      batch.points.push_back({middle + side * beside, shot.normal, {1.0F, 0.0F, 0.0F}, k % solver::kLatticeSide});
    }
    batch.gather.push_back(shot);
  }
  return batch;
}

Result<SightTimes> timeBoth(const std::shared_ptr<const scene::PatchScene>& room, solver::Transport& transport,
                            const std::function<void(Sight)>& see) {
  const auto batch = trialBatch(*room);
  SightTimes times;
  for (const auto& [sight, seconds] :
       {std::pair(Sight::kRays, &times.rays), std::pair(Sight::kImages, &times.images)}) {
    see(sight);
    if (auto set = transport.setScene(room); !set) return tl::unexpected(set.error());
    const auto taken = timeTrial(batch, transport);
    if (!taken) return tl::unexpected(taken.error());
    *seconds = *taken;
  }
  return times;
}

Sight fasterSight(const SightTimes& times) {
  return kClearlyFaster * times.images < times.rays ? Sight::kImages : Sight::kRays;
}

}  // namespace radiosity::gpu
