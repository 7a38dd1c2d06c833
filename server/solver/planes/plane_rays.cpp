#include "server/solver/planes/plane_rays.h"

#include <algorithm>
#include <cmath>

#include "common/parallel.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Of points, that a thread takes at a time: some tenths of a millisecond.
constexpr std::size_t kPointsAPart = 16;

}  // namespace

glm::dvec3 PlaneGrid::pointAt(std::size_t point) const {
  const auto column = static_cast<double>(point % columns), row = static_cast<double>(point / columns);
  return corner + (column + 0.5) / columns * across + (row + 0.5) / rows * down;
}

double luminous(const glm::dvec3& light) { return 0.2126 * light.x + 0.7152 * light.y + 0.0722 * light.z; }

double varianceOfMean(double sum, double squares, double rounds) {
  if (rounds < 2.0) return 0.0;
  return std::max(0.0, squares - sum * sum / rounds) / (rounds - 1.0) / rounds;
}

PlaneRays::PlaneRays(const PlaceLight& light, const PlaneGrid& grid, std::uint64_t key)
    : light_(light), grid_(grid), key_(key), points_(grid.pointCount()) {}

void PlaneRays::addRound() {
  const auto round = means_.size();
  std::vector<double> sums((points_.size() + kPointsAPart - 1) / kPointsAPart);
  inTurns(sums.size(), [&](std::size_t part) {
    const auto end = std::min(points_.size(), (part + 1) * kPointsAPart);
    for (auto i = part * kPointsAPart; i < end; ++i) {
      const auto spot = PlaceLight::spotAt(grid_.pointAt(i), grid_.normal);
      const auto arrives = light_.arriving(spot, mixKeys(mixKeys(key_, i), round), kRays);
      const double reflected = luminous(arrives.reflected), light = luminous(arrives.direct) + reflected;
      const double off = luminous(arrives.off);
      auto& point = points_[i];
      point.light[round % 2] += light;
      point.squares[round % 2] += light * light;
      point.reflected += reflected;
      point.off += off;
      point.off_squares += off * off;
      sums[part] += light;
    }
  });
  double sum = 0.0;
  for (const double of_part : sums) sum += of_part;
  means_.push_back(sum / static_cast<double>(points_.size()));
}

void PlaneRays::addRounds() {
  addRound();
  addRound();
}

bool PlaneRays::isSure(double wanted) const {
  const auto count = static_cast<double>(rounds());
  double variance = 0.0, light = 0.0;
  for (const auto& point : points_) {
    const double sum = point.light[0] + point.light[1];
    variance += varianceOfMean(sum, point.squares[0] + point.squares[1], count);
    light += sum / count;
  }
  const auto points = static_cast<double>(points_.size());
  return std::sqrt(variance / points) <= wanted * light / points;
}

void PlaneRays::measure(double wanted) {
  const auto of_round = (kRays + light_.looksAPoint(kRays)) * points_.size();
  const auto most = std::clamp<std::uint64_t>(kMostRays / of_round, kFewestRounds, kMostRounds);
  while (rounds() < std::min<std::uint64_t>(most, kLeastRounds) || (rounds() + 2 <= most && !isSure(wanted)))
    addRounds();
}

}  // namespace radiosity::solver
