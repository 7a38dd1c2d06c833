#include "server/gpu/sight_trial.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <limits>
#include <numbers>

#include "server/scene/scene.h"

namespace radiosity::gpu {
namespace {

constexpr glm::dvec3 kRoom{6.0, 3.0, 6.0};  ///< metres
constexpr std::uint32_t kBoxes = 240;       ///< twelve triangles each
constexpr std::uint64_t kTexels = 8'000;
constexpr std::uint32_t kLamps = 4, kPointsOfLamp = 8;
constexpr double kLampSide = 0.4;
constexpr int kTimes = 2;
/// A trial in a room says little of other scenes, so that less than this is no reason to leave rays.
constexpr double kClearlyFaster = 1.25;

/// In [0, 1): the golden ratio's multiples, and those of two others, spread evenly.
double spread(std::uint32_t i, double step) { return std::fmod((i + 0.5) * step, 1.0); }

/// A box of side 1 about the origin, seen from outside.
scene::Primitive unitBox() {
  scene::Primitive box;
  for (std::uint32_t axis = 0; axis < 3; ++axis)
    for (const double way : {-0.5, 0.5}) {
      const auto first = static_cast<std::uint32_t>(box.positions.size());
      const auto across = (axis + 1) % 3, up = (axis + 2) % 3;
      for (const auto& [u, v] :
           {std::array{-0.5, -0.5}, std::array{way, -way}, std::array{0.5, 0.5}, std::array{-way, way}}) {
        glm::dvec3 corner(0.0);
        corner[axis] = way;
        corner[across] = u;
        corner[up] = v;
        box.positions.push_back(corner);
      }
      for (const auto corner : {0U, 1U, 2U, 0U, 2U, 3U}) box.indices.push_back(first + corner);
    }
  return box;
}

scene::Scene furnishedRoom() {
  scene::Scene scene;
  scene.materials.resize(1);
  const auto box = unitBox();
  auto walls = box;
  for (std::size_t i = 0; i < walls.indices.size(); i += 3) std::swap(walls.indices[i + 1], walls.indices[i + 2]);
  scene.primitives = {walls, box};
  scene.instances.push_back({.primitive = 0, .world = glm::scale(glm::dmat4(1.0), kRoom)});
  for (std::uint32_t i = 0; i < kBoxes; ++i) {
    const glm::dvec3 place(spread(i, std::numbers::phi) - 0.5, 0.6 * spread(i, std::numbers::sqrt2) - 0.5,
                           spread(i, std::numbers::sqrt3) - 0.5);
    auto world = glm::translate(glm::dmat4(1.0), 0.9 * kRoom * place);
    world = glm::rotate(world, 2.0 * std::numbers::pi * spread(i, std::numbers::e), glm::dvec3(0.0, 1.0, 0.0));
    scene.instances.push_back({.primitive = 1, .world = glm::scale(world, glm::dvec3(0.3, 0.15, 0.2))});
  }
  return scene;
}

/// A lamp that looks down from below the ceiling. `unit`: of a metre.
solver::GatherShot lampShot(const glm::vec3& middle, float unit) {
  solver::GatherShot shot;
  const float half = 0.5F * static_cast<float>(kLampSide) * unit;
  shot.corner_count = 4;
  const std::array<glm::vec2, 4> corners{glm::vec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}};
  for (std::size_t c = 0; c < corners.size(); ++c)
    shot.corners[c] = middle + half * glm::vec3(corners[c].x, 0.0F, corners[c].y);
  shot.normal = {0.0F, -1.0F, 0.0F};
  shot.radiosity = {1.0, 1.0, 1.0};
  return shot;
}

solver::ShotBatch lampsOf(const scene::PatchScene& room) {
  const auto box = solver::sceneBox(room);
  const float unit = (box[1].x - box[0].x) / static_cast<float>(kRoom.x);
  solver::ShotBatch batch;
  for (std::uint32_t lamp = 0; lamp < kLamps; ++lamp) {
    const glm::vec3 part(0.25F + 0.5F * static_cast<float>(lamp % 2), 0.97F,
                         0.25F + 0.5F * static_cast<float>(lamp / 2));
    const glm::vec3 middle = glm::mix(box[0], box[1], part);
    auto shot = lampShot(middle, unit);
    shot.first_point = static_cast<std::uint32_t>(batch.points.size());
    shot.point_count = kPointsOfLamp;
    for (std::uint32_t k = 0; k < kPointsOfLamp; ++k) {
      const auto side = static_cast<float>(kLampSide) * unit;
      const glm::vec3 beside(static_cast<float>(spread(k, std::numbers::phi)) - 0.5F, 0.0F,
                             static_cast<float>(spread(k, std::numbers::sqrt2)) - 0.5F);
      batch.points.push_back({middle + side * beside, shot.normal, {1.0F, 0.0F, 0.0F}, k % solver::kLatticeSide});
    }
    batch.gather.push_back(shot);
  }
  return batch;
}

}  // namespace

Result<SightTrial> makeSightTrial() {
  scene::ChartOptions options;
  options.texel_budget = kTexels;
  auto room = scene::buildPatchScene(furnishedRoom(), options);
  if (!room) return tl::unexpected(room.error());
  auto batch = lampsOf(*room);
  return SightTrial{std::make_shared<const scene::PatchScene>(std::move(*room)), std::move(batch)};
}

Result<double> timeTrial(const SightTrial& trial, solver::Transport& transport) {
  using Clock = std::chrono::steady_clock;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kTimes; ++i) {  // the first one, in which drivers compile shaders, does not count
    const auto start = Clock::now();
    const auto done = transport.measure(trial.batch, [](std::size_t, solver::LinkSample&&) {});
    if (!done) return tl::unexpected(done.error());
    if (i > 0) least = std::min(least, std::chrono::duration<double>(Clock::now() - start).count());
  }
  return least;
}

Sight fasterSight(const SightTimes& times) {
  return kClearlyFaster * times.images < times.rays ? Sight::kImages : Sight::kRays;
}

}  // namespace radiosity::gpu
