// What a lighting designer reads of a measuring plane: mean, minimum, uniformity, and whether they reach what is asked,
// each with its standard error. Pure functions of sums; any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/solver/planes/plane_rays.h"

namespace radiosity::solver {

/// Lux, or whatever `unit` of planeFigures() makes of it. Errors are standard errors: of rays, and of what the two
/// halves of the solve differ by.
struct PlaneFigures {
  double mean = 0.0, mean_error = 0.0;
  /// Of all points. Each is found by one half of the rays and measured by the other, in both ways, so that it is not
  /// the noisiest of many points. Where points are closer together than their errors the one that is found may not be
  /// the least: the minimum is then too great, and U0 with it, by up to about their error. Verdicts are free of that.
  double minimum = 0.0, minimum_error = 0.0, maximum = 0.0, maximum_error = 0.0;
  double median = 0.0;
  double uniformity = 0.0, uniformity_error = 0.0;  ///< U0: the minimum divided by the mean
  /// What the mean may be off by since the solve has not ended, or has texels that are too wide; no sampling error.
  double solve_error = 0.0;
};

enum class Verdict { kPasses, kFails, kUndecided };

/// Each at a confidence of 95 %; nothing where nothing is asked for. `all`: passes where all do, fails where one does.
struct PlaneVerdict {
  std::optional<Verdict> lux, uniformity, all;
};

/// What is asked for: the mean at least, and U0 at least.
struct PlaneGoal {
  std::optional<double> lux, uniformity;
};

struct PlaneResult {
  PlaneFigures figures;
  PlaneVerdict verdict;
  std::vector<double> light, error;  ///< by point
};

/// `systematic`: the part of all light that the solve may be off by beyond what its halves differ by; nothing is judged
/// where that is more than a tenth. `unit`: all figures are multiplied by it.
///
/// Tests, one-sided, by Student's t: of rays with rounds - 1 degrees of freedom, of the solve with one, since its two
/// halves may differ by the same amount everywhere. The mean passes where its lower bound is not
/// below what is asked, and fails where its upper bound is. U0 passes where each single point, by its own lower bound,
/// is at least that part of the mean (an intersection-union test: Berger 1982, "Multiparameter hypothesis testing and
/// acceptance sampling", so no correction for the number of points is due). It fails where the darkest point by one
/// half of the rays is below it by the upper bound of the other half. Both bounds widen by what the solve may be off
/// by, at the point and in the mean. Where both are asked for each test of a failure is at 97.5 %.
[[nodiscard]] PlaneResult planeFigures(const PlaneRays& rays, double systematic, const PlaneGoal& goal,
                                       double unit = 1.0);

/// The value that Student's t stays below with this probability, above a half; of degrees of freedom, at least one, the
/// whole part counts, which is on the safe side. Cost: microseconds for some tens of degrees.
[[nodiscard]] double studentQuantile(double confidence, double freedom);

}  // namespace radiosity::solver
