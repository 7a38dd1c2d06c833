// LinkedSolver after an edit of geometry: what it takes over from the solver of the scene before.
#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <utility>

#include "common/parallel.h"
#include "server/solver/math/halves.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// By surface: its first side, or kNone.
std::vector<std::uint32_t> firstSides(const scene::PatchScene& patches, const std::vector<Side>& sides) {
  std::vector<std::uint32_t> first(patches.surfaces.size(), scene::kNone);
  for (auto s = static_cast<std::uint32_t>(sides.size()); s-- > 0;) first[sides[s].surface] = s;
  return first;
}

/// The side that a light polygon is a part of, by its key.
std::uint32_t sideOfLight(const LightPolygon& light, const scene::PatchScene& patches, const std::vector<Side>& sides) {
  const std::uint32_t triangle = light.key / 2;
  const auto found = std::ranges::find_if(sides, [&](const Side& side) {
    return side.side == light.key % 2 && triangle >= side.triangle_key &&
           triangle - side.triangle_key < patches.surfaces[side.surface].triangle_count;
  });
  return found == sides.end() ? scene::kNone : static_cast<std::uint32_t>(found - sides.begin());
}

}  // namespace

LinkedSolver::LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                           Transport& transport, const SolverSettings& settings, const LightSources& sources,
                           LinkedSolver& former, const scene::PatchMap& map, bool keep_former)
    : LinkedSolver(std::move(patches), transport, settings) {
  auto numbers = renumber(former, map, keep_former);
  auto change = changeOf(numbers);
  if (former.repair_.lacksLinks()) {
    auto all = change;
    addEarlier(numbers, all);
    repair_.shadows().earlier = std::make_unique<Shadows>(*patches_, sides_, std::move(all));
  }
  std::optional<ChangeReach> reach;
  const auto prepare = [&](std::size_t part) {  // each reads what none of them writes
    if (part == 0) repair_.shadows().now = std::make_unique<Shadows>(*patches_, sides_, std::move(change));
    if (part == 1) reach.emplace(*former.patches_, *patches_, map);
    if (part == 2 && (former.variation_.isTraced() || former.gather_)) (void)leafRays();
  };
  inTurns(3, prepare);
  repair_.countFrom(former.repair_);
  counters_ = former.counters_;
  rounds_ = former.rounds_;
  solutions_ = former.solutions_;
  sweeps_ = former.sweeps_;
  replayed_ = former.replayed_;
  aim_ = std::max(former.aim_, settings_.target_error);
  planner_.setTarget(aim_);
  planner_.inherit(former.planner_, numbers.side_after);
  inheritLights(former, numbers);
  takeMaterials(materials);
  takeSources(sources);
  inheritNodes(former, numbers);
  inheritEntries(former, numbers);
  repair_.plan(former.isRepairing() ? 0.0 : former.fieldNorm(),
               former.phase_ == Phase::kDone ? former.errorBesideMissing() : settings_.target_error, *reach);
  const auto value_before = unalteredBefore(numbers);
  if (former.variation_.isTraced()) inheritVariation(former, value_before);
  if (former.gather_) inheritRays(former, value_before);
  for (auto& half : half_) half.assign(system_.leafAreas().size(), glm::vec3(0.0F));
  findUnshot();
  solveAnew();
}

/// Sides that are still there keep their keys; others get keys that no side ever had.
LinkedSolver::Renumbering LinkedSolver::renumber(const LinkedSolver& former, const scene::PatchMap& map,
                                                 bool keep_former) {
  Renumbering numbers{former, map, keep_former, {}, {}, {}, {}};
  numbers.side_after.assign(former.sides_.size(), scene::kNone);
  numbers.unmoved_after = numbers.side_after;
  const auto first_sides = firstSides(*former.patches_, former.sides_);
  key_end_ = former.key_end_;
  triangle_key_end_ = former.triangle_key_end_;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    Side& side = sides_[s];
    const auto before = map.surface_before[side.surface];
    if (before == scene::kNone) {
      side.key = std::exchange(key_end_, key_end_ + side.node_count);
      side.triangle_key =
          std::exchange(triangle_key_end_, triangle_key_end_ + patches_->surfaces[side.surface].triangle_count);
      continue;
    }
    auto old_side = first_sides[before];
    while (former.sides_[old_side].side != side.side) ++old_side;
    side.key = former.sides_[old_side].key;
    side.triangle_key = former.sides_[old_side].triangle_key;
    numbers.side_after[old_side] = s;
    if (!map.moved[side.surface]) numbers.unmoved_after[old_side] = s;
  }
  numbers.unfinished.resize(former.system_.shooters().size());
  for (const auto& repair : former.repair_.waiting()) numbers.unfinished[repair.shooter][repair.half] = repair;
  return numbers;
}

