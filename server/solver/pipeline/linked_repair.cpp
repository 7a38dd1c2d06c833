// LinkedSolver after an edit of geometry: measures again what the edit may have changed, with the same points as
// before. Each column of links is the mean of its samples, so all of them are taken again, but only for the leaves that
// need it; how much should arrive in all is known without the others, unless much is lost.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/math/near_edge.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// What arrives, escapes and is absorbed makes all that is sent; a polygon's area is known to 0.002 of it. A sum of
/// some links in the place of what should arrive does not.
constexpr double kNoSum = 0.005;
/// So much of what a lamp sends is too little to look for it: of the asked error, and at most.
constexpr double kLittleLost = 0.01, kMostPresumed = 2e-4;
/// Repairs of a slice before it is known how long they take.
constexpr std::size_t kMostAtOnce = 1024;

/// Adds to sums of links times points, over so many of them, what is there already, the mean of so many others, and
/// makes means of all. `by_points`: ascending, that mean of leaves that looked for themselves as well. It becomes that
/// of all, and what they found stays, unless all points there are have looked by now.
template <typename LeafLink>
void addEarlierLooks(const LinkColumn& column, std::uint32_t earlier, std::uint32_t points, bool all_looked,
                     const LinkColumn::ValueRun& run, std::span<LeafLink> by_points, std::span<float> sums,
                     std::vector<float>& links) {
  links.assign(run.count, 0.0F);
  (void)column.decode(run.first, links);
  for (auto& link : links) link /= static_cast<float>(column.gain());
  const auto first = std::ranges::lower_bound(by_points, run.first, {}, &LeafLink::value);
  const auto end = std::ranges::lower_bound(first, by_points.end(), run.first + run.count, {}, &LeafLink::value);
  const std::span own(first, end);
  for (auto& leaf : own) std::swap(links[leaf.value - run.first], leaf.link);
  const float weight = 1.0F / static_cast<float>(earlier + points);
  for (std::uint32_t i = 0; i < run.count; ++i) sums[i] = weight * (sums[i] + static_cast<float>(earlier) * links[i]);
  if (all_looked) return;
  for (auto& leaf : own) std::swap(sums[leaf.value - run.first], leaf.link);
}

}  // namespace

/// Some repairs on their way.
struct LinkedSolver::RepairBatch {
  std::span<Repair> repairs;
  std::vector<std::vector<LinkColumn::ValueRun>> leaves;  ///< by repair: those to be taken again; unused where whole
  ShotBatch shots;
  struct Sample {
    std::uint32_t repair, points;
    bool first, last;
  };
  std::vector<Sample> gathered, scattered;
  std::vector<float> sum;                      ///< by leaf value: of the repair on its way, links times points
  std::uint32_t points = 0;                    ///< with those that looked before
  LinkColumn::Totals totals;                   ///< times points
  bool open = false;                           ///< so much is lost that only the sum of all links tells what arrives
  std::vector<Repair> anew;                    ///< whole, since they are open now
  std::vector<Repair> rough;                   ///< of lights whose other points will look later
  std::vector<std::uint32_t> leaves_of_rough;  ///< into `leaves`
};

/// Leaves in repairs_ what is needed, and makes room for what it may bring.
/// `norm`: of the irradiance that there was, or 0 where it was not known.
void LinkedSolver::planRepairs(double norm, const ChangeReach& change) {
  system_.begin();
  memory_.begin(system_);
  affected_ = 0;
  std::erase_if(repairs_, [&](Repair& repair) {
    const auto& shooter = system_.shooters()[repair.shooter];
    if (!isNeeded(repair)) return true;
    if (!memory_.takeSample(shooter, repair.half)) {
      system_.forget(repair.shooter, repair.half);
      return true;
    }
    affected_ += shooter.isLight() ? 1 + (repair.samples - 1) / kLightPoints : repair.samples;
    return false;
  });
  std::vector<double> reach(repairs_.size());
  inBothHalves([&](std::size_t worker) {
    for (auto r = worker; r < repairs_.size(); r += 2) reach[r] = reachOf(repairs_[r], change);
  });
  for (std::size_t r = 0; r + 1 < repairs_.size(); ++r) {  // both halves of a shooter lie together
    if (repairs_[r].shooter != repairs_[r + 1].shooter || !std::isfinite(reach[r] + reach[r + 1])) continue;
    reach[r] = reach[r + 1] = std::sqrt(0.5 * (reach[r] * reach[r] + reach[r + 1] * reach[r + 1]));
  }
  for (std::size_t r = 0; r < repairs_.size(); ++r) repairs_[r].reach += reach[r];
  norm_before_ = norm;
  lights_may_be_rough_ = norm > 0.0;
  planDue(norm);
}

