#include "server/solver/repair/link_inheritance.h"

#include <algorithm>
#include <utility>

#include "server/solver/math/halves.h"

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

LinkInheritance::LinkInheritance(const Former& before, const Successor& after, const scene::PatchMap& map)
    : before_(before), after_(after), map_(map), keys_(before.keys) {
  findSides(map);
  unfinished_.resize(before_.parts.system.shooters().size());
  for (const auto& repair : before_.repair.waiting()) unfinished_[repair.shooter][repair.half] = repair;
}

void LinkInheritance::findSides(const scene::PatchMap& map) {
  const auto& old_sides = before_.parts.sides;
  side_after_.assign(old_sides.size(), scene::kNone);
  unmoved_after_ = side_after_;
  const auto first_sides = firstSides(before_.parts.patches, old_sides);
  for (std::uint32_t s = 0; s < after_.sides.size(); ++s) {
    Side& side = after_.sides[s];
    const auto before = map.surface_before[side.surface];
    if (before == scene::kNone) {
      const auto triangles = after_.parts.patches.surfaces[side.surface].triangle_count;
      side.key = std::exchange(keys_.node, keys_.node + side.node_count);
      side.triangle_key = std::exchange(keys_.triangle, keys_.triangle + triangles);
      continue;
    }
    auto old_side = first_sides[before];
    while (old_sides[old_side].side != side.side) ++old_side;
    side.key = old_sides[old_side].key;
    side.triangle_key = old_sides[old_side].triangle_key;
    side_after_[old_side] = s;
    if (!map.moved[side.surface]) unmoved_after_[old_side] = s;
  }
}

GeometryChange LinkInheritance::change() const {
  GeometryChange change;
  change.boxes = map_.boxes;
  change.came = map_.came;
  for (const auto& side : after_.sides) {
    const auto first = map_.leaf_altered.begin() + after_.parts.patches.surfaces[side.surface].first_leaf;
    change.altered.insert(change.altered.end(), first, first + side.leaf_count);
  }
  return change;
}

void LinkInheritance::addEarlier(GeometryChange& change) const {
  const auto& shadows = before_.repair.shadows();
  const auto& earlier = (shadows.earlier ? shadows.earlier : shadows.now)->change();
  change.boxes.insert(change.boxes.end(), earlier.boxes.begin(), earlier.boxes.end());
  change.came.insert(change.came.end(), earlier.came.begin(), earlier.came.end());
  scene::joinBoxes(change.boxes);
  scene::joinBoxes(change.came);
  const auto& old_sides = before_.parts.sides;
  for (std::size_t s = 0; s < old_sides.size(); ++s) {
    if (unmoved_after_[s] == scene::kNone) continue;
    const auto from = old_sides[s].first_value, to = after_.sides[unmoved_after_[s]].first_value;
    for (std::uint32_t leaf = 0; leaf < old_sides[s].leaf_count; ++leaf) {
      if (earlier.altered[from + leaf]) change.altered[to + leaf] = true;
    }
  }
}

void LinkInheritance::takeLights() {
  const auto& shooters = before_.parts.system.shooters();
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (shooters[n].light == scene::kNone) continue;
    const auto& light = before_.parts.lights[shooters[n].light];
    const auto old_side = sideOfLight(light, before_.parts.patches, before_.parts.sides);
    if (old_side == scene::kNone || unmoved_after_[old_side] == scene::kNone) continue;
    Shooter shooter;
    shooter.light = static_cast<std::uint32_t>(after_.lights.size());
    shooter.area = light.area;
    shooter.most_bytes = after_.parts.memory.mostBytes(light);
    after_.lights.push_back(light);
    takeShooter(n, after_.parts.system.add(shooter), false);
  }
  takeColumns(0);
}

