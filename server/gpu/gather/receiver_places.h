// From where on a receiver LightGatherer looks at a polygon. Pure functions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <span>

#include "server/gpu/gather/receivers.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// A receiver nearer than this to what shines, in texels, looks from two opposite places: what it receives changes
/// steeply across it, and would be most of what samples differ by.
inline constexpr float kNearTexels = 6.0F;

struct NearBall {
  glm::vec3 middle{0.0F};
  float radius = 0.0F;
};

/// Around the places of a surface that are near to a polygon; of radius 0 where there are none.
inline NearBall nearBall(std::span<const glm::vec3> corners, const scene::Surface& surface, const glm::vec3& texel) {
  NearBall ball;
  for (const auto& corner : corners) ball.middle += corner / static_cast<float>(corners.size());
  for (const auto& corner : corners) ball.radius = std::max(ball.radius, glm::distance(ball.middle, corner));
  ball.radius += kNearTexels * glm::length(texel);
  const auto closest = glm::clamp(ball.middle, surface.bounds_min, surface.bounds_max);
  if (glm::distance(ball.middle, closest) > ball.radius) ball.radius = 0.0F;
  return ball;
}

inline bool isNear(const NearBall& ball, const Receivers::Block& block) {
  return ball.radius > 0.0F &&
         glm::distance(ball.middle, glm::clamp(ball.middle, block.low, block.high)) <= ball.radius;
}

/// The first of two opposite places. For the opposite jitter, that of the other half, they lie in the other two
/// quarters of the receiver, as far from its edges as these are from its middle: what is linear across it cancels in
/// each half, what is quadratic nearly so in their mean, and shows in their difference.
inline glm::vec2 nearPlace(const glm::vec2& jitter) {
  if (jitter.x <= 0.5F) return jitter;
  const auto inverted = [](float offset) { return std::copysign(0.5F - std::abs(offset), offset); };
  return {0.5F + inverted(jitter.x - 0.5F), 0.5F - inverted(jitter.y - 0.5F)};
}

/// The rows of spots that count for a shot.
struct SpotRows {
  std::uint32_t first, apart;
};

inline SpotRows spotRows(const solver::GatherShot& shot) {
  const std::uint32_t apart = scene::kSpotRows / shot.spot_rows;
  return {shot.spots.row * apart / scene::kSpotRows, apart};
}

/// Which of the rows of its spots is a receiver's first. Neighbours differ: in a narrow gap what the edges of shooters
/// do to one row they would do to the same row of all, and so few draws neither average out nor tell how large their
/// error is. By where it lies on its surface, which edits elsewhere do not change.
inline std::uint32_t firstRow(const Receivers::Receiver& receiver, const SpotRows& rows) {
  std::uint32_t mixed = static_cast<std::uint32_t>(receiver.texel.x) * 0x9e3779b1U +
                        static_cast<std::uint32_t>(receiver.texel.y) * 0x85ebca77U;
  mixed = (mixed ^ (mixed >> 15)) * 0x2c1b3c6dU;
  return (rows.first + (mixed >> 16)) % rows.apart;
}

/// Where a receiver looks at a polygon, which is near inside a ball: takes each place before the polygon's plane, and
/// its share of the receiver. After these, where others are wanted, and all of these and as many that the other half
/// looks from lie before that plane, and the receiver has no spots, `takeOthers` gets an array of those. Places stay in
/// registers: through memory they cost more than all else that is done here.
template <typename Take, typename TakeOthers>
[[gnu::always_inline]] inline void forEachPlace(const solver::GatherShot& shot, const NearBall& ball,
                                                const Receivers& receivers, const Receivers::Receiver& receiver,
                                                const Take& take, bool wants_others, const TakeOthers& takeOthers) {
  const auto isBefore = [&](const Receivers::Place& place) {
    return glm::dot(shot.normal, place.point - shot.corners[0]) > kInPlane;
  };
  const auto offer = [&](const Receivers::Place& place, float share) {
    if (isBefore(place)) take(place, share);
  };
  if (receiver.hasSpots()) {
    const auto rows = spotRows(shot);
    const float share = static_cast<float>(rows.apart) / (scene::kSpotRows * scene::kSpotQuarters);
    const auto spots = receivers.spots(receiver);
    for (std::uint32_t row = firstRow(receiver, rows); row < scene::kSpotRows; row += rows.apart) {
      for (std::uint32_t k = 0; k < scene::kSpotQuarters; ++k)
        offer(spots.at(scene::LeafSpots::indexOf(spots.count, row, k, shot.spots.at)), share);
    }
    return;
  }
  const auto jitter = shot.receiver_jitter;
  const auto place = receivers.place(receiver, jitter);
  const auto way = place.point - ball.middle;
  if (glm::dot(way, way) >= ball.radius * ball.radius) {
    offer(place, 1.0F);
    if (!wants_others) return;
    const std::array others{receivers.place(receiver, 1.0F - jitter)};
    if (isBefore(place) && isBefore(others[0])) takeOthers(others);
    return;
  }
  const auto at = nearPlace(jitter);
  const std::array places{receivers.place(receiver, at), receivers.place(receiver, 1.0F - at)};
  for (const auto& near : places) offer(near, 0.5F);
  if (!wants_others) return;
  const auto other = nearPlace(1.0F - jitter);
  const std::array others{receivers.place(receiver, other), receivers.place(receiver, 1.0F - other)};
  if (std::ranges::all_of(places, isBefore) && std::ranges::all_of(others, isBefore)) takeOthers(others);
}

}  // namespace radiosity::gpu
