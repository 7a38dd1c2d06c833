// LinkedSolver as bytes and back: links as they are kept, and what its choices depend on. All else is made again from
// these: the matrix, unshot light, who lies below whom.
#include <algorithm>
#include <utility>
#include <vector>

#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kKind = 0x434b4e4cU;  // "LNKC": what there is below, and in which order

/// All of a shooter but its links.
template <typename Archive, typename Self>
void visitShooter(Archive& archive, Self& shooter) {
  archive(shooter.place, shooter.light, shooter.source, shooter.crowd, shooter.sample_cost, shooter.certain,
          shooter.resolution, shooter.area, shooter.weight, shooter.mean, shooter.sent, shooter.most_bytes,
          shooter.products);
}

}  // namespace

bool LinkColumn::restore(ArchiveReader& from, std::size_t sides, std::size_t values) {
  visit(from, *this);
  const auto fits = [&](const Run& run) {
    return std::uint64_t{run.side} + run.side_count <= sides && std::uint64_t{run.first_value} + run.count <= values &&
           std::uint64_t{run.offset} + run.count <= code_.all().size();
  };
  return from.ok() && std::all_of(runs_.begin(), runs_.end(), fits);
}

void LinkSystem::save(ArchiveWriter& to) const {
  to(static_cast<std::uint64_t>(shooters_.size()));
  for (const auto& shooter : shooters_) {
    visitShooter(to, shooter);
    for (const auto& column : shooter.column) column.save(to);
  }
  for (const auto& half : halves_) to(half.sweeps, half.unsolved, half.shining, half.area);
}

bool LinkSystem::isPlace(const NodePlace& place) const {
  if (place.side >= sides_.size() || place.level >= sides_[place.side].level_count) return false;
  const auto grid = scene::levelGrid(sides_[place.side].width, sides_[place.side].height, place.level);
  if (place.x >= grid.width || place.y >= grid.height) return false;
  const auto node = nodeId(sides_[place.side], place);
  return at(place.side, node) == scene::kNone && !hasBelow(place.side, node);
}

void LinkSystem::clear() {
  shooters_.clear();
  rows_.clear();
  emission_mean_.clear();
  reflectance_mean_.clear();
  nodes_.assign(sides_.size(), {});
  for (auto& members : members_) members.clear();
  changed_ = {};
  no_row_.clear();
  known_ = 0;
  next_column_ = 0;
  halves_ = {};
}

bool LinkSystem::restore(ArchiveReader& from) {
  clear();
  std::uint64_t count = 0;
  from(count);
  for (std::uint64_t n = 0; n < count && from.ok(); ++n) {
    Shooter shooter;
    visitShooter(from, shooter);
    for (auto& column : shooter.column) {
      if (!column.restore(from, sides_.size(), leaf_area_.size())) return false;
    }
    if (!shooter.isLight() && !isPlace(shooter.place)) return false;
    (void)add(shooter);
  }
  for (auto& half : halves_) from(half.sweeps, half.unsolved, half.shining, half.area);
  // So that the equation has its rows, which count as memory, before the next plan.
  updateMeans();
  makeRows();
  return from.ok();
}

template <typename Archive, typename Self>
void LinkedSolver::visit(Archive& archive, Self& self) {
  archive(self.lights_, self.sources_, self.sky_, self.phase_, self.limit_, self.lights_fit_, self.from_links_,
          self.edit_lights_planned_, self.settling_, self.growing_, self.rounds_, self.solutions_, self.sweeps_,
          self.replayed_, self.half_, self.refined_, self.by_links_, self.error_, self.counters_, self.sample_goal_,
          self.aim_, self.sampled_alone_);
  LinkWave::visit(archive, self.wave_);
  ShadedLight::visit(archive, self.shaded_);
  DirectSmoothing::visit(archive, self.direct_smoothing_);
  LinkPlanner::visit(archive, self.planner_);
  LinkMemory::visit(archive, self.memory_);
}

bool LinkedSolver::save(ArchiveWriter& to) const {
  if (pass_ != Pass::kNone || assessing_ != Assessed::kNothing || isBehind()) return false;
  to(kKind, static_cast<std::uint64_t>(system_.leafAreas().size()));
  visit(to, *this);
  to(std::vector<CrowdLight>(crowds_.begin(), crowds_.end()));
  to(shown_ != nullptr);
  if (shown_) to(shown_->corrections, shown_->common);
  system_.save(to);
  to(gather_ != nullptr);
  if (gather_) gather_->save(to);
  variation_.save(to);
  return true;
}

/// Their lamps are those of the scene, where they shine.
bool LinkedSolver::restoreCrowds(ArchiveReader& from) {
  std::vector<CrowdLight> saved;
  from(saved);
  const auto here = std::exchange(crowds_, {});
  for (const auto& light : saved) {
    const auto known = std::ranges::find(here, light.key, &Crowd::key);
    crowds_.push_back({light, known != here.end() ? known->lamps : nullptr});
    if (!light.isDark() && !crowds_.back().lamps) return false;
  }
  return from.ok();
}

/// What was told was an end that had come before: its halves are those that were saved.
bool LinkedSolver::restoreShown(ArchiveReader& from) {
  bool shows = false;
  from(shows);
  shown_ = nullptr;
  if (!shows) return from.ok();
  auto end = std::make_shared<KeptEnd>();
  from(end->corrections, end->common);
  end->key = lightKey();
  end->half = half_;
  end->shaded = shaded_.values();
  end->error = error_;
  shown_ = std::move(end);
  const auto leaves = system_.leafAreas().size();
  return from.ok() && (shown_->common.empty() || shown_->common.size() == leaves) &&
         std::ranges::all_of(shown_->corrections, [&](const auto& c) { return c.value < leaves; });
}

bool LinkedSolver::restore(ArchiveReader& from) {
  std::uint32_t kind = 0;
  std::uint64_t values = 0;
  from(kind, values);
  if (!from.ok() || kind != kKind || values != system_.leafAreas().size()) return false;
  visit(from, *this);
  if (!restoreCrowds(from)) return false;
  if (!restoreShown(from)) return false;
  if (!(aim_ > 0.0 && aim_ <= 1.0) || !planner_.fits() || !system_.restore(from)) return false;
  planner_.setTarget(aim_);
  rounds_before_edit_ = rounds_;
  const auto& shooters = system_.shooters();
  const auto known = [&](const Shooter& shooter) {
    return (shooter.light == scene::kNone || shooter.light < lights_.size()) &&
           (shooter.source == scene::kNone || shooter.source < sources_.size()) &&
           (shooter.crowd == scene::kNone || (shooter.crowd < crowds_.size() && shooter.sample_cost > 0.0));
  };
  if (half_[0].size() != values || half_[1].size() != values || !shaded_.isWhole() || !wave_.fits() ||
      !std::all_of(shooters.begin(), shooters.end(), known) || !direct_smoothing_.fits(values))
    return false;
  bool gathers = false;
  from(gathers);
  if (gathers) {
    startRays();
    if (!gather_->restore(from)) return false;
  }
  if (!variation_.restore(from) || !from.ok()) return false;
  findUnshot();
  updateVariation();
  return true;
}

}  // namespace radiosity::solver
