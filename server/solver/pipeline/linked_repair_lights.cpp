// After an edit of geometry: lights look again with some of their points first, and with as many more as the shadows
// need. Most edits change little of the light of a lamp, and each of its looks takes as long as several others; the
// points that are left look when nothing else is to be done.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/parallel.h"
#include "server/solver/lamps/light_sight.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// So many shots of a light look first: where leaves can look for themselves, or not.
constexpr std::uint32_t kFirstOfFew = 1, kFirst = 2;
/// The square of what points are wrong by falls as this power of how many there are: from 8 to 16 under a table as the
/// power 1.7, behind a chair as 1.65. (Independent ones: 1.)
constexpr double kFalls = 1.5;
/// Of what shall be left this part may be that of leaves that do not look for themselves, which those that do do from
/// so many places.
constexpr double kUnsure = 0.5;
constexpr std::uint32_t kPlaces = 16;
/// Leaves that a thread takes at a time.
constexpr std::size_t kLooksAtOnce = 16;

/// A light's points look in shots of kLightPoints, the first of what is left of a division.
std::uint32_t shotsFor(std::uint32_t points) { return (points + kLightPoints - 1) / kLightPoints; }

/// Of a leaf and the eight around it; `values`: by leaf value.
float meanAround(const Side& side, std::uint32_t leaf, std::span<const float> values) {
  const auto x = leaf % side.width, y = leaf / side.width;
  const auto x0 = x - std::min(x, 1U), x1 = std::min(x + 2, side.width);
  const auto y0 = y - std::min(y, 1U), y1 = std::min(y + 2, side.height);
  float sum = 0.0F;
  for (auto ny = y0; ny < y1; ++ny)
    for (auto nx = x0; nx < x1; ++nx) sum += values[side.first_value + ny * side.width + nx];
  return sum / static_cast<float>((x1 - x0) * (y1 - y0));
}

}  // namespace

/// Of a light's shots, those that are next. The first have the coarse images (PlannerSettings::lightResolution): until
/// the others look, what they blur is blurred beside leaves of which most samples did not. When nothing else is to be
/// done one looks after the other, so that no edit waits for all of them.
LinkedSolver::ShotRange LinkedSolver::shotsOfLight(const Repair& repair) const {
  const auto all = shotsFor(repair.samples), first = shotsFor(repair.looked);
  // The first shot has the rest of a division, which may be two points.
  const auto few = repair.samples % kLightPoints == 0 ? kFirstOfFew : kFirstOfFew + 1;
  const auto next = repair.first_shots > 0 ? repair.first_shots : mayLookFromLeaves() ? few : kFirst;
  if (repair.whole || !lights_may_be_rough_) return {first, all};
  if (phase_ == Phase::kDone && from_links_ == FromLinks::kNo) return {first, std::min(all, first + 1)};
  return {first, next <= first ? all : std::min(all, next)};
}

/// Where both halves of a light have looked at these leaves: the square of what their mean is wrong by, times area, in
/// the order of the leaves.
std::vector<float> LinkedSolver::noiseOfLeaves(std::uint32_t light,
                                               std::span<const LinkColumn::ValueRun> leaves) const {
  const auto& shooter = system_.shooters()[light];
  const auto radiosity = [&](std::size_t half) {
    return static_cast<float>(0.5 * shooter.carried(half)) * glm::length(shooter.sent[half]);
  };
  const std::array<float, 2> sent{radiosity(0), radiosity(1)};
  std::array<std::vector<float>, 2> links;
  std::vector<float> noise;
  for (const auto& run : leaves) {
    for (std::size_t half = 0; half < 2; ++half) {
      links[half].assign(run.count, 0.0F);
      (void)shooter.column[half].decode(run.first, links[half]);
    }
    for (std::uint32_t i = 0; i < run.count; ++i) {
      const float differ = sent[0] * links[0][i] - sent[1] * links[1][i];
      noise.push_back(system_.leafAreas()[run.first + i] * differ * differ);
    }
  }
  return noise;
}

/// Surfaces that one can see through hide nothing for sure.
bool LinkedSolver::mayLookFromLeaves() const { return patches_->opacity.empty(); }

