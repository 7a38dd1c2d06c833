// What light that is no surface's has come to at the leaves, as flux in a sink, and what of it is lost. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/gather/receivers.h"

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
