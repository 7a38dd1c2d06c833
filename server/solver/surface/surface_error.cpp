#include "server/solver/surface/surface_error.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/check.h"
#include "common/parallel.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Places between two looks at the clock.
constexpr std::size_t kPlacesASlice = 64;
/// Darker places than this part of the mean count as if they had so much.
constexpr double kFloor = 0.01;
constexpr double kPercentile = 0.95;

double channelMean(const glm::dvec3& light) { return (light.x + light.y + light.z) / 3.0; }

}  // namespace

SurfaceError::SurfaceError(PlaceLight light, std::uint64_t seed, std::size_t places)
    : light_(std::move(light)), seed_(mixKeys(seed, 0x53555246ULL)) {
  std::vector<double> up_to;
  double area = 0.0;
  for (const auto& side : light_.sides()) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      up_to.push_back(area += light_.rays().areaOf(side.first_value + leaf));
  }
  if (area <= 0.0) return;
  area_ = area;
  for (std::uint32_t i = 0; i < places; ++i) {  // one of each stretch
    const auto at = sobol4(i, seed_);
    const double where = (static_cast<double>(i) + uniformFromKey(mixKeys(seed_, i))) / static_cast<double>(places);
    const auto value = static_cast<std::uint32_t>(std::ranges::upper_bound(up_to, where * area) - up_to.begin());
    if (value < up_to.size()) spots_.push_back(light_.spotOn(value, glm::vec2(at.x, at.y)));
  }
  true_.resize(spots_.size());
}

std::vector<SurfaceError::Lookup> SurfaceError::lookups() const {
  std::vector<Lookup> lookups;
  for (const auto& spot : spots_) {
    const auto& side = light_.rays().sideOf(spot.place.value);
    lookups.push_back({side.surface, side.side, spot.texel});
  }
  return lookups;
}

bool SurfaceError::advance(double seconds) {
  RAD_CHECK_EQ(found_.size(), spots_.size());
  const auto start = std::chrono::steady_clock::now();
  const auto spent = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  while (done_ < spots_.size()) {
    const auto first = done_;
    const auto end = std::min(spots_.size(), first + kPlacesASlice);
    inTurns(2 * (end - first), [&](std::size_t part) {
      const auto i = first + part / 2;
      true_[i][part % 2] = light_.arriving(spots_[i], mixKeys(mixKeys(seed_, i), part % 2));
    });
    done_ = end;
    if (spent() >= seconds) break;
  }
  return done_ == spots_.size();
}

std::vector<SurfaceError::Measured> SurfaceError::measured() const {
  std::vector<Measured> all;
  for (std::size_t i = 0; i < spots_.size(); ++i) {
    const glm::dvec3 found(found_[i]);
    all.push_back({light_.rays().sideOf(spots_[i].place.value).surface,
                   glm::dot(found - true_[i][0], found - true_[i][1]), area_ / static_cast<double>(spots_.size())});
  }
  return all;
}

/// The estimates are independent, so that their noise cancels in the product of what a lookup differs from either by.
SurfaceErrorParts SurfaceError::stated() const {
  SurfaceErrorParts parts;
  parts.places = spots_.size();
  const auto count = static_cast<double>(spots_.size());
  double wrong = 0.0, squares = 0.0, light = 0.0, mean = 0.0;
  std::vector<double> products;
  for (std::size_t i = 0; i < spots_.size(); ++i) {
    const glm::dvec3 found(found_[i]);
    const double product = glm::dot(found - true_[i][0], found - true_[i][1]);
    wrong += product;
    squares += product * product;
    light += glm::dot(true_[i][0], true_[i][1]);
    mean += channelMean(true_[i][0] + true_[i][1]) / 2.0 / count;
  }
  if (!std::isfinite(wrong)) {  // lookups find what is no number
    parts.total = parts.p95 = 1.0;
    return parts;
  }
  if (!(light > 0.0)) {  // what lookups find is all wrong
    parts.total = parts.p95 = std::ranges::any_of(found_, [](const glm::vec3& at) { return at != glm::vec3(0.0F); });
    return parts;
  }
  parts.total = std::sqrt(std::max(0.0, wrong) / light);
  const double deviation = std::sqrt(std::max(0.0, squares - wrong * wrong / count)) / light;
  parts.deviation =
      parts.total > 0.0 ? std::min(std::sqrt(deviation), 0.5 * deviation / parts.total) : std::sqrt(deviation);
  std::vector<double> off;
  for (std::size_t i = 0; i < spots_.size(); ++i) {
    const auto true_light = 0.5 * (true_[i][0] + true_[i][1]);
    off.push_back(std::abs(channelMean(glm::dvec3(found_[i]) - true_light)) /
                  std::max(channelMean(true_light), kFloor * mean));
  }
  const auto at = off.begin() + static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(off.size() - 1));
  std::nth_element(off.begin(), at, off.end());
  parts.p95 = *at;
  return parts;
}

}  // namespace radiosity::solver
