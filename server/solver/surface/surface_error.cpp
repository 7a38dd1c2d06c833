#include "server/solver/surface/surface_error.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

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
/// What is taken for the truth: the mean of both estimates, whose noise has half the square of that of each. So twice
/// the square of the percentile by the first, less that by the second, is that without noise; it may be off, but by so
/// much of the first at most.
constexpr std::array<std::array<double, 2>, 1> kBothEstimates{{{0.5, 0.5}}};
constexpr std::array<std::array<double, 2>, 2> kEachEstimate{{{1.0, 0.0}, {0.0, 1.0}}};
constexpr double kLeastOfP95 = 0.1;
/// Of a total, what it may be off by.
constexpr double kSurePart = 0.12;

/// Part of the places that are spread by area alone.
constexpr double kByArea = 0.5;
/// Of the light of a leaf, what lookups may be off by where it is even, and where a part of the leaf is hidden or
/// something passes through it.
constexpr float kEvenPart = 0.1F, kHiddenPart = 0.5F;

/// By leaf value: about the square of what lookups there may be off by, from the light of a leaf and those around it.
std::vector<float> riskOfLeaves(const SolvedScene& solved, const std::vector<Side>& sides) {
  const auto& patches = solved.patches;
  std::vector<float> risks;
  for (const auto& side : sides) {
    const auto& surface = patches.surfaces[side.surface];
    const auto isLit = [&](std::uint32_t leaf) { return patches.node_area[side.first_node + leaf] > 0.0F; };
    const auto lightOf = [&](std::uint32_t leaf) { return solved.irradiance[side.first_node + leaf]; };
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const std::uint32_t x = leaf % side.width, y = leaf / side.width;
      const auto light = lightOf(leaf);
      glm::vec3 least = light, most = light;
      for (auto ny = y > 0 ? y - 1 : 0; ny <= std::min(y + 1, side.height - 1); ++ny) {
        for (auto nx = x > 0 ? x - 1 : 0; nx <= std::min(x + 1, side.width - 1); ++nx) {
          const auto near = ny * side.width + nx;
          if (!isLit(near)) continue;
          least = glm::min(least, lightOf(near));
          most = glm::max(most, lightOf(near));
        }
      }
      const auto& place = patches.leaves[surface.first_leaf + leaf];
      const auto own = (place.full && !place.cut ? kEvenPart : kHiddenPart) * light, range = most - least;
      risks.push_back(glm::dot(range, range) + glm::dot(own, own));
    }
  }
  return risks;
}

double channelMean(const glm::dvec3& light) { return (light.x + light.y + light.z) / 3.0; }

}  // namespace

SurfaceError::SurfaceError(const SolvedScene& solved, std::uint64_t seed, std::size_t places)
    : light_(solved), seed_(mixKeys(seed, 0x53555246ULL)) {
  const auto risks = riskOfLeaves(solved, light_.sides());
  const auto areaOf = [&](std::size_t value) { return light_.rays().areaOf(static_cast<std::uint32_t>(value)); };
  double area = 0.0, risk = 0.0;
  for (std::size_t value = 0; value < risks.size(); ++value) {
    area += areaOf(value);
    risk += areaOf(value) * static_cast<double>(risks[value]);
  }
  if (area <= 0.0) return;
  // By value: the chance of a place, an area.
  const auto density = [&](std::size_t value) {
    if (!(risk > 0.0) || !std::isfinite(risk)) return 1.0 / area;
    return kByArea / area + (1.0 - kByArea) * static_cast<double>(risks[value]) / risk;
  };
  std::vector<double> up_to;
  double all = 0.0;
  for (std::size_t value = 0; value < risks.size(); ++value) up_to.push_back(all += areaOf(value) * density(value));
  for (std::uint32_t round = 0; round < kMostRounds; ++round) {
    const auto key = mixKeys(seed_, round);
    for (std::uint32_t i = 0; i < places; ++i) {  // one of each stretch
      const auto at = sobol4(i, key);
      const double where = (static_cast<double>(i) + uniformFromKey(mixKeys(key, i))) / static_cast<double>(places);
      const auto value = static_cast<std::uint32_t>(std::ranges::upper_bound(up_to, where * all) - up_to.begin());
      if (value >= up_to.size()) continue;
      spots_.push_back(light_.spotOn(value, glm::vec2(at.x, at.y)));
      stands_for_.push_back(1.0 / (static_cast<double>(places) * density(value)));
    }
    round_ends_.push_back(spots_.size());
  }
  light_at_.resize(spots_.size());
}

