#include "server/solver/repair/repair_batch.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/math/near_edge.h"

namespace radiosity::solver {
namespace {

/// What arrives, escapes and is absorbed makes all that is sent; a polygon's area is known to 0.002 of it. A sum of
/// some links in the place of what should arrive does not.
constexpr double kNoSum = 0.005;
/// So much of what a lamp sends is too little to look for it: of the asked error, and at most.
constexpr double kLittleLost = 0.01, kMostPresumed = 2e-4;

/// Adds to sums of links times points, over so many of them, what is there already, the mean of so many others, and
/// makes means of all. `by_points`: ascending, that mean of leaves that looked for themselves as well. It becomes that
/// of all, and what they found stays, unless all points there are have looked by now.
void addEarlierLooks(const LinkColumn& column, std::uint32_t earlier, std::uint32_t points, bool all_looked,
                     const LinkColumn::ValueRun& run, std::span<Repair::LeafLink> by_points, std::span<float> sums,
                     std::vector<float>& links) {
  links.assign(run.count, 0.0F);
  (void)column.decode(run.first, links);
  for (auto& link : links) link /= static_cast<float>(column.gain());
  const auto first = std::ranges::lower_bound(by_points, run.first, {}, &Repair::LeafLink::value);
  const auto end =
      std::ranges::lower_bound(first, by_points.end(), run.first + run.count, {}, &Repair::LeafLink::value);
  const std::span own(first, end);
  for (auto& leaf : own) std::swap(links[leaf.value - run.first], leaf.link);
  const float weight = 1.0F / static_cast<float>(earlier + points);
  for (std::uint32_t i = 0; i < run.count; ++i) sums[i] = weight * (sums[i] + static_cast<float>(earlier) * links[i]);
  if (all_looked) return;
  for (auto& leaf : own) std::swap(sums[leaf.value - run.first], leaf.link);
}

}  // namespace

RepairBatch::RepairBatch(const LinkParts& parts, const RepairRules& rules, const EditShadows& shadows,
                         std::span<Repair> repairs, LinkCounters& counters)
    : parts_(parts), rules_(rules), shadows_(shadows), repairs_(repairs), counters_(counters) {
  sum_.resize(parts.system.leafAreas().size());
}

Result<TransportCounters> RepairBatch::measure() {
  updateSamples();
  findCutLinks();
  addShots();
  return parts_.transport.measure(shots_, [&](std::size_t i, LinkSample&& links) { take(i, links); });
}

/// Of one that waited there may be more by now.
void RepairBatch::updateSamples() {
  for (auto& repair : repairs_) {
    const auto& shooter = parts_.system.shooters()[repair.shooter];
    const auto& column = shooter.column[repair.half];
    const auto samples = shooter.isLight() ? static_cast<std::uint32_t>(column.points()) : column.samples();
    if (repair.whole || samples == repair.samples) continue;
    repair.samples = samples;
    repair.lookAnew();  // what is there is no longer the mean of what looked
  }
}

/// Whether a lamp's looks need not see again what they lost before, in cracks and on backs: that is presumed to be lost
/// still, beside what is lost now where the change is. It is so much at most, and each edit adds to it, until it is no
/// longer little and is looked at. What others lose, they lose with every bounce.
bool RepairBatch::losesLittle(const Repair& repair) const {
  const auto& shooter = parts_.system.shooters()[repair.shooter];
  const auto& column = shooter.column[repair.half];
  const double little = std::min(kLittleLost * parts_.settings.target_error, kMostPresumed);
  return shooter.isLight() && column.escaped() + column.absorbed() <= little * shooter.area;
}

void RepairBatch::findCutLinks() {
  leaves_.resize(repairs_.size());
  inBothHalves([&](std::size_t worker) {
    Shadows::Scratch scratch;
    std::vector<glm::vec3> points;
    for (std::size_t i = worker; i < repairs_.size(); i += 2) {
      const auto& repair = repairs_[i];
      const auto& shooter = parts_.system.shooters()[repair.shooter];
      if (repair.whole || repair.samples == 0) continue;
      const auto& shadows = shadows_.of(repair);
      if (shooter.isLight()) {
        const auto& light = parts_.lights[shooter.light];
        const auto ball = light.ball();
        const glm::vec3 middle(ball);
        // As wide as pixels are at most, which the first samples' are.
        shadows.find({&middle, 1}, light.normal, ball.w, parts_.settings.planner.light_resolution, scratch, leaves_[i]);
        continue;
      }
      ShotBatch batch;
      addSamples(parts_, rules_, repair, batch);
      points.clear();
      const auto& shot = batch.gather.front();
      for (const auto& frame : batch.points) points.push_back(frame.origin);
      // Some receivers look at other places of the shooter than its points.
      const EdgeBall edge(std::span(shot.corners.data(), shot.corner_count));
      if (shadows.passesWithin(edge.middle, edge.reach)) shadows.markNear(edge, scratch);
      shadows.find(points, shot.normal, 0.0F, shooter.resolution, scratch, leaves_[i]);
    }
  });
}

void RepairBatch::addShots() {
  const auto& boxes = shadows_.now->change().boxes;
  shots_.boxes = boxes;
  if (shadows_.earlier) {
    const auto& earlier = shadows_.earlier->change().boxes;
    shots_.boxes.insert(shots_.boxes.end(), earlier.begin(), earlier.end());
  }
  for (std::uint32_t r = 0; r < repairs_.size(); ++r)
    if (repairs_[r].whole || !leaves_[r].empty()) addShotsOf(r, boxes.size());
}

/// `boxes`: so many are those of the last edit, which come first.
void RepairBatch::addShotsOf(std::uint32_t r, std::size_t boxes) {
  auto& repair = repairs_[r];
  if (repair.looked == 0) repair.past_losses = rules_.may_look_past && losesLittle(repair);
  const auto first_run = static_cast<std::uint32_t>(shots_.receivers.size());
  std::uint32_t side = 0;
  for (const auto& run : leaves_[r]) {
    const auto& sides = parts_.sides;
    while (sides[side].first_value + sides[side].leaf_count <= run.first) ++side;
    counters_.repaired_links += run.count;
    shots_.receivers.push_back({sides[side].first_node + (run.first - sides[side].first_value), run.count});
  }
  const std::size_t gathered = shots_.gather.size(), scattered = shots_.scatter.size();
  addSamples(parts_, rules_, repair, shots_);
  auto looks = repair.looked;
  for (auto i = gathered; i < shots_.gather.size(); ++i) {
    auto& shot = shots_.gather[i];
    gathered_.push_back({r, shot.point_count, i == gathered, i + 1 == shots_.gather.size()});
    if (repair.whole) continue;
    shot.first_run = first_run;
    shot.run_count = static_cast<std::uint32_t>(shots_.receivers.size()) - first_run;
    shot.first_box = repair.overtaken ? static_cast<std::uint32_t>(boxes) : 0;
    shot.box_count = static_cast<std::uint32_t>(repair.overtaken ? shots_.boxes.size() - boxes : boxes);
    // Where nothing was lost, whatever is lost now is lost where the change is seen.
    if (repair.past_losses) continue;
    const auto& column = parts_.system.shooters()[repair.shooter].column[repair.half];
    shot.open_looks = column.openLooks().from(std::exchange(looks, looks + shot.point_count), shot.point_count);
  }
  for (auto i = scattered; i < shots_.scatter.size(); ++i) scattered_.push_back({r, 1, false, false});
  (repair.whole ? counters_.retaken : counters_.repaired) +=
      shots_.gather.size() - gathered + shots_.scatter.size() - scattered;
}

/// One sample, whole or for some leaves; the last of a column puts them in the place of what was there.
void RepairBatch::take(std::size_t shot, LinkSample& links) {
  const bool scattered = shot >= gathered_.size();
  const auto& sample = scattered ? scattered_[shot - gathered_.size()] : gathered_[shot];
  const auto& repair = repairs_[sample.repair];
  if (scattered) links.scale(parts_.system.shooters()[repair.shooter].area);  // it carried a flux of one
  parts_.expander.expand(links, scattered);
  if (repair.whole) {
    parts_.system.addSample(repair.shooter, repair.half, parts_.expander, links, sample.points);
    return;
  }
  addPart(sample, links);
  if (sample.last) replaceLinks(sample.repair);
}

void RepairBatch::addPart(const Sample& sample, const LinkSample& links) {
  const auto& repair = repairs_[sample.repair];
  if (sample.first) {
    points_ = repair.looked;
    totals_ = repair.found;
  }
  totals_.open_looks.add(links.open_looks, std::exchange(points_, points_ + sample.points), sample.points);
  const auto area = parts_.system.shooters()[repair.shooter].area;
  const double all = links.due + links.escaped + links.absorbed;
  is_open_ =
      is_open_ || LinkColumn::isOpen(area, links.escaped + links.absorbed) || std::abs(all - area) > kNoSum * area;
  totals_.due += sample.points * links.due;
  totals_.escaped += sample.points * links.escaped;
  totals_.absorbed += sample.points * links.absorbed;
  const auto& sides = parts_.sides;
  auto reached = parts_.expander.sidesReached().begin();
  const auto end = parts_.expander.sidesReached().end();
  for (const auto& run : leaves_[sample.repair]) {
    while (reached != end && sides[*reached].first_value + sides[*reached].leaf_count <= run.first) ++reached;
    if (reached == end) break;
    if (sides[*reached].first_value > run.first) continue;
    for (std::uint32_t v = run.first; v < run.first + run.count; ++v)
      sum_[v] += static_cast<float>(sample.points) * parts_.expander.values()[v];
  }
}

/// All samples of a repair have come: their mean takes the place of what was there.
void RepairBatch::replaceLinks(std::uint32_t index) {
  auto& repair = repairs_[index];
  const auto& leaves = leaves_[index];
  const auto& shooter = parts_.system.shooters()[repair.shooter];
  const auto& column = shooter.column[repair.half];
  const double part = 1.0 / points_;
  std::vector<float> before;
  for (const auto& run : leaves) {
    const auto sum = std::span(sum_).subspan(run.first, run.count);
    if (repair.looked > 0) {
      addEarlierLooks(column, repair.looked, points_ - repair.looked, points_ >= repair.samples, run,
                      std::span(repair.by_points), sum, before);
    } else {
      for (auto& value : sum) value *= static_cast<float>(part);
    }
  }
  if (repair.past_losses) totals_.open_looks.bits |= column.openLooks().bits;
  if (std::exchange(is_open_, false)) {
    parts_.system.forget(repair.shooter, repair.half);
    anew_.push_back({repair.shooter, repair.old_shooter, repair.half, repair.samples, true, repair.overtaken});
  } else if (points_ < repair.samples && shooter.isLight()) {
    keepRough(index);
  } else {
    LinkColumn::Totals totals{part * totals_.due, part * totals_.escaped, part * totals_.absorbed, totals_.open_looks,
                              0.0};
    if (repair.past_losses) {
      totals.presumed = column.escaped() + column.absorbed();
      totals.due -= totals.presumed;
      totals.escaped += column.escaped();
      totals.absorbed += column.absorbed();
    }
    parts_.system.replaceLinks(repair.shooter, repair.half, leaves, sum_, totals);
  }
  for (const auto& run : leaves) std::fill_n(sum_.begin() + run.first, run.count, 0.0F);
}

/// Some points of a light say too little of what is lost, and nothing of what the others lose.
void RepairBatch::keepRough(std::uint32_t index) {
  const auto& repair = repairs_[index];
  auto totals = parts_.system.shooters()[repair.shooter].column[repair.half].totals();
  const auto others = Looks::kMany + 1 - std::min(points_, Looks::kMany + 1);
  const auto open = totals.open_looks.from(points_, others);
  totals.open_looks = totals_.open_looks;
  totals.open_looks.add(open, points_, others);
  parts_.system.replaceLinks(repair.shooter, repair.half, leaves_[index], sum_, totals);
  rough_.push_back(repair);
  rough_.back().looked = points_;
  rough_.back().found = totals_;
  leaves_of_rough_.push_back(index);
}

}  // namespace radiosity::solver
