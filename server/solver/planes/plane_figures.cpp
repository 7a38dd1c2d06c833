#include "server/solver/planes/plane_figures.h"

#include <algorithm>
#include <cmath>

namespace radiosity::solver {
namespace {

/// Normal quantiles of 95 % and 97.5 %, one-sided.
constexpr double kSingle = 1.6448536, kOfTwo = 1.9599640;

double squared(double x) { return x * x; }

/// Of a plane: what its points tell, in lux.
struct Estimates {
  double rounds = 0.0;
  std::vector<double> light, reflected;     ///< by point
  std::vector<double> variance;             ///< of rays alone: withNeighbours()
  std::array<std::vector<double>, 2> half;  ///< light by even rounds alone, and by odd ones
  double solve = 0.0;                       ///< variance that the halves of the solve tell of
  double mean = 0.0, mean_variance = 0.0;   ///< all of it
  double mean_reflected = 0.0;
};

/// Of what points are off by, the noise of the rays that tell it is taken away. As part of the mean all of it counts,
/// as if it were the same at all points.
double solveVariance(const PlaneRays& rays, double rounds) {
  double sum = 0.0;
  for (const auto& point : rays.points())
    sum += squared(point.off / rounds) - varianceOfMean(point.off, point.off_squares, rounds);
  return std::max(0.0, sum / static_cast<double>(rays.points().size()));
}

/// Where light comes from a few directions that rays seldom find, the rounds of a single point scatter too little now
/// and then: the mean variance of up to nine points around it stands for its own where that is smaller.
std::vector<double> withNeighbours(const std::vector<double>& own, const PlaneGrid& grid) {
  std::vector<double> larger;
  larger.reserve(own.size());
  for (std::uint32_t row = 0; row < grid.rows; ++row) {
    for (std::uint32_t column = 0; column < grid.columns; ++column) {
      double sum = 0.0, count = 0.0;
      for (auto r = row - std::min(row, 1U); r < std::min(row + 2, grid.rows); ++r) {
        for (auto c = column - std::min(column, 1U); c < std::min(column + 2, grid.columns); ++c) {
          sum += own[std::size_t{r} * grid.columns + c];
          count += 1.0;
        }
      }
      larger.push_back(std::max(own[larger.size()], sum / count));
    }
  }
  return larger;
}

Estimates estimatesOf(const PlaneRays& rays) {
  Estimates of;
  of.rounds = rays.rounds();
  for (const auto& point : rays.points()) {
    const double sum = point.light[0] + point.light[1];
    of.light.push_back(sum / of.rounds);
    of.reflected.push_back(point.reflected / of.rounds);
    of.variance.push_back(varianceOfMean(sum, point.squares[0] + point.squares[1], of.rounds));
    for (std::size_t h = 0; h < 2; ++h) of.half[h].push_back(2.0 * point.light[h] / of.rounds);
    of.mean_reflected += of.reflected.back() / static_cast<double>(rays.points().size());
  }
  double sum = 0.0, squares = 0.0;
  for (const double mean : rays.means()) {
    sum += mean;
    squares += squared(mean);
  }
  of.variance = withNeighbours(of.variance, rays.grid());
  of.solve = solveVariance(rays, of.rounds);
  of.mean = sum / of.rounds;
  of.mean_variance = varianceOfMean(sum, squares, of.rounds) + of.solve;
  return of;
}

struct Extreme {
  double value = 0.0, error = 0.0;
};

/// Least or greatest: found by one half, told by the other.
template <typename Before>
Extreme extremeOf(const Estimates& of, Before before) {
  Extreme extreme;
  double variance = 0.0;
  for (std::size_t h = 0; h < 2; ++h) {
    const auto found = std::min_element(of.half[h].begin(), of.half[h].end(), before);
    const auto point = static_cast<std::size_t>(found - of.half[h].begin());
    extreme.value += 0.5 * of.half[1 - h][point];
    variance += 0.5 * of.variance[point];
  }
  extreme.error = std::sqrt(variance + of.solve);
  return extreme;
}

PlaneFigures figuresOf(const Estimates& of, double systematic) {
  PlaneFigures figures;
  figures.mean = of.mean;
  figures.mean_error = std::sqrt(of.mean_variance);
  const auto least = extremeOf(of, std::less<>()), greatest = extremeOf(of, std::greater<>());
  // Noise may put either beyond the mean, where it cannot be.
  figures.minimum = std::min(least.value, of.mean);
  figures.minimum_error = least.error;
  figures.maximum = std::max(greatest.value, of.mean);
  figures.maximum_error = greatest.error;
  auto sorted = of.light;
  std::ranges::sort(sorted);
  figures.median = 0.5 * (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]);
  if (of.mean > 0.0) {
    figures.uniformity = figures.minimum / of.mean;
    figures.uniformity_error =
        std::sqrt(squared(least.error) + squared(figures.uniformity) * of.mean_variance) / of.mean;
  }
  figures.solve_error = systematic * of.mean_reflected;
  return figures;
}

Verdict verdictOf(bool passes, bool fails) {
  return passes ? Verdict::kPasses : fails ? Verdict::kFails : Verdict::kUndecided;
}

class Tests {
 public:
  Tests(const Estimates& of, double systematic, bool are_two)
      : of_(of),
        systematic_(systematic),
        passes_(studentQuantile(kSingle, of.rounds - 1.0)),
        fails_(studentQuantile(are_two ? kOfTwo : kSingle, of.rounds - 1.0)),
        fails_half_(studentQuantile(are_two ? kOfTwo : kSingle, 0.5 * of.rounds - 1.0)) {}