std::vector<SurfaceError::Lookup> SurfaceError::lookups() const {
  std::vector<Lookup> lookups;
  for (std::size_t i = 0; i < spots_.size(); ++i) lookups.push_back(lookupAt(i));
  return lookups;
}

SurfaceError::Lookup SurfaceError::lookupAt(std::size_t place) const {
  const auto& side = light_.rays().sideOf(spots_[place].place.value);
  return {side.surface, side.side, spots_[place].texel};
}

bool SurfaceError::advance(double seconds) {
  RAD_CHECK_EQ(found_.size(), spots_.size());
  const auto start = std::chrono::steady_clock::now();
  const auto spent = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  is_done_ = is_done_ || spots_.empty();
  while (!is_done_) {
    addSlice();
    // Whatever is thrown from here on, the round is whole.
    if (isWhole()) is_done_ = rounds_ >= most_rounds_ || isSure();
    if (spent() >= seconds) break;
  }
  return is_done_;
}

/// Where memory ends in the middle of it nothing of it is added.
void SurfaceError::addSlice() {
  const auto first = done_, end = std::min(round_ends_[rounds_], first + kPlacesASlice);
  std::vector<std::array<glm::dvec3, 2>> arriving(end - first);
  inTurns(2 * arriving.size(), [&](std::size_t part) {
    const auto i = first + part / 2;
    arriving[part / 2][part % 2] = light_.arriving(spots_[i], mixKeys(mixKeys(seed_, i), part % 2));
  });
  std::ranges::copy(arriving, light_at_.begin() + static_cast<std::ptrdiff_t>(first));
  done_ = end;
  if (done_ == round_ends_[rounds_]) ++rounds_;
}

/// More places tell more of both: of edges that few of them lie on, and of the noise of the estimates.
bool SurfaceError::isSure() const {
  const auto parts = stated();
  return parts.deviation <= std::max(wanted_deviation_, kSurePart * parts.total);
}

std::vector<SurfaceError::Measured> SurfaceError::measured() const {
  std::vector<Measured> all;
  const auto rounds = static_cast<double>(std::max(1U, rounds_));
  for (std::size_t i = 0; i < placeCount(); ++i) {
    const glm::dvec3 found(found_[i]);
    all.push_back({lookupAt(i), glm::dot(found - trueLight(i, 0), found - trueLight(i, 1)), stands_for_[i] / rounds});
  }
  return all;
}

/// The estimates are independent, so that their noise cancels in the product of what a lookup differs from either by.
SurfaceErrorParts SurfaceError::stated() const {
  SurfaceErrorParts parts;
  parts.places = placeCount();
  const auto count = static_cast<double>(parts.places);
  double wrong = 0.0, squares = 0.0, light = 0.0, mean = 0.0, area = 0.0;
  for (std::size_t i = 0; i < placeCount(); ++i) {
    const glm::dvec3 found(found_[i]);
    const auto one = trueLight(i, 0), other = trueLight(i, 1);
    const double product = stands_for_[i] * glm::dot(found - one, found - other);
    wrong += product;
    squares += product * product;
    light += stands_for_[i] * glm::dot(one, other);
    mean += stands_for_[i] * channelMean(one + other) / 2.0;
    area += stands_for_[i];
  }
  if (area > 0.0) mean /= area;
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
  const double floor = kFloor * mean, both = percentile(kBothEstimates, floor),
               single = percentile(kEachEstimate, floor);
  parts.p95 = std::sqrt(std::max(2.0 * both * both - single * single, kLeastOfP95 * both * both));
  return parts;
}

/// What places of kPercentile of the area are off by less than, relative to their light, or to `floor` where it is
/// less. `weights`: the truth is taken for each of these sums of both estimates.
double SurfaceError::percentile(std::span<const std::array<double, 2>> weights, double floor) const {
  std::vector<std::pair<double, double>> off;  // and the area of that
  double area = 0.0;
  for (std::size_t i = 0; i < placeCount(); ++i) {
    const double one = channelMean(trueLight(i, 0)), other = channelMean(trueLight(i, 1));
    const double found = channelMean(glm::dvec3(found_[i])), light = std::max(0.5 * (one + other), floor);
    for (const auto& weight : weights) {
      off.emplace_back(std::abs(found - weight[0] * one - weight[1] * other) / light, stands_for_[i]);
      area += stands_for_[i];
    }
  }
  std::ranges::sort(off);
  double below = 0.0;
  for (const auto& [by, of] : off) {
    below += of;
    if (below >= kPercentile * area) return by;
  }
  return off.empty() ? 0.0 : off.back().first;
}

}  // namespace radiosity::solver
