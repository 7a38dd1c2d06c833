// LeafVariation after an edit of geometry. Nine of ten ways from a receiver meet no leaf near by; to find that out was
// most of what paths took, and an edit changes it only where something was or is that moved. Nor does it change where
// the others lead, unless it lies in their way.
#include <algorithm>
#include <glm/geometric.hpp>

#include "common/give_back.h"
#include "server/solver/math/halves.h"
#include "server/solver/variation/leaf_variation.h"

namespace radiosity::solver {

void LeafVariation::inherit(const LeafVariation& former, std::span<const std::uint32_t> value_before,
                            std::span<const Tells> tells, const Shadows* change, std::span<const LightPolygon> lights) {
  if (!former.is_traced_ || stands_for_ != 1.0 || former.stands_for_ != 1.0) return;
  if (former.count_.empty() || !former.wanted_.empty()) return;  // what is still to be traced is not known
  const auto fewest = *std::ranges::min_element(former.count_);
  std::vector<std::uint16_t> count_before;  // by former leaf value
  for (std::size_t r = 0; r < former.receivers_.size(); ++r) {
    count_before.resize(former.receivers_[r] + 1, 0);
    count_before.back() = former.count_[r];
  }
  std::vector<std::uint32_t> value_after;  // by former leaf value, also of those that receive nothing
  for (std::uint32_t value = 0; value < value_before.size(); ++value) {
    const auto before = value_before[value];
    if (before == scene::kNone) continue;
    if (before >= value_after.size()) value_after.resize(before + 1, scene::kNone);
    value_after[before] = value;
  }
  known_.assign(value_before.size(), 0);
  count_.assign(receivers_.size(), fewest);
  for (std::size_t r = 0; r < receivers_.size(); ++r) {
    const auto value = receivers_[r], before = value_before[value];
    if (before >= count_before.size() || count_before[before] == 0) continue;
    count_[r] = count_before[before];
    if (tells[value] == Tells::kAll || (tells[value] == Tells::kByWay && change != nullptr))
      known_[value] = count_before[before];
  }
  kept_for_ = former.traced_for_;
  inBothHalves([&](std::size_t half) { keepPaths(former, half, value_after, tells, change, lights); });
}

/// Of what something changed near to: ways that pass it may meet other leaves than they did.
void LeafVariation::askWays(std::size_t half, std::span<const Tells> tells, const Shadows& change) {
  for (const auto receiver : receivers_) {
    if (tells[receiver] != Tells::kByWay || known_[receiver] == 0) continue;
    const auto middle = rays_->placeOn(receiver, glm::dvec2(0.5));
    const glm::vec3 normal(middle.normal);
    if (rays_->isEven(receiver) && !change.changesBefore(receiver, normal, static_cast<float>(nearest()))) continue;
    for (std::uint32_t k = 0; k < known_[receiver]; ++k) {
      const auto way = firstWay(receiver, keyOf(receiver, k, half));
      if (change.changesAlong(glm::vec3(way.from.position), glm::vec3(way.from.position + nearest() * way.direction)))
        there_[half].push_back({numberOf(receiver, k)});
    }
  }
}

/// Those of receivers that are known, in the order of their numbers.
void LeafVariation::keepPaths(const LeafVariation& former, std::size_t half, std::span<const std::uint32_t> value_after,
                              std::span<const Tells> tells, const Shadows* change,
                              std::span<const LightPolygon> lights) {
  if (change != nullptr) askWays(half, tells, *change);
  const auto asked = there_[half].size();
  const auto isAsked = [&](std::uint64_t number) {
    return std::ranges::binary_search(KnownOnes(there_[half]).first(asked), number, {}, &Known::number);
  };
  const auto after = [&](std::uint32_t value) {
    return value < value_after.size() ? value_after[value] : scene::kNone;
  };
  std::vector<glm::vec4> ball;  // around lights
  for (const auto& light : lights) ball.push_back(light.ball());
  // What it sees of what it meets, and of the light that was drawn for it, none of which moved. Leaves and lamps as a
  // whole tell of most; something large right under a lamp is between it and most leaves, but not in most ways.
  const auto isWhatItWas = [&](Path& path) {
    path.by = after(path.by);
    bool may_pass = !lights.empty() && path.by != scene::kNone &&
                    change->isPassed(path.by, glm::vec3(ball[path.light]), ball[path.light].w);
    for (auto& seen : path.seen) {
      seen = after(seen);  // nothing of the sky, and of what receives no light
      if (seen == scene::kNone || path.by == scene::kNone) return false;
      may_pass = may_pass || change->mayHide(path.by, seen);
    }
    return !may_pass || passesNothing(path, half, *change, lights);
  };
  for (auto path : former.paths_[half]) {
    const auto receiver = after(path.receiver);
    if (receiver == scene::kNone || known_[receiver] == 0) continue;
    Known known{numberOf(receiver, path.index)};
    if (tells[receiver] == Tells::kByWay && isAsked(known.number)) continue;
    path.receiver = receiver;
    if (change != nullptr && isWhatItWas(path)) {
      known.kept = static_cast<std::uint32_t>(kept_[half].size());
      kept_[half].push_back(path);
    }
    there_[half].push_back(known);
  }
  std::ranges::sort(there_[half], {}, &Known::number);
}

/// By its very ways, of a path in the numbers of this scene whose first part is as it was.
bool LeafVariation::passesNothing(const Path& path, std::size_t half, const Shadows& change,
                                  std::span<const LightPolygon> lights) const {
  const auto key = keyOf(path.receiver, path.index, half);
  const auto way = firstWay(path.receiver, key);
  const auto end = rays_->endOn(path.by, way.from, way.direction);
  if (!end) return false;
  const std::array<Place, 2> places{*end, rays_->placeOn(path.by, way.at)};
  for (std::size_t p = 0; p < 2; ++p) {
    const glm::vec3 from(places[p].position);
    if (change.mayHide(from, glm::vec3(wayOn(key, places[p])), path.seen[p])) return false;
    if (!lights.empty() && change.isPassed(from, glm::vec3(pointOn(lights[path.light], key)))) return false;
  }
  return true;
}

/// Of this receiver and those after it.
LeafVariation::KnownOnes LeafVariation::knownFrom(std::uint32_t receiver, std::size_t half) const {
  const KnownOnes all(there_[half]);
  const auto first = std::ranges::lower_bound(all, numberOf(receiver, 0), {}, &Known::number);
  return all.subspan(static_cast<std::size_t>(first - all.begin()));
}

void LeafVariation::forgetFormer() {
  giveBack(known_);
  there_ = {};
  kept_ = {};
}

}  // namespace radiosity::solver
