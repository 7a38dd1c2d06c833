#include "server/solver/reflected/shaded_rays.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

namespace radiosity::solver {
namespace {

constexpr double kMostCode = std::numeric_limits<std::int16_t>::max();

/// How many times as much all rays count where those below the slope `least` count as if at it, so that light which
/// changes evenly from one horizon to the other is right in the mean.
double scaleFor(double least) {
  const double limit = std::acos(least), sine = std::sin(limit);
  const double counted = 0.5 * limit - 0.25 * std::sin(2.0 * limit) + (1.0 - sine * sine * sine) / (3.0 * least);
  return 0.25 * std::numbers::pi / counted;
}

}  // namespace

void ShadedRays::clear() {
  leaves_.clear();
  weights_.clear();
}

void ShadedRays::reserve(std::size_t leaves, std::size_t rays) {
  leaves_.reserve(leaves);
  weights_.reserve(rays);
}

/// A ray counts by the tangent of its angle, without bound towards the horizon, so that few rays would make most of the
/// noise: its slope is bounded, the lower the more rays there are.
void ShadedRays::beginLeaf(std::uint32_t rays, const glm::dvec3& normal) {
  Leaf leaf;
  leaf.first = weights_.size();
  leaf.count = rays < 2 ? 0 : rays;
  normal_ = normal;
  if (leaf.count > 0) {
    least_ = 0.5 / std::sqrt(static_cast<double>(rays));
    scale_ = scaleFor(least_);
    leaf.unit = (1.0 + scale_ / least_) / (static_cast<double>(rays - 1) * kMostCode);
  }
  leaves_.push_back(leaf);
}

/// Rays lie as dense as cosines with the normal of the face, which what they bring is to be divided by, and multiplied
/// by those with the shading normal. Light that is the same from everywhere is known without that; how it differs is
/// what the rays tell.
void ShadedRays::addRay(const glm::dvec3& face, const glm::dvec3& direction) {
  auto& leaf = leaves_.back();
  const double even = 1.0 / leaf.count, differs = 1.0 / (leaf.count - 1.0);
  const double cosine = glm::dot(direction, face), facing = glm::dot(normal_, face);
  const auto across = (scale_ / std::max(cosine, least_)) * (direction - cosine * face);
  const double below = std::max(0.0, -(facing + glm::dot(normal_, across))) * differs;
  const auto code = [&](double weight) {
    return static_cast<std::int16_t>(std::lround(std::clamp(weight / leaf.unit, -kMostCode, kMostCode)));
  };
  Weights weights{};
  for (int axis = 0; axis < 3; ++axis) {
    weights[static_cast<std::size_t>(axis)] = code(even * face[axis] + differs * across[axis]);
    leaf.mean[static_cast<std::size_t>(axis)] -= differs * across[axis];
  }
  weights[3] = code(below);
  leaf.mean[3] += 0.5 * (1.0 - facing) * even - below;
  weights_.push_back(weights);
}

}  // namespace radiosity::solver
