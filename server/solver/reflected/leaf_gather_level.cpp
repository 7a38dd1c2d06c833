// The level of reflected light: what is sent and does not leave the scene arrives. Rays know each exchange between two
// leaves badly, and this very well.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/clones.h"
#include "common/give_back.h"
#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_gather.h"

namespace radiosity::solver {
namespace {

/// By more than this the level of all light is not changed: rays that know it this badly are few.
constexpr double kMostLevel = 4.0, kMostOff = 0.5;
/// Light that both halves lack by more than so many times what they differ by is not lacking by chance.
constexpr double kByChance = 2.0;
/// Of rays that end on such leaves no more are kept in mind than one for so many leaves.
constexpr std::uint32_t kLeavesAnArrival = 2;
/// Parted leaves lose no more than so many times what they would if they shone evenly: of one of which a quarter
/// shines, and loses all that is lost.
constexpr double kMostLoss = 4.0;
/// Of other leaves what rays say.
constexpr std::array<double, 4> kAsRays{1.0, 1.0, 1.0, 1.0};

}  // namespace

/// How much of their light leaves lose, and which sides are of one part.
void LeafGather::weighRays() {
  has_parted_ = false;
  parted_ = {};
  for (std::uint32_t v = 0; v < sights_.leafCount() && !has_parted_; ++v)
    has_parted_ = areaOf(v) > 0.0 && sights_.isParted(v);
  // Sides that see each other, if over others, are of one part, which has the number of the first of them.
  std::array<UnionFind, 2> parts{UnionFind(sides_.size()), UnionFind(sides_.size())};
  inBothHalves([&](std::size_t half) { weighRays(half, parts[half]); });
  seen_part_.resize(sides_.size());
  for (std::uint32_t s = 0; s < sides_.size(); ++s) parts[0].join(s, parts[1].find(s));
  for (std::uint32_t s = 0; s < sides_.size(); ++s) seen_part_[s] = parts[0].find(s);
}

/// Light passes from one part of the scene to another through what is translucent, which makes them one.
void LeafGather::joinParts() {
  part_ = seen_part_;
  if (light_.passing.empty()) return;
  UnionFind parts(sides_.size());
  for (std::uint32_t s = 0; s < sides_.size(); ++s) parts.join(s, seen_part_[s]);
  for (const auto& side : sides_)
    if (!passingTo(light_.passing, side).empty()) parts.join(side.number, side.other);
  for (std::uint32_t s = 0; s < sides_.size(); ++s) part_[s] = parts.find(s);
}

void LeafGather::weighRays(std::size_t half, UnionFind& parts) {
  lost_[half] = LostRays(sights_.leafCount());
  std::vector<std::uint32_t> joined(sides_.size(), scene::kNone);  // by side: the last that it was joined to
  const auto leaves = sights_.leafCount();
  std::size_t first = 0;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const auto join = [&](std::uint32_t seen) {
      if (joined[seen] == s) return;
      joined[seen] = s;
      parts.join(s, seen);
    };
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count;
         first += sights_.counts()[v++]) {
      LostRays::Counts lost;
      for (const auto end : sights_.ends(half, first, sights_.counts()[v])) {
        if (sights_.isDoubtful(half, end)) ++lost.doubtful;
        if (end < leaves) {  // most
          join(sights_.sideOf(end));
        } else if (end >= sights_.endCount()) {
          if (const auto seen = sights_.firstEnd(half, end); seen < leaves) join(sights_.sideOf(seen));
          joinSteps(half, end, parts);
        } else {
          if (sights_.isAbsorbed(end)) {
            ++lost.absorbed;
          } else {
            ++(sights_.isSkyAbove(end) ? lost.above : lost.below);
          }
        }
      }
      lost_[half].add(v, lost);
    }
  }
  if (lost_[half].isNothing()) lost_[half] = {};  // of a closed room
}

