#include "server/solver/shooting/estimate.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <vector>

#include "server/solver/error/field_error.h"

namespace radiosity::solver {
namespace {

/// What light that only varies inside shooters costs near by, for each unit of RadiosityState::nodePower it adds.
/// Calibrated against the path tracer: with it stated and true error agree within 10 % on the Cornell box and the small
/// room.
constexpr double kVariationError = 2.0;

}  // namespace

double receivedFlux(const RadiosityState& state) {
  double sum = 0.0;
  for (const auto& side : state.sides()) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const glm::vec3 h = state.irradiance(side, leaf);
      sum += static_cast<double>(h.x + h.y + h.z) * static_cast<double>(state.leafArea(side, leaf));
    }
  }
  return sum * static_cast<double>(state.rounds());
}

double meanReflectance(const RadiosityState& state) {
  double reflected = 0.0, received = 0.0;
  for (const auto& side : state.sides()) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const glm::vec3 h = state.irradiance(side, leaf) * state.leafArea(side, leaf);
      received += static_cast<double>(h.x + h.y + h.z);
      reflected += static_cast<double>(glm::dot(h, state.reflectance(side, leaf)));
      const glm::vec3 passed = state.passed(side, leaf) * state.leafArea(side, leaf);
      reflected += static_cast<double>(passed.x + passed.y + passed.z);
    }
  }
  return received > 0.0 ? std::clamp(reflected / received, 0.0, 0.999) : 0.0;
}

ErrorParts estimateError(const RadiosityState& state, double owed) {
  FieldError field(state.patches());
  std::vector<glm::vec3> first, second;
  double unshot = owed, varying = 0.0;
  for (const auto& side : state.sides()) {
    first.resize(side.leaf_count);
    second.resize(side.leaf_count);
    state.halfIrradiance(side, 0, first);
    state.halfIrradiance(side, 1, second);
    field.addSide(side, first, second);
    const glm::vec3 net = glm::abs(state.nodeFlux(side.first_node + side.node_count - 1));
    unshot += static_cast<double>(net.x + net.y + net.z);
    varying += std::max(0.0, side.unshot_power - static_cast<double>(net.x + net.y + net.z));
  }
  ErrorParts parts;
  const double received = receivedFlux(state);
  if (field.square() <= 0.0 || received <= 0.0) {
    parts.residual = unshot + varying > 0.0 ? 1.0 : 0.0;  // nothing received: all or nothing is missing
    parts.total = parts.residual;
    return parts;
  }
  parts.sampling = field.sampling();
  // Net unshot light is multiplied by its further bounces; what only varies inside nodes cancels after the first.
  parts.residual = (unshot / (1.0 - meanReflectance(state)) + kVariationError * varying) / received;
  parts.discretization = field.discretization();
  parts.total = std::hypot(parts.residual, parts.sampling);
  return parts;
}

EnergyParts energyBalance(const RadiosityState& state, const std::array<double, 3>& shot,
                          const std::array<double, 3>& gather_emitted, const std::array<double, 3>& other_flux) {
  EnergyParts parts;
  std::array<double, 3> received{};
  const double quantum = 1.0 / (state.fluxScale() * static_cast<double>(state.rounds()));
  const double rounds = static_cast<double>(state.rounds());
  for (const auto& side : state.sides()) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto area = static_cast<double>(state.leafArea(side, leaf));
      if (area <= 0.0) continue;
      for (int c = 0; c < 3; ++c) {
        const auto i = static_cast<std::size_t>(c);
        received[i] += area * static_cast<double>(state.irradiance(side, leaf)[c]);
        parts.emitted[i] += area * static_cast<double>(state.emission(side, leaf)[c]);
        parts.absorbed[i] += area * (1.0 - static_cast<double>(state.reflectance(side, leaf)[c])) *
                             static_cast<double>(state.irradiance(side, leaf)[c]);
        parts.absorbed[i] -= area * static_cast<double>(state.passed(side, leaf)[c]);  // as the other side says
        parts.unshot[i] += area * static_cast<double>(state.unshot(side, leaf)[c]) / rounds;
        if (side.gathered) parts.unshot[i] += area * static_cast<double>(state.emission(side, leaf)[c]);
      }
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    parts.emitted[i] += other_flux[i];
    parts.unshot[i] += other_flux[i] - gather_emitted[i] / rounds;
    parts.escaped[i] = static_cast<double>(state.escaped()[i]) * quantum;
    parts.backface[i] = static_cast<double>(state.backface()[i]) * quantum;
    parts.imbalance[i] = (shot[i] + gather_emitted[i]) / rounds - received[i] - parts.escaped[i] - parts.backface[i];
  }
  return parts;
}

}  // namespace radiosity::solver
