// What light that is no surface's has come to at the leaves, as flux in a sink, and what of it is lost. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/task.h"
#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/gather/receivers.h"
#include "server/solver/math/sampling.h"

namespace radiosity::gpu {

/// Shares of a shot's flux that left the scene, and that fell on unlit sides.
struct LostShare {
  double all = 0.0, escaped = 0.0, absorbed = 0.0;

  LostShare& operator+=(const LostShare& other) {
    all += other.all;
    escaped += other.escaped;
    absorbed += other.absorbed;
    return *this;
  }
};

/// So many rays find out what of a lamp is lost.
inline constexpr std::uint32_t kLostRays = 16384;

/// What a lamp sends one way, and what share of its light that is.
struct LostRay {
  geometry::Ray ray;
  double weight = 0.0;
};

/// By kLostRays rays: rayOf(index) is one of them, fade(length) the part of it that gets so far.
template <typename RayOf, typename Fade>
[[nodiscard]] LostShare lostByRays(const Receivers& receivers, std::uint64_t key, const RayOf& rayOf,
                                   const Fade& fade) {
  LostShare lost;
  for (std::uint32_t first = 0; first < kLostRays; first += geometry::kPacket) {
    interruptionPoint();
    std::array<geometry::Ray, geometry::kPacket> rays;
    std::array<double, geometry::kPacket> weights;
    std::array<geometry::Hit, geometry::kPacket> hits;
    for (std::uint32_t i = 0; i < geometry::kPacket; ++i) {
      const LostRay drawn = rayOf(first + i);
      rays[i] = drawn.ray;
      weights[i] = drawn.weight;
    }
    receivers.nearest(rays, solver::mixKeys(key, first), hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      lost.all += weights[i];
      const double reached = hits[i].found() ? weights[i] * fade(hits[i].t) : 0.0;
      lost.escaped += weights[i] - reached;  // what fades on its way arrives nowhere
      if (hits[i].found() && receivers.absorbs(rays[i], hits[i])) lost.absorbed += reached;
    }
  }
  return lost;
}

/// What a shot stands for, by channel.
struct ShotLight {
  std::array<double, 3> unit{};     ///< that irradiance is multiplied by
  std::array<double, 3> emitted{};  ///< flux, lux unit^2
  std::uint32_t half = 0;
};

/// `irradiance`: by receiver, for a unit of one. Cost: a pass over the receivers.
void deliverLight(const Receivers& receivers, std::span<const float> irradiance, const ShotLight& light,
                  const LostShare& lost, double flux_scale, const FluxSink& sink, solver::TransportCounters& counters);

/// A leaf so near to a light that points of it would differ too much: its mean irradiance per unit of intensity, from
/// its solid angle. Negative: it is far enough, or only a part of a leaf.
[[nodiscard]] float nearMean(const Receivers& receivers, const Receivers::Receiver& receiver,
                             const scene::TriangleFrame& frame, const glm::vec3& light);

}  // namespace radiosity::gpu