/// Where a ray goes on, and on.
void LeafGather::joinSteps(std::size_t half, std::uint32_t end, UnionFind& parts) const {
  const auto steps = sights_.steps(half);
  for (end = sights_.behindPanes(half, end); end >= sights_.endCount();) {
    const auto& step = steps[end - sights_.endCount()];
    end = sights_.behindPanes(half, step.next);
    const auto next = sights_.firstEnd(half, end);
    if (next < sights_.leafCount()) parts.join(sights_.sideOf(LeafSights::leafOf(step)), sights_.sideOf(next));
  }
}

/// x, but for what few rays find too much missing of: with what came over links no leaf gets less than no light.
inline __attribute__((always_inline)) LeafGather::Light LeafGather::solved(std::size_t h, std::size_t v) const {
  const auto& x = solved_[h];
  const auto& over_links = light_.irradiance[h][v];
  return lightOf(
      {std::max(x[0][v], -over_links.x), std::max(x[1][v], -over_links.y), std::max(x[2][v], -over_links.z)});
}

/// What comes straight from the sky, by rays as they are.
inline __attribute__((always_inline)) LeafGather::Light LeafGather::skyAt(std::size_t h, std::size_t v,
                                                                          const Lost& lost) const {
  Light light{};
  if (const auto& sky = halves_[h].sky; !sky.empty()) return {sky[v][0], sky[v][1], sky[v][2], 0.0};
  const auto above = static_cast<double>(lost.above), below = static_cast<double>(lost.below);
  if (above + below <= 0.0) return light;
  for (std::size_t c = 0; c < 3; ++c)
    light[c] = above * light_.sky[0][static_cast<int>(c)] + below * light_.sky[1][static_cast<int>(c)];
  return light;
}

/// Calls visit() with each ray that ends on such a leaf. Those that come through coloured glass are left aside, and so
/// is what leaves send there.
template <typename Visit>
void LeafGather::visitParted(std::size_t h, std::span<const std::uint32_t> leaves, const Visit& visit) const {
  if (leaves.empty()) return;
  const auto steps = sights_.steps(h);
  std::vector<bool> is_parted(sights_.endCount() + steps.size());  // by end of a ray
  for (const auto v : leaves) is_parted[v] = true;
  for (std::size_t i = 0; i < steps.size(); ++i)
    is_parted[sights_.endCount() + i] = !PaneStep::is(steps[i].by) && is_parted[LeafSights::leafOf(steps[i])];
  for (std::uint32_t v = 0; v < sights_.leafCount(); ++v) {
    for (const auto end : sights_.seen(h, v))
      if (is_parted[end]) visit(Arrival{v, end});
  }
}

/// Where a ray ends, or goes on: what the leaf there has but for what comes by rays, and what the ray finds of that.
LeafGather::Light LeafGather::sentFrom(std::size_t h, std::uint32_t end) const {
  const auto& source = halves_[h].source;
  Light sent{}, part{1.0, 1.0, 1.0, 0.0};
  for (; end >= sights_.endCount(); end = sights_.steps(h)[end - sights_.endCount()].next) {
    const auto& step = sights_.steps(h)[end - sights_.endCount()];
    if (SpecularStep::is(step.by)) break;
    if (PaneStep::is(step.by)) {
      for (std::size_t c = 0; c < 3; ++c) part[c] *= static_cast<double>(sights_.tintOf(step)[static_cast<int>(c)]);
      continue;
    }
    const auto by = step.by;
    const auto reflectance = lightOf(light_.reflectance[by]);
    for (std::size_t c = 0; c < 3; ++c) {
      sent[c] += part[c] * (source[by][c] + passedAt(h, by, c));
      part[c] *= reflectance[c];
    }
  }
  if (end >= sights_.endCount()) end = LeafSights::leafOf(sights_.steps(h)[end - sights_.endCount()]);  // of a mirror
  const bool is_leaf = end < sights_.leafCount();
  const auto x = is_leaf ? solved(h, end) : Light{};
  const auto reflectance = is_leaf ? lightOf(light_.reflectance[end]) : Light{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double passed = is_leaf ? passedAt(h, end, c) : 0.0;
    sent[c] += part[c] * (source[end][c] + reflectance[c] * x[c] + passed);
  }
  return sent;
}

