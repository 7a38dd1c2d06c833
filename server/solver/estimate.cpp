#include "server/solver/estimate.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <span>

namespace radiosity::solver {
namespace {

/// Bilinear interpolation at leaf (x, y) of the area-weighted means of 2 x 2 leaves.
class ParentLevel {
 public:
  ParentLevel(const RadiosityState& state, const Side& side, std::span<const glm::vec3> leaves)
      : width_((side.width + 1) / 2),
        height_((side.height + 1) / 2),
        mean_(std::size_t{width_} * height_),
        area_(mean_.size(), 0.0F) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const std::size_t parent = std::size_t{leaf / side.width / 2} * width_ + leaf % side.width / 2;
      const float area = state.leafArea(side, leaf);
      mean_[parent] += leaves[leaf] * area;
      area_[parent] += area;
    }
    for (std::size_t i = 0; i < mean_.size(); ++i) {
      if (area_[i] > 0.0F) mean_[i] /= area_[i];
    }
  }

  /// False where one of the four parents is empty.
  [[nodiscard]] bool at(std::uint32_t x, std::uint32_t y, glm::vec3& value) const {
    const float px = (static_cast<float>(x) + 0.5F) / 2.0F - 0.5F, py = (static_cast<float>(y) + 0.5F) / 2.0F - 0.5F;
    const float fx = std::floor(px), fy = std::floor(py);
    if (fx < 0.0F || fy < 0.0F || fx + 1.0F >= static_cast<float>(width_) || fy + 1.0F >= static_cast<float>(height_))
      return false;
    const std::size_t i = static_cast<std::size_t>(fy) * width_ + static_cast<std::size_t>(fx);
    if (area_[i] <= 0.0F || area_[i + 1] <= 0.0F || area_[i + width_] <= 0.0F || area_[i + width_ + 1] <= 0.0F)
      return false;
    const float u = px - fx, v = py - fy;
    value = (1.0F - v) * ((1.0F - u) * mean_[i] + u * mean_[i + 1]) +
            v * ((1.0F - u) * mean_[i + width_] + u * mean_[i + width_ + 1]);
    return true;
  }

 private:
  std::uint32_t width_, height_;
  std::vector<glm::vec3> mean_;
  std::vector<float> area_;
};

/// What light that only varies inside shooters costs near by, for each unit of RadiosityState::nodePower it adds.
/// Calibrated against the path tracer: with it stated and true error agree within 10 % on the Cornell box and the small
/// room.
constexpr double kVariationError = 2.0;

struct Sums {
  double square = 0.0, spread = 0.0;     // over all leaves
  double bent = 0.0, bent_square = 0.0;  // over leaves with four parents
};

void addSide(const RadiosityState& state, const Side& side, Sums& sums) {
  std::vector<glm::vec3> first(side.leaf_count), second(side.leaf_count);
  state.halfIrradiance(side, 0, first);
  state.halfIrradiance(side, 1, second);
  const ParentLevel coarse_first(state, side, first), coarse_second(state, side, second);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto area = static_cast<double>(state.leafArea(side, leaf));
    if (area <= 0.0) continue;
    const glm::dvec3 mean(state.irradiance(side, leaf)), difference(0.5F * (first[leaf] - second[leaf]));
    const double square = area * glm::dot(mean, mean);
    sums.square += square;
    sums.spread += area * glm::dot(difference, difference);
    glm::vec3 a, b;
    if (coarse_first.at(leaf % side.width, leaf / side.width, a) &&
        coarse_second.at(leaf % side.width, leaf / side.width, b)) {
      // The halves are independent, so their noise cancels in the product and the bend of the surface remains.
      sums.bent += area * glm::dot(glm::dvec3(first[leaf] - a), glm::dvec3(second[leaf] - b));
      sums.bent_square += square;
    }
  }
}

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
    }
  }
  return received > 0.0 ? std::clamp(reflected / received, 0.0, 0.999) : 0.0;
}

ErrorParts estimateError(const RadiosityState& state, double owed) {
  Sums sums;
  double unshot = owed, varying = 0.0;
  for (const auto& side : state.sides()) {
    addSide(state, side, sums);
    const glm::vec3 net = glm::abs(state.nodeFlux(side.first_node + side.node_count - 1));
    unshot += static_cast<double>(net.x + net.y + net.z);
    varying += std::max(0.0, side.unshot_power - static_cast<double>(net.x + net.y + net.z));
  }
  ErrorParts parts;
  if (sums.square <= 0.0) {
    parts.residual = unshot + varying > 0.0 ? 1.0 : 0.0;  // nothing received: all or nothing is missing
    parts.total = parts.residual;
    return parts;
  }
  parts.sampling = std::sqrt(sums.spread / sums.square);
  // Net unshot light is multiplied by its further bounces; what only varies inside nodes cancels after the first.
  parts.residual =
      (unshot / (1.0 - meanReflectance(state)) + kVariationError * varying) / std::max(receivedFlux(state), 1e-300);
  if (sums.bent_square > 0.0) parts.discretization = std::sqrt(std::max(0.0, sums.bent) / sums.bent_square) / 3.0;
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
