#include "server/solver/probes/probe_lamps.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <tuple>
#include <utility>

#include "common/parallel.h"
#include "common/take_first.h"
#include "server/solver/math/sampling.h"
#include "server/solver/probes/lamp_harmonics.h"

namespace radiosity::solver {
namespace {

/// Probes from which a thread looks at a time.
constexpr std::size_t kLookersAPart = 32;
/// Of a distance, unit box: at a lamp's middle.
constexpr double kLeastSquare = 1e-12;
using Rounds = RoundHarmonics<ProbeLamps::kRounds>;

/// The lamps and sources of a scene one after the other.
class Emitters {
 public:
  explicit Emitters(const PlaceLight& light) : lamps_(light.lamps()), sources_(light.sources()) {}

  [[nodiscard]] std::size_t count() const { return lamps_.size() + sources_.size(); }
  [[nodiscard]] bool isPolygon(std::uint32_t index) const { return index < lamps_.size(); }
  [[nodiscard]] const LightPolygon& polygon(std::uint32_t index) const { return lamps_[index]; }
  [[nodiscard]] LampGlimpse glimpseOf(std::uint32_t index, const glm::dvec3& place, const glm::dvec2& at) const {
    return isPolygon(index) ? glimpse(lamps_[index], place, at) : glimpse(sources_[index - lamps_.size()], place, at);
  }
  [[nodiscard]] std::uint64_t keyOfEmitter(std::uint32_t index) const {
    return isPolygon(index) ? lamps_[index].key : mixKeys(sources_[index - lamps_.size()].shapeKey(), 1);
  }
  [[nodiscard]] glm::dvec3 lightOf(std::uint32_t index) const {
    return isPolygon(index) ? glm::dvec3(lamps_[index].emission) : sources_[index - lamps_.size()].intensity;
  }

 private:
  std::span<const LightPolygon> lamps_;
  std::span<const PunctualLights::Source> sources_;
};

/// One place at which lamps are looked.
struct Looker {
  const Emitters& emitters;
  const TintedRays& rays;
  glm::dvec3 place;

