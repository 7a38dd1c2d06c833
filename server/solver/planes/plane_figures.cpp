#include "server/solver/planes/plane_figures.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace radiosity::solver {
namespace {

/// Confidence, one-sided; of each of two tests.
constexpr double kSingle = 0.95, kOfTwo = 0.975;
/// More of all light than this may not be missing where anything is to be judged.
constexpr double kMostOff = 0.1;

double squared(double x) { return x * x; }

/// What the points of a plane tell, in lux.
struct Estimates {
  double rounds = 0.0;
  std::vector<double> light;                ///< by point
  std::vector<double> variance;             ///< of rays alone: withNeighbours()
  std::array<std::vector<double>, 2> half;  ///< light by even rounds alone, and by odd ones
  double solve = 0.0;                       ///< variance that the halves of the solve tell of
  double mean = 0.0, rays_of_mean = 0.0;    ///< its variance by rays alone
  [[nodiscard]] double meanVariance() const { return rays_of_mean + solve; }
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
    of.variance.push_back(varianceOfMean(sum, point.squares[0] + point.squares[1], of.rounds));
    for (std::size_t h = 0; h < 2; ++h) of.half[h].push_back(2.0 * point.light[h] / of.rounds);
  }
  double sum = 0.0, squares = 0.0;
  for (const double mean : rays.means()) {
    sum += mean;
    squares += squared(mean);
  }
  of.variance = withNeighbours(of.variance, rays.grid());
  of.solve = solveVariance(rays, of.rounds);
  of.mean = sum / of.rounds;
  of.rays_of_mean = varianceOfMean(sum, squares, of.rounds);
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

/// Of the light that there is, what the solve may lack, or have too much of.
double missing(double systematic) { return systematic < 0.5 ? systematic / (1.0 - systematic) : 1.0; }

PlaneFigures figuresOf(const Estimates& of, double systematic) {
  PlaneFigures figures;
  figures.mean = of.mean;
  figures.mean_error = std::sqrt(of.meanVariance());
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
        std::sqrt(squared(least.error) + squared(figures.uniformity) * of.meanVariance()) / of.mean;
  }
  figures.solve_error = missing(systematic) * of.mean;
  return figures;
}

Verdict verdictOf(bool passes, bool fails) {
  return passes ? Verdict::kPasses : fails ? Verdict::kFails : Verdict::kUndecided;
}

/// Probability that Student's t of whole degrees of freedom lies within +-t: Abramowitz and Stegun, "Handbook of
/// mathematical functions", 1964, 26.7.3 and 26.7.4.
double studentWithin(double t, int freedom) {
  const double angle = std::atan(t / std::sqrt(freedom)), square = squared(std::cos(angle));
  const bool is_odd = freedom % 2 == 1;
  double term = is_odd ? std::cos(angle) : 1.0, sum = freedom > 1 ? term : 0.0;
  for (int k = is_odd ? 3 : 2; k < freedom - 1; k += 2) {
    term *= square * (k - 1) / k;
    sum += term;
  }
  sum *= std::sin(angle);
  return is_odd ? 2.0 / std::numbers::pi * (angle + sum) : sum;
}

/// Variance of an estimate by rays, which scatter from round to round, and by the solve.
struct Variance {
  double rays = 0.0, rounds = 0.0, solve = 0.0;

  /// How far off it is at most, at this confidence, one-sided. Two halves of one solve have one degree of freedom,
  /// since they may differ by the same amount everywhere (Welch and Satterthwaite's approximation of those of the sum).
  [[nodiscard]] double bound(double confidence) const {
    const double sum = rays + solve;
    if (!(sum > 0.0)) return 0.0;
    const double freedom = squared(sum) / (squared(rays) / (rounds - 1.0) + squared(solve));
    return studentQuantile(confidence, freedom) * std::sqrt(sum);
  }
};

class Tests {
 public:
  Tests(const Estimates& of, double systematic, bool are_two)
      : of_(of), off_(missing(systematic) * of.mean), failing_(are_two ? kOfTwo : kSingle) {}

  [[nodiscard]] Verdict mean(double lux) const {
    const Variance variance{of_.rays_of_mean, of_.rounds, of_.solve};
    const double above = of_.mean - lux;
    return verdictOf(above - variance.bound(kSingle) - off_ >= 0.0, above + variance.bound(failing_) + off_ < 0.0);
  }

  /// A point and the mean, which it is compared with, may be off by what the solve lacks in opposite directions.
  [[nodiscard]] Verdict uniformity(double wanted) const {
    const double off = (1.0 + wanted) * off_;
    bool passes = of_.mean > 0.0;
    for (std::size_t i = 0; i < of_.light.size() && passes; ++i)
      passes = above(of_.light[i], wanted) - ofPoint(of_.variance[i], of_.rounds, wanted).bound(kSingle) - off >= 0.0;
    const auto found = std::min_element(of_.half[0].begin(), of_.half[0].end());
    const auto i = static_cast<std::size_t>(found - of_.half[0].begin());
    // Half of the rays: twice the variance.
    const double bound = ofPoint(2.0 * of_.variance[i], 0.5 * of_.rounds, wanted).bound(failing_);
    return verdictOf(passes, above(of_.half[1][i], wanted) + bound + off < 0.0);
  }

 private:
  [[nodiscard]] double above(double light, double wanted) const { return light - wanted * of_.mean; }
  [[nodiscard]] Variance ofPoint(double of_rays, double rounds, double wanted) const {
    return {of_rays + squared(wanted) * of_.rays_of_mean, rounds, squared(1.0 + wanted) * of_.solve};
  }

  const Estimates& of_;
  double off_, failing_;
};

PlaneVerdict verdictOn(const Estimates& of, double systematic, const PlaneGoal& goal) {
  PlaneVerdict verdict;
  if (!goal.lux && !goal.uniformity) return verdict;
  const Tests tests(of, systematic, goal.lux && goal.uniformity);
  const bool is_known = systematic <= kMostOff;
  if (goal.lux) verdict.lux = is_known ? tests.mean(*goal.lux) : Verdict::kUndecided;
  if (goal.uniformity) verdict.uniformity = is_known ? tests.uniformity(*goal.uniformity) : Verdict::kUndecided;
  const auto is = [&](Verdict which) { return verdict.lux == which || verdict.uniformity == which; };
  verdict.all = is(Verdict::kFails)       ? Verdict::kFails
                : is(Verdict::kUndecided) ? Verdict::kUndecided
                                          : Verdict::kPasses;
  return verdict;
}

}  // namespace

double studentQuantile(double confidence, double freedom) {
  constexpr double kMostFreedom = 10'000.0;  // there it is the normal distribution's to a ten-thousandth
  const auto whole = static_cast<int>(std::clamp(freedom, 1.0, kMostFreedom));
  double least = 0.0, most = 1.0;
  while (studentWithin(most, whole) < 2.0 * confidence - 1.0) most *= 2.0;
  for (int step = 0; step < 50; ++step) {
    const double middle = 0.5 * (least + most);
    (studentWithin(middle, whole) < 2.0 * confidence - 1.0 ? least : most) = middle;
  }
  return most;
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