  [[nodiscard]] Verdict mean(double lux) const {
    const double above = of_.mean - lux, error = std::sqrt(of_.mean_variance);
    const double off = systematic_ * of_.mean_reflected;
    return verdictOf(above - passes_ * error - off >= 0.0, above + fails_ * error + off < 0.0);
  }

  [[nodiscard]] Verdict uniformity(double wanted) const {
    bool passes = of_.mean > 0.0;
    for (std::size_t i = 0; i < of_.light.size() && passes; ++i)
      passes = above(of_.light[i], i, wanted) - passes_ * error(of_.variance[i], wanted) - off(i, wanted) >= 0.0;
    const auto found = std::min_element(of_.half[0].begin(), of_.half[0].end());
    const auto i = static_cast<std::size_t>(found - of_.half[0].begin());
    // Half of the rays: twice the variance.
    const double bound = above(of_.half[1][i], i, wanted) + fails_half_ * error(2.0 * of_.variance[i], wanted);
    return verdictOf(passes, bound + off(i, wanted) < 0.0);
  }

 private:
  [[nodiscard]] double above(double light, std::size_t /*point*/, double wanted) const {
    return light - wanted * of_.mean;
  }
  [[nodiscard]] double error(double of_rays, double wanted) const {
    return std::sqrt(of_rays + of_.solve + squared(wanted) * of_.mean_variance);
  }
  /// What the solve may be off by changes the point and the mean at the same time.
  [[nodiscard]] double off(std::size_t point, double wanted) const {
    return systematic_ * std::abs(of_.reflected[point] - wanted * of_.mean_reflected);
  }

  const Estimates& of_;
  double systematic_, passes_, fails_, fails_half_;
};

PlaneVerdict verdictOn(const Estimates& of, double systematic, const PlaneGoal& goal) {
  PlaneVerdict verdict;
  if (!goal.lux && !goal.uniformity) return verdict;
  const Tests tests(of, systematic, goal.lux && goal.uniformity);
  const bool is_known = systematic < 1.0;
  if (goal.lux) verdict.lux = is_known ? tests.mean(*goal.lux) : Verdict::kUndecided;
  if (goal.uniformity) verdict.uniformity = is_known ? tests.uniformity(*goal.uniformity) : Verdict::kUndecided;
  const auto is = [&](Verdict which) { return verdict.lux == which || verdict.uniformity == which; };
  verdict.all = is(Verdict::kFails)       ? Verdict::kFails
                : is(Verdict::kUndecided) ? Verdict::kUndecided
                                          : Verdict::kPasses;
  return verdict;
}

}  // namespace

double studentQuantile(double normal, double freedom) {
  const double z = normal, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
  return z + (z3 + z) / (4.0 * freedom) + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * freedom * freedom) +
         (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * freedom * freedom * freedom);
}

PlaneResult planeFigures(const PlaneRays& rays, double systematic, const PlaneGoal& goal, double unit) {
  const auto of = estimatesOf(rays);
  PlaneResult result{figuresOf(of, systematic), verdictOn(of, systematic, goal), of.light, {}};
  for (const double variance : of.variance) result.error.push_back(unit * std::sqrt(variance + of.solve));
  for (auto& light : result.light) light *= unit;
  auto& f = result.figures;
  for (auto* value :
       {&f.mean, &f.mean_error, &f.minimum, &f.minimum_error, &f.maximum, &f.maximum_error, &f.median, &f.solve_error})
    *value *= unit;
  return result;
}

}  // namespace radiosity::solver
