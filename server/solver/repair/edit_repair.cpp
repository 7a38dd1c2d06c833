#include "server/solver/repair/edit_repair.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "server/solver/math/halves.h"

namespace radiosity::solver {
namespace {

/// Repairs of a slice at most: before it is known how long they take.
constexpr std::size_t kMostAtOnce = 1024;
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

EditRepair::EditRepair(const LinkParts& parts, RoughLights::RaysOf rays, SliceLength slice)
    : parts_(parts), rough_lights_(parts, std::move(rays)), slice_(slice) {}

void EditRepair::plan(double norm, double error, const ChangeReach& change) {
  setPostponed(error);
  parts_.system.begin();
  parts_.memory.begin(parts_.system);
  keepNeeded();
  findReach(change);
  norm_before_ = norm;
  rules_.lights_may_be_rough = norm > 0.0;
  planDue(norm);
}

void EditRepair::keepNeeded() {
  affected_ = 0;
  std::erase_if(repairs_, [&](Repair& repair) {
    const auto& shooter = parts_.system.shooters()[repair.shooter];
    if (!isNeeded(repair)) return true;
    if (!parts_.memory.takeSample(shooter, repair.half)) {
      parts_.system.forget(repair.shooter, repair.half);
      return true;
    }
    affected_ += shooter.isLight() ? 1 + (repair.samples - 1) / kLightPoints : repair.samples;
    return false;
  });
}

/// Both halves look at other places on what changed, and what they find counts for both.
void EditRepair::findReach(const ChangeReach& change) {
  std::vector<double> reach(repairs_.size());
  inBothHalves([&](std::size_t worker) {
    for (auto r = worker; r < repairs_.size(); r += 2) reach[r] = reachOf(repairs_[r], change);
  });
  for (std::size_t r = 0; r + 1 < repairs_.size(); ++r) {  // both halves of a shooter lie together
    if (repairs_[r].shooter != repairs_[r + 1].shooter || !std::isfinite(reach[r] + reach[r + 1])) continue;
    reach[r] = reach[r + 1] = std::sqrt(0.5 * (reach[r] * reach[r] + reach[r + 1] * reach[r + 1]));
  }
  for (std::size_t r = 0; r < repairs_.size(); ++r) repairs_[r].reach += reach[r];
}

/// Whether some point of the samples sees the change.
bool EditRepair::isSeen(const Repair& repair, bool& gathers) const {
  const auto& shooter = parts_.system.shooters()[repair.shooter];
  const auto& shadows = shadows_.of(repair);
  if (shooter.isLight()) {
    const auto& light = parts_.lights[shooter.light];
    return shadows.sees(light.corners[0], light.normal);
  }
  ShotBatch batch;
  addSamples(parts_, rules_, repair, batch);
  gathers = batch.scatter.empty();
  const auto looks = [&](const HemicubeFrame& frame) { return shadows.sees(frame.origin, frame.normal); };
  return std::ranges::any_of(batch.points, looks) ||
         std::ranges::any_of(batch.scatter, [&](const ScatterShot& shot) { return looks(shot.frame); });
}

/// What cannot be repaired in parts becomes whole.
bool EditRepair::isNeeded(Repair& repair) {
  if (repair.whole) return true;
  const auto& shooter = parts_.system.shooters()[repair.shooter];
  bool gathers = true;
  if (!isSeen(repair, gathers)) {
    counters_.kept += shooter.isLight() ? 1 : repair.samples;
    return false;
  }
  repair.whole = !gathers || shooter.column[repair.half].isOpen(shooter.area);
  if (!repair.whole) return true;
  parts_.system.forget(repair.shooter, repair.half);
  return true;
}

/// How far the links of a column that was measured before the edit are from true, for a radiosity of one.
double EditRepair::reachOf(const Repair& repair, const ChangeReach& change) const {
  const auto& shooter = parts_.system.shooters()[repair.shooter];
  if (repair.whole || shooter.isLight()) return HUGE_VAL;
  ShotBatch batch;
  addSamples(parts_, rules_, repair, batch);
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
double EditRepair::missing(const Repair& repair) const {
  const auto& shooter = parts_.system.shooters()[repair.shooter];
  // What few points know of a shadow is as uncertain as the halves show.
  if (repair.looked > 0 && rules_.lights_may_be_rough) return 0.0;
  if (!std::isfinite(repair.reach)) return HUGE_VAL;
  const double radiosity = shooter.carried(repair.half) * static_cast<double>(glm::length(shooter.sent[repair.half]));
  return 0.5 * kInAll * radiosity * repair.reach;
}

double EditRepair::missing() const {
  double sum = 0.0;
  for (auto r = std::max(repaired_, due_); r < repairs_.size(); ++r) sum += missing(repairs_[r]);
  return sum;
}

bool EditRepair::knowsLights() const {
  const auto& shooters = parts_.system.shooters();
  return std::ranges::none_of(
      waiting(), [&](const Repair& repair) { return shooters[repair.shooter].isLight() && repair.looked == 0; });
}

void EditRepair::addTo(LinkCounters& counters) const {
  counters.kept = counters_.kept;
  counters.repaired = counters_.repaired;
  counters.repaired_links = counters_.repaired_links;
  counters.retaken = counters_.retaken;
  counters.own_looks = counters_.own_looks;
  for (const auto& repair : waiting()) counters.waiting += repair.samples;
}

/// `error`: all but what waits, as far as is known.
void EditRepair::setPostponed(double error) {
  const double room = roomBeside(error / parts_.settings.target_error);
  postponed_ = std::clamp(kOfRoom * room, kPostponed, kMostPostponed);
  roughness_ = std::clamp(kRoughOfRoom * room, kRough, kMostRough);
}

/// The strongest first, and only as many as must be. `norm`: of irradiance, about.
void EditRepair::planDue(double norm) {
  struct Entry {
    double missing;
    Repair repair;
  };
  std::vector<Entry> entries;
  for (const auto& repair : waiting()) entries.push_back({missing(repair), repair});
  std::ranges::stable_sort(entries, std::ranges::greater(), &Entry::missing);
  repairs_.clear();
  repaired_ = 0;
  for (const auto& entry : entries) repairs_.push_back(entry.repair);
  const double most = postponed_ * parts_.settings.target_error * norm;
  double sum = 0.0;
  for (due_ = repairs_.size(); due_ > 0; --due_) {
    sum += entries[due_ - 1].missing;
    if (!(sum <= most)) return;
  }
}

Result<TransportCounters> EditRepair::advance(bool is_idle) {
  const auto start = std::chrono::steady_clock::now();
  rules_.is_idle = is_idle;
  const auto count = std::min(slice_.most, due_ - repaired_);
  const auto repairs = std::span(repairs_).subspan(repaired_, count);
  RepairBatch batch(parts_, rules_, shadows_, repairs, counters_);
  auto done = batch.measure();
  if (!done) return done;
  weighRough(batch);
  std::uint32_t shots_taken = 0;
  for (const auto& repair : repairs) shots_taken += shotsOf(parts_, rules_, repair);
  repaired_ += count;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  slice_.most =
      std::clamp(static_cast<std::size_t>(static_cast<double>(count) * kSliceSeconds / std::max(seconds, 1e-6)),
                 slice_.fewest, kMostAtOnce);
  shot_seconds_ = seconds / std::max(1U, shots_taken);
  takeOver(batch);
  return done;
}

/// What is to be taken once more, or further.
void EditRepair::takeOver(RepairBatch& batch) {
  const auto anew = batch.anew();
  repairs_.insert(repairs_.begin() + static_cast<std::ptrdiff_t>(due_), anew.begin(), anew.end());
  due_ += anew.size();
  const auto rough = batch.rough();
  repairs_.insert(repairs_.end(), rough.begin(), rough.end());
  if (lacksLinks()) return;
  repairs_.clear();
  repaired_ = due_ = 0;
  shadows_ = {};
}

/// Lights of which some points have looked, once both halves have: the first may have in the slice before.
void EditRepair::weighRough(RepairBatch& batch) {
  const auto rough = batch.rough();
  const double most = rules_.lights_may_be_rough && mayLookFromLeaves(parts_) ? mostRoughness() : HUGE_VAL;
  for (std::size_t i = 0; i < rough.size(); ++i) {
    auto& second = rough[i];
    const auto isFirst = [&](const Repair& other) {
      return other.shooter == second.shooter && other.half == 0 && other.looked == second.looked;
    };
    for (const auto among : {rough, std::span(repairs_).subspan(due_)}) {
      const auto first = std::ranges::find_if(among, isFirst);
      if (second.half == 0 || first == among.end()) continue;
      counters_.own_looks += rough_lights_.weigh({&*first, &second}, batch.leavesOfRough(i), most, batch.room());
      break;
    }
  }
}

/// What few points of all lights may cause: square of the error of irradiance times area.
double EditRepair::mostRoughness() const {
  return std::pow(roughness_ * parts_.settings.target_error * norm_before_, 2.0);
}

/// Of independent points n times as many leave an nth of the square; these are spread better than that, but texels of
/// which a shadow's edge hides a part are not.
bool EditRepair::lightsAreTooRough() {
  if (!rules_.lights_may_be_rough) return false;
  const auto waiting = std::span(repairs_).subspan(repaired_);
  double squares = 0.0, lights = 0.0;
  for (const auto& repair : waiting) {
    squares += repair.roughness();
    lights += repair.roughness() > 0.0 ? 1.0 : 0.0;
  }
  const double most = mostRoughness();
  if (squares <= most) return false;
  std::vector<bool> rough(parts_.system.shooters().size(), false);
  for (const auto& repair : waiting) {
    if (repair.roughness() * lights >= squares) rough[repair.shooter] = true;
  }
  const auto looks = [&](const Repair& repair) { return repair.looked > 0 && rough[repair.shooter]; };
  const auto others = std::stable_partition(waiting.begin(), waiting.end(), looks);
  due_ = repaired_ + static_cast<std::size_t>(others - waiting.begin());
  for (auto& repair : waiting.first(due_ - repaired_)) {
    const double all = 1.0 / repair.samples, now = 1.0 / repair.looked;
    const auto points = static_cast<std::uint32_t>(1.0 / (all + (now - all) * most / squares));
    const bool most_look = points > repair.samples / 2;  // then all, lest light is solved for in vain
    repair.first_shots = std::max(lightShots(repair.looked) + 1, lightShots(most_look ? repair.samples : points));
  }
  return true;
}

bool EditRepair::findsMoreDue(double norm) {
  if (missing() <= kStillPostponed * postponed_ * parts_.settings.target_error * norm) return false;
  planDue(norm);
  return isRepairing();
}

bool EditRepair::isDueForTarget(double error, double norm) {
  const double target = parts_.settings.target_error, waits = missing() / norm;
  if (rules_.lights_may_be_rough &&
      std::ranges::any_of(waiting(), [](const Repair& repair) { return repair.looked > 0; })) {
    rules_.lights_may_be_rough = false;  // their few points may be what is missing
    planDue(norm);
    return true;
  }
  const double rest = std::sqrt(std::max(0.0, error * error - waits * waits));
  if (!(rest < target)) return false;
  postponed_ = kOfRoom * std::min(roomBeside(rest / target), waits / target);
  planDue(norm);
  return isRepairing();
}

void EditRepair::catchUp() {
  constexpr std::size_t kFewest = 2, kPart = 4;
  const auto most = std::min(repairs_.size() - repaired_, std::max(kFewest, slice_.most / kPart));
  rules_.is_idle = true;
  double seconds = 0.0;
  std::size_t count = 0;
  while (count < most && (count < kFewest || seconds < kSliceSeconds / kPart))
    seconds += shot_seconds_ * shotsOf(parts_, rules_, repairs_[repaired_ + count++]);
  due_ = repaired_ + count;
}

void EditRepair::beExact() {
  rules_.lights_may_be_rough = rules_.may_look_past = false;
  for (auto& repair : std::span(repairs_).subspan(repaired_))
    if (repair.past_losses) repair.lookAnew();
  due_ = repairs_.size();
}

void EditRepair::renumber(std::span<const std::uint32_t> shooter_after) {
  std::vector<Repair> repairs;
  for (auto repair : waiting()) {
    if (shooter_after[repair.shooter] == scene::kNone) continue;
    repair.shooter = shooter_after[repair.shooter];
    repairs.push_back(repair);
  }
  repairs_ = std::move(repairs);
  repaired_ = 0;
  due_ = repairs_.size();
}

}  // namespace radiosity::solver