void LeafGather::addArrival(std::size_t h, const Arrival& ray, std::span<PartedFlux> fluxes) const {
  const auto by = sights_.firstEnd(h, ray.end);
  const double share = areaOf(ray.value) / sights_.counts()[ray.value];
  auto& arrives = fluxes[part_[sights_.sideOf(by)]].arrives;
  const auto sent = sentFrom(h, ray.end);
  for (std::size_t c = 0; c < 3; ++c) arrives[c] += share * sent[c];
}

/// Of a leaf that is parted rays may be lost in a dark strip of it, under a floor that it reaches through, which sends
/// nothing. By part of the scene and channel: how much of its light such leaves lose, of what they would lose if they
/// shone evenly: none of it, or several times as much where the other part is dark. They send, and where rays of others
/// end on them that much arrives; the rest is lost.
void LeafGather::weighPartedLoss(std::size_t h) {
  parted_loss_[h].assign(sides_.size(), kAsRays);
  auto& kept = parted_[h];
  Parted found;
  for (std::uint32_t v = 0; v < sights_.leafCount() && !kept; ++v)
    if (losesApart(h, v)) found.leaves.push_back(v);
  const auto& leaves = kept ? kept->leaves : found.leaves;
  std::vector<PartedFlux> fluxes(leaves.empty() ? 0 : sides_.size());
  for (const auto v : leaves) {
    auto& flux = fluxes[part_[sights_.sideOf(v)]];
    const auto sent = sentFrom(h, v);
    const double beside_panes = 1.0 - partThroughPanes(h, v);
    for (std::size_t c = 0; c < 3; ++c) {
      flux.sent[c] += areaOf(v) * beside_panes * sent[c];
      flux.even[c] += areaOf(v) * sent[c] * lostOf(h, v).all();
    }
  }
  const std::size_t most = sights_.leafCount() / kLeavesAnArrival;
  if (kept) {
    for (const auto& ray : kept->arrivals) addArrival(h, ray, fluxes);
  } else {
    visitParted(h, leaves, [&](const Arrival& ray) {
      addArrival(h, ray, fluxes);
      if (found.arrivals.size() <= most) found.arrivals.push_back(ray);
    });
  }
  for (std::size_t p = 0; p < fluxes.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& flux = fluxes[p];
      if (flux.even[c] > 0.0)
        parted_loss_[h][p][c] = std::clamp((flux.sent[c] - flux.arrives[c]) / flux.even[c], 0.0, kMostLoss);
    }
  }
  if (!kept && found.arrivals.size() <= most) kept = std::move(found);
}

/// Part of a leaf's light that is lost, of what rays of it are; by channel.
const LeafGather::Light& LeafGather::lossOf(std::size_t h, std::uint32_t v) const {
  return losesApart(h, v) ? parted_loss_[h][part_[sights_.sideOf(v)]] : kAsRays;
}

/// By part of the scene and channel: what makes
/// sum a x = sum a (h (r + rho x) + s), h being the part of a leaf's light that other leaves get and s what comes from
/// the sky: x times a factor. Where x is as much below nothing as above it, as where shooters have sent the mean of
/// what is there and its pattern is left, that says nothing; all light of the part, with what came over links, makes up
/// for what little is off then.
LeafGather::Levels LeafGather::levels(std::size_t h) {
  if (has_parted_) weighPartedLoss(h);
  std::vector<LevelSum> sums(sides_.size());
  addLevels(h, sums);
  Levels levels(sides_.size());
  for (std::size_t p = 0; p < sums.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& sum = sums[p];
      const double left = sum.left[c], kept = sum.kept[c];
      const double level = left / kept, part = (left - kept) / sum.all[c];
      levels[p][c].missed = left - kept;
      if (2.0 * kept > sum.size[c] && level * sum.least[c] >= -1.0 && level > 1.0 / kMostLevel && level < kMostLevel) {
        levels[p][c].gathered = level;
      } else if (sum.all[c] > 0.0 && std::abs(part) < kMostOff) {
        levels[p][c].gathered = 1.0 + part;
        levels[p][c].over_links = part;
      } else if (sum.stays[c] > 0.0) {
        levels[p][c].missed *= sum.area / sum.stays[c];  // nothing makes up for it: all its bounces are missing, too
      }
    }
  }
  return levels;
}