/// Whether some point of the samples sees the change. What cannot be repaired in parts becomes whole.
bool LinkedSolver::isNeeded(Repair& repair) {
  const auto& shooter = system_.shooters()[repair.shooter];
  if (repair.whole) return true;
  const auto& shadows = shadowsOf(repair);
  bool sees = false, gathers = true;
  if (shooter.isLight()) {
    const auto& light = lights_[shooter.light];
    sees = shadows.sees(light.corners[0], light.normal);
  } else {
    ShotBatch batch;
    addSamples(repair, batch);
    gathers = batch.scatter.empty();
    const auto looks = [&](const HemicubeFrame& frame) { return shadows.sees(frame.origin, frame.normal); };
    sees = std::ranges::any_of(batch.points, looks) ||
           std::ranges::any_of(batch.scatter, [&](const ScatterShot& shot) { return looks(shot.frame); });
  }
  if (!sees) {
    edits_.kept += shooter.isLight() ? 1 : repair.samples;
    return false;
  }
  repair.whole = !gathers || shooter.column[repair.half].isOpen(shooter.area);
  if (!repair.whole) return true;
  system_.forget(repair.shooter, repair.half);
  return true;
}

/// The shots that the column was made of; of a light, as many points, or those of them that look now.
void LinkedSolver::addSamples(const Repair& repair, ShotBatch& batch) const {
  const auto& shooter = system_.shooters()[repair.shooter];
  if (!shooter.isLight()) {
    for (std::uint32_t i = 0; i < repair.samples; ++i)
      shots_.add(shooter.place, repair.half, i, shooter.resolution, batch);
    return;
  }
  const std::uint32_t few = 1 + (repair.samples - 1) % kLightPoints;  // the first shot has the rest of a division
  const auto [first, end] = shotsOfLight(repair);
  for (auto i = first; i < end; ++i)
    shots_.add(lights_[shooter.light], repair.half, i, i == 0 ? few : kLightPoints,
               settings_.planner.lightResolution(i), batch);
}

/// Whether a lamp's looks need not see again what they lost before, in cracks and on backs: that is presumed to be lost
/// still, beside what is lost now where the change is. It is so much at most, and each edit adds to it, until it is no
/// longer little and is looked at. What others lose, they lose with every bounce.
bool LinkedSolver::losesLittle(const Repair& repair) const {
  const auto& shooter = system_.shooters()[repair.shooter];
  const auto& column = shooter.column[repair.half];
  const double little = std::min(kLittleLost * settings_.target_error, kMostPresumed);
  return shooter.isLight() && column.escaped() + column.absorbed() <= little * shooter.area;
}

void LinkedSolver::findCutLinks(RepairBatch& repairs) const {
  repairs.leaves.resize(repairs.repairs.size());
  inBothHalves([&](std::size_t worker) {
    Shadows::Scratch scratch;
    std::vector<glm::vec3> points;
    for (std::size_t i = worker; i < repairs.repairs.size(); i += 2) {
      const auto& repair = repairs.repairs[i];
      const auto& shooter = system_.shooters()[repair.shooter];
      if (repair.whole || repair.samples == 0) continue;
      const auto& shadows = shadowsOf(repair);
      if (shooter.isLight()) {
        const auto& light = lights_[shooter.light];
        const auto ball = light.ball();
        const glm::vec3 middle(ball);
        // As wide as pixels are at most, which the first samples' are.
        shadows.find({&middle, 1}, light.normal, ball.w, settings_.planner.light_resolution, scratch,
                     repairs.leaves[i]);
        continue;
      }
      ShotBatch batch;
      addSamples(repair, batch);
      points.clear();
      const auto& shot = batch.gather.front();
      for (const auto& frame : batch.points) points.push_back(frame.origin);
      // Some receivers look at other places of the shooter than its points.
      const EdgeBall edge(std::span(shot.corners.data(), shot.corner_count));
      if (shadows.passesWithin(edge.middle, edge.reach)) shadows.markNear(edge, scratch);
      shadows.find(points, shot.normal, 0.0F, shooter.resolution, scratch, repairs.leaves[i]);
    }
  });
}

/// Takes the next repairs, and finds what links are cut.
void LinkedSolver::takeRepairs(RepairBatch& batch) {
  const auto count = std::min(slice_, due_ - repaired_);
  for (auto& repair : std::span(repairs_).subspan(repaired_, count)) {
    // Of one that waited there may be more by now.
    const auto& shooter = system_.shooters()[repair.shooter];
    const auto& column = shooter.column[repair.half];
    const auto samples = shooter.isLight() ? static_cast<std::uint32_t>(column.points()) : column.samples();
    if (repair.whole || samples == repair.samples) continue;
    repair.samples = samples;
    repair.lookAnew();  // what is there is no longer the mean of what looked
  }
  batch.repairs = std::span(repairs_).subspan(repaired_, count);
  batch.sum.resize(system_.leafAreas().size());
  findCutLinks(batch);
}