/// Of a light of which some points have looked, both halves: how unsure that leaves it. Most of that is a few leaves,
/// at the edges of shadows (behind a table, at 8 points, 74 of 436 hold 85 % of it). These look for
/// themselves, at all of the light.
void LinkedSolver::lookFromLeaves(std::array<Repair*, 2> halves, std::span<const LinkColumn::ValueRun> leaves,
                                  std::span<float> room) {
  auto& repair = *halves[1];
  const auto noise = noiseOfLeaves(repair.shooter, leaves);
  const double sum = std::reduce(noise.begin(), noise.end(), 0.0);
  const double share = static_cast<double>(repair.looked) / repair.samples;
  const double most = mostRoughness();
  repair.noise = sum;
  if (!lights_may_be_rough_ || !mayLookFromLeaves() || sum * (1.0 - share) <= most) return;
  const double by_all = std::pow(share, kFalls) * sum;
  auto looks = chooseUnsure(leaves, noise, kUnsure * (by_all + most), room);
  std::erase_if(looks, [&](const LeafLook& look) {
    return std::ranges::binary_search(repair.by_points, look.value, {}, &LeafLink::value);
  });
  const LightSight sight(leafRays(), lights_[system_.shooters()[repair.shooter].light], settings_.seed);
  const auto lookFrom = [&](std::size_t part) {
    const auto first = part * kLooksAtOnce, count = std::min(kLooksAtOnce, looks.size() - first);
    for (auto& look : std::span(looks).subspan(first, count)) {
      for (std::size_t half = 0; half < 2; ++half) look.link[half] = sight.link(look.value, half, kPlaces);
    }
  };
  inTurns((looks.size() + kLooksAtOnce - 1) / kLooksAtOnce, lookFrom);
  std::erase_if(looks, [](const LeafLook& look) { return !look.link[0] || !look.link[1]; });
  for (std::size_t half = 0; half < 2; ++half) takeLeafLooks(*halves[half], leaves, looks, room);
  const auto left = noiseOfLeaves(repair.shooter, leaves);
  repair.noise = std::max(0.0, std::reduce(left.begin(), left.end(), 0.0) - by_all) / (1.0 - share);
}

/// The fewest leaves without which no more than `wanted` of the noise is left. What it is around a leaf counts: were
/// those taken whose halves differ by chance, those that agree by chance would be thought to be right.
std::vector<LinkedSolver::LeafLook> LinkedSolver::chooseUnsure(std::span<const LinkColumn::ValueRun> leaves,
                                                               std::span<const float> noise, double wanted,
                                                               std::span<float> room) const {
  std::size_t first = 0;
  for (const auto& run : leaves) {
    std::copy_n(&noise[first], run.count, &room[run.first]);
    first += run.count;
  }
  std::vector<std::pair<float, std::uint32_t>> unsure;
  std::uint32_t s = 0;
  for (const auto& run : leaves) {
    while (sides_[s].first_value + sides_[s].leaf_count <= run.first) ++s;
    for (auto value = run.first; value < run.first + run.count; ++value) {
      const float around = meanAround(sides_[s], value - sides_[s].first_value, room);
      if (around > 0.0F && system_.leafAreas()[value] > 0.0F) unsure.emplace_back(around, value);
    }
  }
  for (const auto& run : leaves) std::fill_n(&room[run.first], run.count, 0.0F);
  std::ranges::sort(unsure);
  double left = 0.0;
  std::vector<LeafLook> looks;
  for (const auto& [around, value] : unsure) {
    left += static_cast<double>(around);
    if (left > wanted) looks.push_back({value, {}});
  }
  std::ranges::sort(looks, {}, &LeafLook::value);
  return looks;
}

void LinkedSolver::takeLeafLooks(Repair& repair, std::span<const LinkColumn::ValueRun> leaves,
                                 std::span<const LeafLook> looks, std::span<float> room) {
  const auto& column = system_.shooters()[repair.shooter].column[repair.half];
  for (const auto& run : leaves) {
    const auto links = room.subspan(run.first, run.count);
    if (!column.decode(run.first, links)) continue;
    for (auto& link : links) link /= static_cast<float>(column.gain());
  }
  for (const auto& look : looks)
    repair.by_points.push_back({look.value, std::exchange(room[look.value], *look.link[repair.half])});
  std::ranges::sort(repair.by_points, {}, &LeafLink::value);
  edits_.own_looks += looks.size();
  system_.replaceLinks(repair.shooter, repair.half, leaves, room, column.totals());
  for (const auto& run : leaves) std::fill_n(&room[run.first], run.count, 0.0F);
}

/// What few points of all lights may cause: square of the error of irradiance times area.
double LinkedSolver::mostRoughness() const { return std::pow(roughness_ * settings_.target_error * norm_before_, 2.0); }

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
  const double most = mostRoughness();
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