/// What shooters leave to each leaf.
RADIOSITY_CLONES void LeafGather::takeSources(std::size_t h, std::span<SourceSum> sums) noexcept {
  auto& sources = halves_[h].source;  // all 0
  for (const auto& leaf : light_.passing) {
    const double area = areaOf(leaf.to), sends = 1.0 - lostOf(h, leaf.to).all() - atGlass(h, leaf.to);
    const auto mirrored = mirroredAt(h, leaf.to);
    const auto over_links = lightOf(light_.irradiance[h][leaf.from]), part = lightOf(leaf.transmittance);
    auto& sum = sums[part_[sights_.sideOf(leaf.to)]];
    for (std::size_t c = 0; c < 3; ++c) {
      sources[leaf.to][c] = part[c] * over_links[c];
      sum.takes[c] -= area * (sends + mirrored[c]) * part[c];
    }
  }
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    SourceSum sum;
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const double area = areaOf(v);
      if (area <= 0.0) continue;
      const auto emission = lightOf(light_.emission[v]), reflectance = lightOf(light_.reflectance[v]);
      const auto over_links = lightOf(light_.irradiance[h][v]), shot = lightOf(light_.shot[h][v]);
      const auto lost = lostOf(h, v);
      const auto sky = skyAt(h, v, lost);
      const double sends = 1.0 - lost.all() - atGlass(h, v), taken = this->taken(v);
      const auto mirrored = mirroredAt(h, v), in_mirrors = inMirrorsAt(h, v);
      auto& source = halves_[h].source[v];
      for (std::size_t c = 0; c < 4; ++c) {
        source[c] += emission[c] + reflectance[c] * over_links[c] - shot[c];
        sum.shining[c] += area * (std::abs(source[c]) + taken * sky[c] + std::abs(in_mirrors[c]));
        sum.arrives[c] += area * ((sends + mirrored[c]) * source[c] + taken * sky[c] + in_mirrors[c]);
        sum.takes[c] += area * (taken - (sends + mirrored[c]) * reflectance[c]);
      }
      sum.area += area;
    }
    auto& of_part = sums[part_[s]];
    addTo(of_part.shining, sum.shining);
    addTo(of_part.arrives, sum.arrives);
    addTo(of_part.takes, sum.takes);
    of_part.area += sum.area;
  }
}

/// Whether a ray ends where there is light, or may be, or passes such.
bool LeafGather::endsInLight(std::size_t half, std::uint32_t end, const std::vector<bool>& lit) const {
  const auto steps = sights_.steps(half);
  for (; end >= sights_.endCount(); end = steps[end - sights_.endCount()].next) {
    const auto& step = steps[end - sights_.endCount()];
    if (!PaneStep::is(step.by) && lit[sights_.sideOf(LeafSights::leafOf(step))]) return true;
  }
  if (end < sights_.leafCount()) return lit[sights_.sideOf(end)];
  return !sights_.isAbsorbed(end) && halves_[half].source[end] != Light{};
}