void LinkedSolver::addShots(RepairBatch& batch) {
  auto& shots = batch.shots;
  const auto& boxes = shadows_->change().boxes;
  shots.boxes = boxes;
  if (earlier_shadows_) {
    const auto& earlier = earlier_shadows_->change().boxes;
    shots.boxes.insert(shots.boxes.end(), earlier.begin(), earlier.end());
  }
  for (std::uint32_t r = 0; r < batch.repairs.size(); ++r) {
    auto& repair = batch.repairs[r];
    if (!repair.whole && batch.leaves[r].empty()) continue;
    if (repair.looked == 0) repair.past_losses = may_look_past_ && losesLittle(repair);
    const auto first_run = static_cast<std::uint32_t>(shots.receivers.size());
    std::uint32_t side = 0;
    for (const auto& run : batch.leaves[r]) {
      while (sides_[side].first_value + sides_[side].leaf_count <= run.first) ++side;
      edits_.repaired_links += run.count;
      shots.receivers.push_back({sides_[side].first_node + (run.first - sides_[side].first_value), run.count});
    }
    const std::size_t gathered = shots.gather.size(), scattered = shots.scatter.size();
    addSamples(repair, shots);
    auto looks = repair.looked;
    for (auto i = gathered; i < shots.gather.size(); ++i) {
      auto& shot = shots.gather[i];
      batch.gathered.push_back({r, shot.point_count, i == gathered, i + 1 == shots.gather.size()});
      if (repair.whole) continue;
      shot.first_run = first_run;
      shot.run_count = static_cast<std::uint32_t>(shots.receivers.size()) - first_run;
      shot.first_box = repair.overtaken ? static_cast<std::uint32_t>(boxes.size()) : 0;
      shot.box_count = static_cast<std::uint32_t>(repair.overtaken ? shots.boxes.size() - boxes.size() : boxes.size());
      // Where nothing was lost, whatever is lost now is lost where the change is seen.
      if (repair.past_losses) continue;
      const auto& column = system_.shooters()[repair.shooter].column[repair.half];
      shot.open_looks = column.openLooks().from(std::exchange(looks, looks + shot.point_count), shot.point_count);
    }
    for (auto i = scattered; i < shots.scatter.size(); ++i) batch.scattered.push_back({r, 1, false, false});
    (repair.whole ? edits_.retaken : edits_.repaired) +=
        shots.gather.size() - gathered + shots.scatter.size() - scattered;
  }
}

/// Short, as measureSlice().
Result<void> LinkedSolver::repairSlice() {
  const auto start = std::chrono::steady_clock::now();
  RepairBatch batch;
  takeRepairs(batch);
  addShots(batch);
  const auto take = [&](std::size_t i, LinkSample&& links) { takePart(batch, i, links); };
  const auto done = transport_.measure(batch.shots, take);
  if (!done) return tl::unexpected<Error>(done.error());
  counters_ += *done;
  weighRough(batch);
  std::uint32_t shots_taken = 0;
  for (const auto& repair : batch.repairs) shots_taken += shotsOf(repair);
  repaired_ += batch.repairs.size();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  slice_ = std::clamp(
      static_cast<std::size_t>(static_cast<double>(batch.repairs.size()) * kSliceSeconds / std::max(seconds, 1e-6)),
      fewest_a_slice_, kMostAtOnce);
  repair_shot_seconds_ = seconds / std::max(1U, shots_taken);
  repairs_.insert(repairs_.begin() + static_cast<std::ptrdiff_t>(due_), batch.anew.begin(), batch.anew.end());
  due_ += batch.anew.size();
  repairs_.insert(repairs_.end(), batch.rough.begin(), batch.rough.end());
  if (repaired_ == repairs_.size()) {
    repairs_.clear();
    repaired_ = due_ = 0;
    shadows_.reset();
    earlier_shadows_.reset();
  }
  return {};
}

/// Lights of which some points have looked, once both halves have: the first may have in the slice before.
void LinkedSolver::weighRough(RepairBatch& batch) {
  for (std::size_t i = 0; i < batch.rough.size(); ++i) {
    auto& second = batch.rough[i];
    const auto isFirst = [&](const Repair& other) {
      return other.shooter == second.shooter && other.half == 0 && other.looked == second.looked;
    };
    for (const auto among : {std::span(batch.rough), std::span(repairs_).subspan(due_)}) {
      const auto first = std::ranges::find_if(among, isFirst);
      if (second.half == 0 || first == among.end()) continue;
      lookFromLeaves({&*first, &second}, batch.leaves[batch.leaves_of_rough[i]], batch.sum);
      break;
    }
  }
}