GeometryChange LinkedSolver::changeOf(const Renumbering& numbers) const {
  GeometryChange change;
  change.boxes = numbers.map.boxes;
  change.came = numbers.map.came;
  for (const auto& side : sides_) {
    const auto first = numbers.map.leaf_altered.begin() + patches_->surfaces[side.surface].first_leaf;
    change.altered.insert(change.altered.end(), first, first + side.leaf_count);
  }
  return change;
}

/// Where an edit comes before those before it were taken in, theirs count too.
void LinkedSolver::addEarlier(const Renumbering& numbers, GeometryChange& change) const {
  const auto& former = numbers.former;
  const auto& shadows = former.repair_.shadows();
  const auto& earlier = (shadows.earlier ? shadows.earlier : shadows.now)->change();
  change.boxes.insert(change.boxes.end(), earlier.boxes.begin(), earlier.boxes.end());
  change.came.insert(change.came.end(), earlier.came.begin(), earlier.came.end());
  scene::joinBoxes(change.boxes);
  scene::joinBoxes(change.came);
  for (std::size_t s = 0; s < former.sides_.size(); ++s) {
    if (numbers.unmoved_after[s] == scene::kNone) continue;
    const auto from = former.sides_[s].first_value, to = sides_[numbers.unmoved_after[s]].first_value;
    for (std::uint32_t leaf = 0; leaf < former.sides_[s].leaf_count; ++leaf) {
      if (earlier.altered[from + leaf]) change.altered[to + leaf] = true;
    }
  }
}

/// Light polygons that have not moved, dark ones too. takeMaterials() will say how bright they are.
void LinkedSolver::inheritLights(LinkedSolver& former, Renumbering& numbers) {
  auto& shooters = former.system_.shooters();
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (shooters[n].light == scene::kNone) continue;
    const auto& light = former.lights_[shooters[n].light];
    const auto old_side = sideOfLight(light, *former.patches_, former.sides_);
    if (old_side == scene::kNone || numbers.unmoved_after[old_side] == scene::kNone) continue;
    Shooter shooter;
    shooter.light = static_cast<std::uint32_t>(lights_.size());
    shooter.area = light.area;
    shooter.most_bytes = memory_.mostBytes(light);
    lights_.push_back(light);
    planRepairsOf(shooters[n], n, system_.add(shooter), false, numbers);
  }
  inheritColumns(former, 0, numbers);
}

void LinkedSolver::inheritNodes(LinkedSolver& former, Renumbering& numbers) {
  auto& shooters = former.system_.shooters();
  const auto first_repair = repair_.added().size();
  std::vector<std::uint32_t> staying;
  for (const auto& shooter : shooters) {
    if (shooter.isLight() || numbers.side_after[shooter.place.side] == scene::kNone) continue;
    staying.push_back(numbers.side_after[shooter.place.side]);
  }
  memory_.learn(std::move(staying));
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (shooters[n].isLight() || numbers.side_after[shooters[n].place.side] == scene::kNone) continue;
    Shooter shooter;
    shooter.place = shooters[n].place;
    shooter.place.side = numbers.side_after[shooter.place.side];
    const Side& side = sides_[shooter.place.side];
    if (patches_->node_area[nodeId(side, shooter.place)] <= 0.0F) continue;  // buried
    shooter.certain = shooters[n].certain;
    shooter.resolution = shooters[n].resolution;
    shooter.mean = shooters[n].mean;
    shooter.sent = shooters[n].sent;
    shooter.most_bytes = memory_.mostBytes(shooter.place.side);
    planRepairsOf(shooters[n], n, system_.add(shooter), isAltered(shooter.place, repair_.shadows().now->change()),
                  numbers);
  }
  inheritColumns(former, first_repair, numbers);
}