/// By side: light may come there, from bounce to bounce. Of sides with light of their own nothing is asked, so that it
/// costs nothing but in the dark.
std::vector<bool> LeafGather::litSides(std::size_t half) const {
  std::vector<bool> lit(sides_.size(), false);
  const auto anyLeaf = [&](std::uint32_t s, const auto& is_it) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v)
      if (is_it(v)) return true;
    return false;
  };
  const auto hasOwn = [&](std::uint32_t v) { return halves_[half].source[v] != Light{} || shotOf(half, v) != Light{}; };
  const auto seesLight = [&](std::uint32_t v) {
    for (const auto end : sights_.seen(half, v))
      if (endsInLight(half, end, lit)) return true;
    return false;
  };
  for (std::uint32_t s = 0; s < sides_.size(); ++s) lit[s] = anyLeaf(s, hasOwn);
  constexpr int kMostRounds = 16;  // it may be farther to the last of them: all are then
  bool spreads = true;
  for (int round = 0; round < kMostRounds && spreads; ++round) {
    spreads = false;
    for (std::uint32_t s = 0; s < sides_.size(); ++s) {
      if (lit[s]) continue;
      const bool shines_through = !passingTo(light_.passing, sides_[s]).empty() && lit[sides_[s].other];
      lit[s] = shines_through || anyLeaf(s, seesLight);
      spreads = spreads || lit[s];
    }
  }
  if (spreads) lit.assign(sides_.size(), true);
  return lit;
}

/// If all leaves of a part of the scene had the same light: what they take of it, and lose, is what shines there. That
/// is most of what is solved for, and the sweeps that would find it last. Where no light comes there is none to begin
/// with, and so there stays none.
Gmres<float>::Vectors LeafGather::evenLight(std::size_t half, const std::vector<SourceSum>& sums) const {
  RayGmres::Vectors light;
  const auto lit = litSides(half);
  for (std::size_t c = 0; c < 3; ++c) {
    light[c].resize(sights_.leafCount());
    for (std::uint32_t s = 0; s < sides_.size(); ++s) {
      const auto& sum = sums[part_[s]];
      const auto level = sum.takes[c] > 0.0 ? static_cast<float>(sum.arrives[c] / sum.takes[c]) : 0.0F;
      for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v)
        light[c][v] = lit[s] && area_[v] > 0.0F ? level : 0.0F;
    }
  }
  return light;
}

void LeafGather::LevelSum::add(const LevelSum& other) {
  for (std::size_t c = 0; c < 4; ++c) {
    left[c] += other.left[c];
    kept[c] += other.kept[c];
    size[c] += other.size[c];
    all[c] += other.all[c];
    stays[c] += other.stays[c];
    least[c] = std::min(least[c], other.least[c]);
  }
  area += other.area;
}

/// By part of the scene.
RADIOSITY_CLONES void LeafGather::addLevels(std::size_t h, std::span<LevelSum> sums) const noexcept {
  for (const auto& leaf : light_.passing) {
    const double area = areaOf(leaf.to);
    const auto x = solved(h, leaf.from), over_links = lightOf(light_.irradiance[h][leaf.from]);
    const auto& loss = lossOf(h, leaf.to);
    const auto mirrored = mirroredAt(h, leaf.to);
    const double lost = lostOf(h, leaf.to).all(), at_glass = atGlass(h, leaf.to);
    auto& sum = sums[part_[sights_.sideOf(leaf.to)]];
    for (std::size_t c = 0; c < 3; ++c) {
      const double sends = 1.0 - loss[c] * lost - at_glass + mirrored[c];
      const double goes = area * sends * static_cast<double>(leaf.transmittance[static_cast<int>(c)]);
      sum.kept[c] -= goes * x[c];
      sum.size[c] -= goes * std::abs(x[c]);
      sum.all[c] -= goes * (x[c] + over_links[c]);
      sum.stays[c] -= goes;
    }
  }
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    LevelSum sum;
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const double area = areaOf(v);
      if (area <= 0.0) continue;
      const auto x = solved(h, v), reflectance = lightOf(light_.reflectance[v]);
      const auto over_links = lightOf(light_.irradiance[h][v]);
      const auto& source = halves_[h].source[v];
      const auto lost = lostOf(h, v);
      const auto sky = skyAt(h, v, lost);
      const auto& loss = lossOf(h, v);
      const auto mirrored = mirroredAt(h, v), in_mirrors = inMirrorsAt(h, v);
      const double at_glass = atGlass(h, v), taken = this->taken(v);
      for (std::size_t c = 0; c < 4; ++c) {
        const double sends = 1.0 - loss[c] * lost.all() - at_glass + mirrored[c];
        const double stays = area * (taken - sends * reflectance[c]);
        sum.left[c] += area * (sends * source[c] + taken * sky[c] + in_mirrors[c]);
        sum.kept[c] += stays * x[c];
        sum.size[c] += stays * std::abs(x[c]);
        sum.all[c] += stays * (x[c] + over_links[c]);
        sum.stays[c] += stays;
      }
      sum.area += area;
      for (std::size_t c = 0; c < 3; ++c)
        if (x[c] < 0.0) sum.least[c] = std::min(sum.least[c], x[c] / over_links[c]);
    }
    sums[part_[s]].add(sum);
  }
}