void LinkInheritance::takeNodes() {
  const auto& shooters = before_.parts.system.shooters();
  const auto& after = after_.parts;
  const auto first_repair = after_.repair.added().size();
  std::vector<std::uint32_t> staying;
  for (const auto& shooter : shooters) {
    if (shooter.isLight() || side_after_[shooter.place.side] == scene::kNone) continue;
    staying.push_back(side_after_[shooter.place.side]);
  }
  after.memory.learn(std::move(staying));
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (shooters[n].isLight() || side_after_[shooters[n].place.side] == scene::kNone) continue;
    Shooter shooter;
    shooter.place = shooters[n].place;
    shooter.place.side = side_after_[shooter.place.side];
    const Side& side = after.sides[shooter.place.side];
    if (after.patches.node_area[nodeId(side, shooter.place)] <= 0.0F) continue;  // buried
    shooter.certain = shooters[n].certain;
    shooter.resolution = shooters[n].resolution;
    shooter.mean = shooters[n].mean;
    shooter.sent = shooters[n].sent;
    shooter.most_bytes = after.memory.mostBytes(shooter.place.side);
    takeShooter(n, after.system.add(shooter), isAltered(shooter.place, after_.repair.shadows().now->change()));
  }
  takeColumns(first_repair);
}

bool LinkInheritance::isAltered(const NodePlace& place, const GeometryChange& change) const {
  const Side& side = after_.sides[place.side];
  const auto rect = leafRect(side, place);
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x) {
      if (change.altered[side.first_value + y * side.width + x]) return true;
    }
  }
  return false;
}

/// `whole`: the shooter itself is not what it was.
void LinkInheritance::takeShooter(std::uint32_t old_index, std::uint32_t index, bool whole) {
  const auto& from = before_.parts.system.shooters()[old_index];
  shooter_before_.resize(index + 1, scene::kNone);
  shooter_before_[index] = old_index;
  auto& shooter = after_.parts.system.shooters()[index];
  shooter.products = from.products;
  for (std::size_t half = 0; half < 2; ++half) {
    const auto& column = from.column[half];
    const auto& unfinished = unfinished_[old_index][half];
    const bool is_light = from.light != scene::kNone;
    const auto samples = unfinished.whole ? unfinished.samples
                         : is_light       ? static_cast<std::uint32_t>(column.points())
                                          : column.samples();
    if (samples == 0) continue;
    const bool overtaken = unfinished.samples > 0;
    const bool was_altered =
        overtaken && !is_light && isAltered(shooter.place, after_.repair.shadows().earlier->change());
    after_.repair.add({index, old_index, half, samples, whole || was_altered || unfinished.whole, overtaken,
                       overtaken ? unfinished.reach : 0.0});
  }
}

/// Links of what is not taken again as a whole go over as they are. Both halves at once: most of it is fresh memory.
void LinkInheritance::takeColumns(std::size_t first_repair) const {
  inBothHalves([&](std::size_t half) {
    for (const auto& repair : after_.repair.added(first_repair)) {
      if (repair.whole || repair.half != half) continue;
      auto& column = before_.parts.system.shooters()[repair.old_shooter].column[half];
      after_.parts.system.shooters()[repair.shooter].column[half] =
          column.renumbered(unmoved_after_, before_.parts.sides, after_.sides);
      if (!before_.is_kept) column = {};
    }
  });
}

void LinkInheritance::takeEntries() const {
  const auto& shooters = after_.parts.system.shooters();
  LinkSystem::FormerEntries same;
  same.row = shooter_before_;
  same.row.resize(shooters.size(), scene::kNone);
  same.column.fill(same.row);
  for (const auto& repair : after_.repair.added()) {
    if (repair.whole) same.column[repair.half][repair.shooter] = scene::kNone;
  }
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (same.row[n] == scene::kNone || shooters[n].isLight()) continue;
    const auto& place = shooters[n].place;
    const auto old_side = before_.parts.system.shooters()[same.row[n]].place.side;
    if (unmoved_after_[old_side] != place.side || isAltered(place, after_.repair.shadows().now->change()))
      same.row[n] = scene::kNone;
  }
  after_.parts.system.inheritEntries(before_.parts.system, same);
}

std::vector<std::uint32_t> LinkInheritance::unalteredBefore() const {
  const auto& altered = after_.repair.shadows().now->change().altered;
  std::vector<std::uint32_t> value_before(altered.size(), scene::kNone);
  const auto& old_sides = before_.parts.sides;
  for (std::size_t s = 0; s < old_sides.size(); ++s) {
    if (unmoved_after_[s] == scene::kNone) continue;
    const auto first = after_.sides[unmoved_after_[s]].first_value;
    for (std::uint32_t leaf = 0; leaf < old_sides[s].leaf_count; ++leaf)
      if (!altered[first + leaf]) value_before[first + leaf] = old_sides[s].first_value + leaf;
  }
  return value_before;
}

}  // namespace radiosity::solver
