// After an edit of geometry: which links are measured again before light is shown, and which later, when there is
// nothing else to do. Hundreds of shooters send next to nothing past what changed: with their links as they were
// before, the light is wrong by a small part of the target, which is stated.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "server/solver/edits/change_reach.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// Of the sum of what columns are wrong by, as ChangeReach has it, the light that they bring is wrong by less, since
/// not all are wrong at the same places: by 0.34 to 0.63 of it where few waited, after chairs and tables of a room were
/// moved and added, and by 0.15 to 0.44 where many did (26 edits of things and lamps in three scenes).
constexpr double kInAll = 0.65;
/// What waits may cause this part of the target error at least: in the sum of squares, 4 % of it. More where the solve
/// before left room under the target, of which it takes a part, so that the edit may make the rest somewhat worse.
constexpr double kPostponed = 0.2, kMostPostponed = 0.5, kOfRoom = 0.75;
/// And lights that look again with a part of their points (lightsAreTooRough).
constexpr double kRough = 0.1, kMostRough = 0.3, kRoughOfRoom = 0.5;
/// When light is solved for it is other light than that by which they were chosen: so many times that.
constexpr double kStillPostponed = 1.5;

/// Part of the target that there is room for beside what takes this part of it; squares add up.
double roomBeside(double part) { return std::sqrt(std::max(0.0, 1.0 - part * part)); }

}  // namespace

/// How far the links of a column that was measured before the edit are from true, for a radiosity of one. Both halves
/// look at other places on what changed, and what they find counts for both (planRepairs).
double LinkedSolver::reachOf(const Repair& repair, const ChangeReach& change) const {
  const auto& shooter = system_.shooters()[repair.shooter];
  if (repair.whole || shooter.isLight()) return HUGE_VAL;
  ShotBatch batch;
  addSamples(repair, batch);
  constexpr std::uint32_t kApart = 6;  // turns
  double squares = 0.0;
  for (std::uint32_t i = 0; i < batch.gather.size(); ++i) {
    const auto& point = batch.points[batch.gather[i].first_point];
    const auto turn = repair.shooter + kApart * static_cast<std::uint32_t>(repair.half) + i;
    const double reach = change.of(point.origin, point.normal, shooter.area, turn);
    squares += batch.gather[i].point_count * reach * reach;
  }
  return std::sqrt(squares / static_cast<double>(batch.points.size()));
}

/// Area-weighted norm of the error of irradiance, mean of the halves, that a column's old links may cause.
double LinkedSolver::missing(const Repair& repair) const {
  const auto& shooter = system_.shooters()[repair.shooter];
  // What few points know of a shadow is as uncertain as the halves show.
  if (repair.looked > 0 && lights_may_be_rough_) return 0.0;
  if (!std::isfinite(repair.reach)) return HUGE_VAL;
  const double radiosity = shooter.carried(repair.half) * static_cast<double>(glm::length(shooter.sent[repair.half]));
  return 0.5 * kInAll * radiosity * repair.reach;
}

double LinkedSolver::missing() const {
  double sum = 0.0;
  for (auto r = std::max(repaired_, due_); r < repairs_.size(); ++r) sum += missing(repairs_[r]);
  return sum;
}

double LinkedSolver::fieldNorm() const {
  double square = 0.0;
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto light = lightOf(side.first_value + leaf);
      square += static_cast<double>(patches_->node_area[side.first_node + leaf] * glm::dot(light, light));
    }
  }
  return std::sqrt(square);
}

/// The stated error without what waits, of which an edit decides anew.
double LinkedSolver::errorBesideMissing() const {
  const double norm = fieldNorm(), waits = norm > 0.0 ? missing() / norm : 0.0;
  return std::sqrt(std::max(0.0, error_.total * error_.total - waits * waits));
}

/// `error`: all but what waits, as far as is known.
void LinkedSolver::setPostponed(double error) {
  const double room = roomBeside(error / settings_.target_error);
  postponed_ = std::clamp(kOfRoom * room, kPostponed, kMostPostponed);
  roughness_ = std::clamp(kRoughOfRoom * room, kRough, kMostRough);
}

/// The strongest first, and only as many as must be. `norm`: of irradiance, about.
void LinkedSolver::planDue(double norm) {
  struct Entry {
    double missing;
    Repair repair;
  };
  std::vector<Entry> entries;
  for (const auto& repair : std::span(repairs_).subspan(repaired_)) entries.push_back({missing(repair), repair});
  std::ranges::stable_sort(entries, std::ranges::greater(), &Entry::missing);
  repairs_.clear();
  repaired_ = 0;
  for (const auto& entry : entries) repairs_.push_back(entry.repair);
  const double most = postponed_ * settings_.target_error * norm;
  double sum = 0.0;
  for (due_ = repairs_.size(); due_ > 0; --due_) {
    sum += entries[due_ - 1].missing;
    if (!(sum <= most)) return;
  }
}

/// After the light was solved for: whether some of what waited must not wait.
bool LinkedSolver::findsMoreDue() {
  if (repaired_ == repairs_.size()) return false;
  const double norm = fieldNorm();
  if (missing() <= kStillPostponed * postponed_ * settings_.target_error * norm) return false;
  planDue(norm);
  return repaired_ < due_;
}

/// Where the target would be reached but for what waits, that is the least work: some of it waits no longer.
bool LinkedSolver::isDueForTarget() {
  if (error_.total <= settings_.target_error || repaired_ == repairs_.size()) return false;
  const double norm = fieldNorm(), waits = missing() / norm;
  if (lights_may_be_rough_ && std::ranges::any_of(std::span(repairs_).subspan(repaired_),
                                                  [](const Repair& repair) { return repair.looked > 0; })) {
    lights_may_be_rough_ = false;  // their few points may be what is missing
    planDue(norm);
    return true;
  }
  const double rest = std::sqrt(std::max(0.0, error_.total * error_.total - waits * waits));
  if (!(rest < settings_.target_error)) return false;
  postponed_ = kOfRoom * std::min(roomBeside(rest / settings_.target_error), waits / settings_.target_error);
  planDue(norm);
  return repaired_ < due_;
}

std::uint32_t LinkedSolver::shotsOf(const Repair& repair) const {
  if (!system_.shooters()[repair.shooter].isLight()) return repair.samples;
  const auto [first, end] = shotsOfLight(repair);
  return end - first;
}

/// Solved and told: the next of the links that waited, and in the end the light over all of them. An edit that comes in
/// between need not wait for the others, nor long for those under way: an undo takes less time than a whole slice, and
/// the many points of a few lights take longer than all nodes that wait.
Result<StepOutcome> LinkedSolver::catchUp() {
  constexpr std::size_t kFewest = 2, kPart = 4;
  const auto most = std::min(repairs_.size() - repaired_, std::max(kFewest, slice_ / kPart));
  double seconds = 0.0;
  std::size_t count = 0;
  while (count < most && (count < kFewest || seconds < kSliceSeconds / kPart))
    seconds += repair_shot_seconds_ * shotsOf(repairs_[repaired_ + count++]);
  due_ = repaired_ + count;
  return advance();
}

void LinkedSolver::beExact() {
  lights_may_be_rough_ = may_look_past_ = false;
  for (auto& repair : std::span(repairs_).subspan(repaired_))
    if (repair.past_losses) repair.lookAnew();
  due_ = repairs_.size();
}

}  // namespace radiosity::solver