/// As `levels` have it.
RADIOSITY_CLONES void LeafGather::take(std::size_t h, const Levels& levels) noexcept {
  auto& gathered = gathered_[h];
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    Light of_gathered{}, of_links{};
    for (std::size_t c = 0; c < 3; ++c) {
      of_gathered[c] = levels[part_[s]][c].gathered;
      of_links[c] = levels[part_[s]][c].over_links;
    }
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const auto x = solved(h, v), over_links = lightOf(light_.irradiance[h][v]);
      const auto reflectance = lightOf(light_.reflectance[v]);
      Light32 arrives{};
      for (std::size_t c = 0; c < 4; ++c) {
        const double light = of_gathered[c] * x[c] + of_links[c] * over_links[c];
        arrives[c] = static_cast<float>(light);
        halves_[h].radiosity[v][c] = static_cast<float>(halves_[h].source[v][c] + reflectance[c] * light);
      }
      gathered[v] = glm::vec3(arrives[0], arrives[1], arrives[2]);
    }
  }
  for (const auto& leaf : light_.passing) {
    const auto passed = leaf.of(gathered);
    for (std::size_t c = 0; c < 3; ++c) halves_[h].radiosity[leaf.to][c] += passed[static_cast<int>(c)];
  }
}

/// What is small, and shines, neither half may have seen: its light is sent and does not arrive, in both alike, and the
/// level gives it to others. Nobody knows where it belongs, so that all leaves of the part of the scene lack the same.
void LeafGather::weighMissed(const std::array<Levels, 2>& levels) {
  std::vector<double> area(sides_.size(), 0.0), square(sides_.size(), 0.0);
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v)
      area[part_[s]] += areaOf(v);
  }
  for (std::size_t p = 0; p < sides_.size(); ++p) {
    for (std::size_t c = 0; c < 3 && area[p] > 0.0; ++c) {
      const double a = levels[0][p][c].missed, b = levels[1][p][c].missed;
      const double both = 0.5 * (a + b), chance = kByChance * 0.5 * (a - b);
      square[p] += std::max(0.0, both * both - chance * chance) / area[p];
    }
  }
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      if (areaOf(v) <= 0.0) continue;
      const double part = square[part_[s]] * areaOf(v) / area[part_[s]];
      block_noise_[v / kBlock] += part;
      noise_ += part;
      bias_ += part;
      leaf_bias_[v] += static_cast<float>(part / areaOf(v));
    }
  }
}

/// A ray is drawn as light leaves, too: what part of a leaf's rays leave the scene, or end on unlit sides, that part of
/// its light does.
void LeafGather::weighLost() {
  escaped_ = absorbed_ = from_sky_ = {};
  for (std::size_t half = 0; half < 2; ++half) {
    for (std::uint32_t v = 0; v < sights_.leafCount(); ++v) {
      const auto lost = lostOf(half, v);
      if (lost.all() <= 0.0 && halves_[half].sky.empty()) continue;
      const auto& loss = lossOf(half, v);
      const auto sky = skyAt(half, v, lost);
      for (std::size_t c = 0; c < 3; ++c) {
        const double flux = 0.5 * areaOf(v) * static_cast<double>(halves_[half].radiosity[v][c]) * loss[c];
        escaped_[c] += flux * lost.escaped();
        absorbed_[c] += flux * static_cast<double>(lost.absorbed);
        from_sky_[c] += 0.5 * areaOf(v) * sky[c];
      }
    }
  }
}

}  // namespace radiosity::solver
