#include "server/gpu/gather/light_delivery.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace radiosity::gpu {
namespace {

/// A leaf whose size is more than this part of its distance from the light takes its mean irradiance from its solid
/// angle: points of it would differ too much.
constexpr float kNear = 0.3F;

/// Solid angle of a triangle seen from the origin (van Oosterom and Strackee 1983), sr; always positive.
double solidAngle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
  const double volume = std::abs(glm::dot(a, glm::cross(b, c)));
  const double base = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
  return 2.0 * std::atan2(volume, base);
}

}  // namespace

void deliverLight(const Receivers& receivers, std::span<const float> irradiance, const ShotLight& light,
                  const LostShare& lost, double flux_scale, const FluxSink& sink, solver::TransportCounters& counters) {
  for (std::size_t i = 0; i < irradiance.size(); ++i) {
    if (irradiance[i] <= 0.0F) continue;
    const auto node = receivers.all()[i].node;
    const double factor =
        flux_scale * static_cast<double>(irradiance[i]) * static_cast<double>(receivers.patches().node_area[node]);
    solver::Flux3 flux{};
    for (std::size_t channel = 0; channel < 3; ++channel) {
      flux[channel] = std::lrint(light.unit[channel] * factor);
      sink.totals->gathered[channel] += flux[channel];
    }
    sink.add(light.half, node, flux);
    ++counters.links;
  }
  if (lost.all <= 0.0) return;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const double flux = light.emitted[channel] * flux_scale / lost.all;
    sink.totals->escaped[channel] += std::lrint(flux * lost.escaped);
    sink.totals->backface[channel] += std::lrint(flux * lost.absorbed);
  }
}

float nearMean(const Receivers& receivers, const Receivers::Receiver& receiver, const scene::TriangleFrame& frame,
               const glm::vec3& light) {
  const auto middle = receivers.point(receiver, glm::vec2(0.5F)) - light;
  const float size2 = glm::dot(frame.du, frame.du) + glm::dot(frame.dv, frame.dv);
  if (!receiver.full || size2 <= kNear * kNear * glm::dot(middle, middle)) return -1.0F;
  const glm::dvec3 corner(receivers.point(receiver, glm::vec2(0.0F)) - light), du(frame.du), dv(frame.dv);
  const double angle =
      solidAngle(corner, corner + du, corner + du + dv) + solidAngle(corner, corner + du + dv, corner + dv);
  return static_cast<float>(angle / glm::length(glm::cross(du, dv)));
}

}  // namespace radiosity::gpu