/// One sample, whole or for some leaves; the last of a column puts them in the place of what was there.
void LinkedSolver::takePart(RepairBatch& repairs, std::size_t shot, LinkSample& links) {
  const bool scattered = shot >= repairs.gathered.size();
  const auto& sample = scattered ? repairs.scattered[shot - repairs.gathered.size()] : repairs.gathered[shot];
  const auto& repair = repairs.repairs[sample.repair];
  if (scattered) links.scale(system_.shooters()[repair.shooter].area);  // it carried a flux of one
  expander_.expand(links, scattered);
  if (repair.whole) {
    system_.addSample(repair.shooter, repair.half, expander_, links, sample.points);
    return;
  }
  if (sample.first) {
    repairs.points = repair.looked;
    repairs.totals = repair.found;
  }
  repairs.totals.open_looks.add(links.open_looks, std::exchange(repairs.points, repairs.points + sample.points),
                                sample.points);
  const auto area = system_.shooters()[repair.shooter].area;
  const double all = links.due + links.escaped + links.absorbed;
  repairs.open =
      repairs.open || LinkColumn::isOpen(area, links.escaped + links.absorbed) || std::abs(all - area) > kNoSum * area;
  repairs.totals.due += sample.points * links.due;
  repairs.totals.escaped += sample.points * links.escaped;
  repairs.totals.absorbed += sample.points * links.absorbed;
  auto reached = expander_.sidesReached().begin();
  const auto end = expander_.sidesReached().end();
  for (const auto& run : repairs.leaves[sample.repair]) {
    while (reached != end && sides_[*reached].first_value + sides_[*reached].leaf_count <= run.first) ++reached;
    if (reached == end) break;
    if (sides_[*reached].first_value > run.first) continue;
    for (std::uint32_t v = run.first; v < run.first + run.count; ++v)
      repairs.sum[v] += static_cast<float>(sample.points) * expander_.values()[v];
  }
  if (sample.last) replacePart(repairs, sample.repair);
}

/// All samples of a repair have come: their mean takes the place of what was there.
void LinkedSolver::replacePart(RepairBatch& repairs, std::uint32_t index) {
  auto& repair = repairs.repairs[index];
  const auto& leaves = repairs.leaves[index];
  const auto& column = system_.shooters()[repair.shooter].column[repair.half];
  const double part = 1.0 / repairs.points;
  std::vector<float> before;
  for (const auto& run : leaves) {
    const auto sum = std::span(repairs.sum).subspan(run.first, run.count);
    if (repair.looked > 0) {
      addEarlierLooks(column, repair.looked, repairs.points - repair.looked, repairs.points >= repair.samples, run,
                      std::span(repair.by_points), sum, before);
    } else {
      for (auto& value : sum) value *= static_cast<float>(part);
    }
  }
  auto& found = repairs.totals;
  if (repair.past_losses) found.open_looks.bits |= column.openLooks().bits;
  if (std::exchange(repairs.open, false)) {
    system_.forget(repair.shooter, repair.half);
    repairs.anew.push_back({repair.shooter, repair.old_shooter, repair.half, repair.samples, true, repair.overtaken});
  } else if (repairs.points < repair.samples && system_.shooters()[repair.shooter].isLight()) {
    // So few say too little of what is lost, and nothing of what the others lose.
    auto totals = column.totals();
    const auto others = Looks::kMany + 1 - std::min(repairs.points, Looks::kMany + 1);
    const auto open = totals.open_looks.from(repairs.points, others);
    totals.open_looks = found.open_looks;
    totals.open_looks.add(open, repairs.points, others);
    system_.replaceLinks(repair.shooter, repair.half, leaves, repairs.sum, totals);
    repairs.rough.push_back(repair);
    repairs.rough.back().looked = repairs.points;
    repairs.rough.back().found = found;
    repairs.leaves_of_rough.push_back(index);
  } else {
    LinkColumn::Totals totals{part * found.due, part * found.escaped, part * found.absorbed, found.open_looks, 0.0};
    if (repair.past_losses) {
      totals.presumed = column.escaped() + column.absorbed();
      totals.due -= totals.presumed;
      totals.escaped += column.escaped();
      totals.absorbed += column.absorbed();
    }
    system_.replaceLinks(repair.shooter, repair.half, leaves, repairs.sum, totals);
  }
  for (const auto& run : leaves) std::fill_n(repairs.sum.begin() + run.first, run.count, 0.0F);
}

}  // namespace radiosity::solver