  [[nodiscard]] glm::dvec3 passageTo(const LampGlimpse& seen, std::uint64_t key) const {
    return rays.passageTo({place, glm::dvec3(0.0)}, seen.point, seen.normal, key);
  }
};

/// What the points of a lamp tell, in one round.
struct RoundLooks {
  std::array<glm::dvec3, kHarmonics> seen{};
  std::array<double, kHarmonics> all{};
  glm::dvec3 seen_weight{0.0};
  double weight = 0.0;
};

std::array<RoundLooks, ProbeLamps::kRounds> looksOf(const Looker& from, std::uint32_t emitter, std::uint64_t key) {
  std::array<RoundLooks, ProbeLamps::kRounds> rounds;
  for (std::uint32_t r = 0; r < rounds.size(); ++r) {
    const auto of_round = mixKeys(key, r);
    const Sobol4 draws(of_round);
    for (std::uint32_t k = 0; k < ProbeLamps::kLooks; ++k) {
      const auto draw = draws(k);
      const auto glimpse = from.emitters.glimpseOf(emitter, from.place, {draw.x, draw.y});
      if (!(glimpse.weight > 0.0)) continue;
      const auto passes = from.passageTo(glimpse, mixKeys(of_round, k));
      const auto harmonics = harmonicsOf(glimpse.way);
      const double weight = glimpse.weight / ProbeLamps::kLooks;
      for (std::size_t h = 0; h < kHarmonics; ++h) {
        rounds[r].seen[h] += weight * harmonics[h] * passes;
        rounds[r].all[h] += weight * harmonics[h];
      }
      rounds[r].seen_weight += weight * passes;
      rounds[r].weight += weight;
    }
  }
  return rounds;
}

/// Of a polygon the exact harmonics of all of it, times the part that is seen, stand for what its points tell on the
/// whole (a regression estimator: Cochran 1977, "Sampling techniques", 7): where nothing hides it no error is left.
void addAll(const Looker& from, std::uint32_t emitter, const glm::dvec3& light, std::uint64_t key, Rounds& sums) {
  const auto rounds = looksOf(from, emitter, key);
  glm::dvec3 part(0.0);
  std::array<double, kHarmonics> exact{};
  if (from.emitters.isPolygon(emitter)) {
    exact = unhiddenHarmonics(from.emitters.polygon(emitter), from.place);
    double weight = 0.0;
    for (const auto& round : rounds) {
      part += round.seen_weight;
      weight += round.weight;
    }
    part = weight > 0.0 ? part / weight : glm::dvec3(0.0);
  }
  for (std::size_t r = 0; r < rounds.size(); ++r)
    for (std::size_t h = 0; h < kHarmonics; ++h)
      sums[r][h] += light * (rounds[r].seen[h] + part * (exact[h] - rounds[r].all[h]));
}

/// Of a source: a hundredth of what its intensity would bring. The middle of a disc may lie outside of a spot's cone,
/// or of a range, where other points do not, and the chance of what brings light must not be 0. All of a polygon faces
/// the way its middle does.
double leastWeight(const glm::dvec3& place, const LampGlimpse& middle) {
  const auto way = middle.point - place;
  return 0.01 / std::max(kLeastSquare, glm::dot(way, way));
}

/// Of very many lamps some, drawn by what the middle of each would bring.
void addSome(const Looker& from, std::span<const ProbeEmitter> lamps, std::uint32_t count, std::uint64_t key,
             Rounds& sums) {
  std::vector<double> up_to;
  double all = 0.0;
  for (const auto& lamp : lamps) {
    const auto middle = from.emitters.glimpseOf(lamp.index, from.place, {0.5, 0.5});
    const double least = from.emitters.isPolygon(lamp.index) ? 0.0 : leastWeight(from.place, middle);
    up_to.push_back(all += std::max(middle.weight, least) * (lamp.light.x + lamp.light.y + lamp.light.z));
  }
  for (std::uint32_t r = 0; r < sums.size() && all > 0.0; ++r) {
    const auto of_round = mixKeys(key, r);
    const Sobol4 draws(of_round);
    for (std::uint32_t k = 0; k < count; ++k) {
      const auto draw = draws(k);
      const auto drawn = static_cast<std::size_t>(std::ranges::upper_bound(up_to, draw.z * all) - up_to.begin());
      const auto number = std::min(drawn, up_to.size() - 1);
      const double chance = (up_to[number] - (number > 0 ? up_to[number - 1] : 0.0)) / all;
      const auto seen = from.emitters.glimpseOf(lamps[number].index, from.place, {draw.x, draw.y});
      if (!(seen.weight > 0.0 && chance > 0.0)) continue;
      const auto light =
          seen.weight / (chance * count) * from.passageTo(seen, mixKeys(of_round, k)) * lamps[number].light;
      const auto harmonics = harmonicsOf(seen.way);
      for (std::size_t h = 0; h < kHarmonics; ++h) sums[r][h] += harmonics[h] * light;
    }
  }
}

}  // namespace

/// A third of the memory is for those of lamps that were switched off.
std::size_t ProbeLamps::mostColumns() const {
  const auto bytes = sizeof(Coefficients) * std::max<std::size_t>({1, places_.size(), in_all_});
  return std::clamp<std::size_t>(kMostBytes * 2 / 3 / bytes, 1, kMostColumns);
}

/// Each lamp by itself where there are few. Of more those of one colour shine together, as panels in a ceiling do, and
/// where there are too many colours all lamps are one group, which an edit of any of them looks for anew.
std::vector<ProbeLamps::Group> ProbeLamps::groupsOf(const PlaceLight& light) const {
  const Emitters emitters(light);
  const bool are_few = emitters.count() <= mostColumns();
  std::vector<Group> groups;
  std::map<std::tuple<double, double, double>, std::size_t> of_colour;
  for (std::uint32_t i = 0; i < emitters.count(); ++i) {
    const ProbeEmitter emitter{i, emitters.keyOfEmitter(i), glm::dvec3(1.0)};
    const auto colour = emitters.lightOf(i);
    const auto [found, is_new] = of_colour.try_emplace({colour.x, colour.y, colour.z}, groups.size());
    if (are_few || is_new) {
      groups.push_back({{emitter.key, colour, {}}, {emitter}});
      continue;
    }
    auto& group = groups[found->second];
    group.column.key = mixKeys(group.column.key, emitter.key);
    group.emitters.push_back(emitter);
  }
  if (groups.size() <= mostColumns()) return groups;
  Group all{{0, glm::dvec3(1.0), {}}, {}};
  for (const auto& group : groups) {
    const auto& colour = group.column.light;
    for (int c = 0; c < 3; ++c) all.column.key = mixKeys(all.column.key, std::bit_cast<std::uint64_t>(colour[c]));
    for (auto emitter : group.emitters) {
      emitter.light = colour;
      all.column.key = mixKeys(all.column.key, emitter.key);
      all.emitters.push_back(emitter);
    }
  }
  groups.assign(1, std::move(all));
  return groups;
}

void ProbeLamps::update(const PlaceLight& light) {
  std::vector<Column> next;
  for (auto& group : groupsOf(light)) {
    const auto is_same = [&](const Column& column) { return column.key == group.column.key; };
    if (auto same = takeFirst({&columns_, &spare_}, is_same)) {
      same->light = group.column.light;
      next.push_back(std::move(*same));
      continue;
    }
    look(light, group);
    ++taken_;
    next.push_back(std::move(group.column));
  }
  // What is left was switched off, or moved; half as much may be kept for its return.
  std::ranges::move(columns_, std::back_inserter(spare_));
  while (spare_.size() > mostSpare()) spare_.erase(spare_.begin());
  columns_ = std::move(next);
}

void ProbeLamps::look(const PlaceLight& light, Group& group) const {
  group.column.of_probe.resize(places_.size());
  inTurns((places_.size() + kLookersAPart - 1) / kLookersAPart, [&](std::size_t part) {
    const auto end = std::min(places_.size(), (part + 1) * kLookersAPart);
    for (auto i = part * kLookersAPart; i < end; ++i) group.column.of_probe[i] = lookFrom(light, group, i);
  });
}

ProbeLamps::Coefficients ProbeLamps::lookFrom(const PlaceLight& light, const Group& group, std::size_t probe) const {
  const Emitters emitters(light);
  const Looker from{emitters, light.tinted(), places_[probe]};
  const auto key = mixKeys(mixKeys(key_, group.column.key), probe);
  Rounds rounds{};
  if (group.emitters.size() <= kFew) {
    for (const auto& emitter : group.emitters)
      addAll(from, emitter.index, emitter.light, mixKeys(key, emitter.key), rounds);
  } else {
    addSome(from, group.emitters, kDraws, key, rounds);
  }
  std::array<glm::dvec3, kHarmonics> mean{}, variance{};
  addRounds<kRounds>(rounds, mean, variance);
  Coefficients made;
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    made[0][h] = glm::vec3(mean[h]);
    made[1][h] = glm::vec3(variance[h]);
  }
  return made;
}

void ProbeLamps::addTo(std::size_t probe, ProbeSums& sums) const {
  for (const auto& column : columns_) {
    const auto& of = column.of_probe[probe];
    for (std::size_t h = 0; h < kHarmonics; ++h) {
      sums.mean[h] += column.light * glm::dvec3(of[0][h]);
      sums.variance[h] += column.light * column.light * glm::dvec3(of[1][h]);
    }
  }
}

}  // namespace radiosity::solver
