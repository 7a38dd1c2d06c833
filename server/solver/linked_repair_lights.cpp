// After an edit of geometry: lights look again with some of their points first, and with as many more as the shadows
// need. Most edits change little of the light of a lamp, and each of its looks takes as long as several others; the
// points that are left look when nothing else is to be done.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/solver/linked_solver.h"

namespace radiosity::solver {
namespace {

/// A light's points look in shots of kLightPoints, the first of what is left of a division.
std::uint32_t shotsFor(std::uint32_t points) { return (points + kLightPoints - 1) / kLightPoints; }

}  // namespace

/// Of a light's shots, those that are next. The first have the coarse images (PlannerSettings::lightResolution): until
/// the others look, what they blur is blurred beside leaves of which most samples did not.
LinkedSolver::ShotRange LinkedSolver::shotsOfLight(const Repair& repair) const {
  const auto all = shotsFor(repair.samples), first = shotsFor(repair.looked);
  const bool rest = repair.whole || !lights_may_be_rough_ || phase_ == Phase::kDone || repair.first_shots <= first;
  return {first, rest ? all : std::min(all, repair.first_shots)};
}

/// Where both halves of a light have looked at these leaves: the square of what their mean is wrong by, times area.
double LinkedSolver::noiseBetweenHalves(const Repair& repair, std::span<const LinkColumn::ValueRun> leaves) const {
  if (repair.half == 0) return 0.0;
  const auto& shooter = system_.shooters()[repair.shooter];
  const auto radiosity = [&](std::size_t half) {
    return static_cast<float>(0.5 * shooter.carried(half)) * glm::length(shooter.sent[half]);
  };
  const std::array<float, 2> sent{radiosity(0), radiosity(1)};
  std::array<std::vector<float>, 2> links;
  double square = 0.0;
  for (const auto& run : leaves) {
    for (std::size_t half = 0; half < 2; ++half) {
      links[half].assign(run.count, 0.0F);
      (void)shooter.column[half].decode(run.first, links[half]);
    }
    for (std::uint32_t i = 0; i < run.count; ++i) {
      const float differ = sent[0] * links[0][i] - sent[1] * links[1][i];
      square += static_cast<double>(system_.leafAreas()[run.first + i] * differ * differ);
    }
  }
  return square;
}

/// What few points find is noisier than what all would: then the lights whose shadows are the noisiest look with more
/// before light is solved for. Of independent points n times as many leave an nth of the square; these are spread
/// better than that, but texels of which a shadow's edge hides a part are not.
bool LinkedSolver::lightsAreTooRough() {
  if (!lights_may_be_rough_) return false;
  const auto waiting = std::span(repairs_).subspan(repaired_);
  const auto roughness = [](const Repair& r) { return r.noise * (1.0 - static_cast<double>(r.looked) / r.samples); };
  double squares = 0.0, lights = 0.0;
  for (const auto& repair : waiting) {
    squares += roughness(repair);
    lights += roughness(repair) > 0.0 ? 1.0 : 0.0;
  }
  const double most = std::pow(roughness_ * settings_.target_error * norm_before_, 2.0);
  if (squares <= most) return false;
  std::vector<bool> rough(system_.shooters().size(), false);
  for (const auto& repair : waiting) {
    if (roughness(repair) * lights >= squares) rough[repair.shooter] = true;
  }
  const auto looks = [&](const Repair& repair) { return repair.looked > 0 && rough[repair.shooter]; };
  const auto others = std::stable_partition(waiting.begin(), waiting.end(), looks);
  due_ = repaired_ + static_cast<std::size_t>(others - waiting.begin());
  for (auto& repair : waiting.first(due_ - repaired_)) {
    const double all = 1.0 / repair.samples, now = 1.0 / repair.looked;
    const auto points = static_cast<std::uint32_t>(1.0 / (all + (now - all) * most / squares));
    const bool most_look = points > repair.samples / 2;  // then all, lest light is solved for in vain
    repair.first_shots = std::max(shotsFor(repair.looked) + 1, shotsFor(most_look ? repair.samples : points));
  }
  return true;
}

}  // namespace radiosity::solver