bool LinkedSolver::isAltered(const NodePlace& place, const GeometryChange& change) const {
  const Side& side = sides_[place.side];
  const auto rect = leafRect(side, place);
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x) {
      if (change.altered[side.first_value + y * side.width + x]) return true;
    }
  }
  return false;
}

/// `whole`: the shooter itself is not what it was.
void LinkedSolver::planRepairsOf(const Shooter& from, std::uint32_t old_index, std::uint32_t index, bool whole,
                                 Renumbering& numbers) {
  numbers.shooter_before.resize(index + 1, scene::kNone);
  numbers.shooter_before[index] = old_index;
  auto& shooter = system_.shooters()[index];
  shooter.products = from.products;
  for (std::size_t half = 0; half < 2; ++half) {
    const auto& column = from.column[half];
    const auto& unfinished = numbers.unfinished[old_index][half];
    const bool is_light = from.light != scene::kNone;
    const auto samples = unfinished.whole ? unfinished.samples
                         : is_light       ? static_cast<std::uint32_t>(column.points())
                                          : column.samples();
    if (samples == 0) continue;
    const bool overtaken = unfinished.samples > 0;
    const bool was_altered = overtaken && !is_light && isAltered(shooter.place, repair_.shadows().earlier->change());
    repair_.add({index, old_index, half, samples, whole || was_altered || unfinished.whole, overtaken,
                 overtaken ? unfinished.reach : 0.0});
  }
}

/// By leaf value: that before the edit, or kNone where the leaf is another, or elsewhere.
std::vector<std::uint32_t> LinkedSolver::unalteredBefore(const Renumbering& numbers) const {
  const auto& altered = repair_.shadows().now->change().altered;
  std::vector<std::uint32_t> value_before(altered.size(), scene::kNone);
  const auto& sides = numbers.former.sides_;
  for (std::size_t s = 0; s < sides.size(); ++s) {
    if (numbers.unmoved_after[s] == scene::kNone) continue;
    const auto first = sides_[numbers.unmoved_after[s]].first_value;
    for (std::uint32_t leaf = 0; leaf < sides[s].leaf_count; ++leaf)
      if (!altered[first + leaf]) value_before[first + leaf] = sides[s].first_value + leaf;
  }
  return value_before;
}

void LinkedSolver::inheritVariation(const LinkedSolver& former, std::span<const std::uint32_t> value_before) {
  // Lamps that moved come after those that did not.
  const bool same_lights = std::ranges::equal(former.lights_, lights_, [](const auto& a, const auto& b) {
    return a.key == b.key && a.corners == b.corners && a.corner_count == b.corner_count;
  });
  variation_.inherit(former.variation_, value_before, *repair_.shadows().now, same_lights, lights_);
}

/// Of the matrix: rows of nodes that are what they were, and columns whose links went over as they are.
void LinkedSolver::inheritEntries(const LinkedSolver& former, const Renumbering& numbers) {
  const auto& shooters = system_.shooters();
  LinkSystem::FormerEntries same;
  same.row = numbers.shooter_before;
  same.row.resize(shooters.size(), scene::kNone);
  same.column.fill(same.row);
  for (const auto& repair : repair_.added()) {
    if (repair.whole) same.column[repair.half][repair.shooter] = scene::kNone;
  }
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (same.row[n] == scene::kNone || shooters[n].isLight()) continue;
    const auto& place = shooters[n].place;
    const auto old_side = former.system_.shooters()[same.row[n]].place.side;
    if (numbers.unmoved_after[old_side] != place.side || isAltered(place, repair_.shadows().now->change()))
      same.row[n] = scene::kNone;
  }
  system_.inheritEntries(former.system_, same);
}

/// Links of what is not taken again as a whole go over as they are. Both halves at once: most of it is fresh memory.
void LinkedSolver::inheritColumns(LinkedSolver& former, std::size_t first_repair, const Renumbering& numbers) {
  inBothHalves([&](std::size_t half) {
    for (const auto& repair : repair_.added(first_repair)) {
      if (repair.whole || repair.half != half) continue;
      auto& column = former.system_.shooters()[repair.old_shooter].column[half];
      system_.shooters()[repair.shooter].column[half] = column.renumbered(numbers.unmoved_after, former.sides_, sides_);
      if (!numbers.keep_former) column = {};
    }
  });
}

}  // namespace radiosity::solver
