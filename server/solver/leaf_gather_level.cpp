// The level of reflected light: what is sent and does not leave the scene arrives. Rays know each exchange between two
// leaves badly, and this very well.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/give_back.h"
#include "server/solver/halves.h"
#include "server/solver/leaf_gather.h"

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

}  // namespace

/// How much of their light leaves lose, and which sides are of one part.
void LeafGather::weighRays() {
  has_parted_ = false;
  from_parted_ = {};
  for (std::uint32_t v = 0; v < sights_.leafCount() && !has_parted_; ++v)
    has_parted_ = areaOf(v) > 0.0 && sights_.isParted(v);
  // Sides that see each other, if over others, are of one part, which has the number of the first of them.
  std::array<UnionFind, 2> parts{UnionFind(sides_.size()), UnionFind(sides_.size())};
  inBothHalves([&](std::size_t half) { weighRays(half, parts[half]); });
  part_.resize(sides_.size());
  for (std::uint32_t s = 0; s < sides_.size(); ++s) parts[0].join(s, parts[1].find(s));
  for (std::uint32_t s = 0; s < sides_.size(); ++s) part_[s] = parts[0].find(s);
}

void LeafGather::weighRays(std::size_t half, UnionFind& parts) {
  lost_[half] = LostRays(sights_.leafCount());
  const auto steps = sights_.steps(half);
  std::vector<std::uint32_t> joined(sides_.size(), scene::kNone);  // by side: the last that it was joined to
  std::size_t first = 0;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count;
         first += sights_.counts()[v++]) {
      LostRays::Counts lost;
      for (const auto end : sights_.ends(half, first, sights_.counts()[v])) {
        if (end == sights_.skyAbove()) ++lost.above;
        if (end == sights_.skyBelow()) ++lost.below;
        if (sights_.isAbsorbed(end)) ++lost.absorbed;
        if (sights_.isDoubtful(half, end)) ++lost.doubtful;
        if (end >= sights_.leafCount() && end < sights_.endCount()) continue;
        const auto seen = sights_.sideOf(end < sights_.endCount() ? end : steps[end - sights_.endCount()].by);
        if (std::exchange(joined[seen], s) != s) parts.join(s, seen);
        if (end >= sights_.endCount()) joinSteps(half, end, parts);
      }
      lost_[half].add(v, lost);
    }
  }
  if (lost_[half].isNothing()) lost_[half] = {};  // of a closed room
}

/// Where a ray goes on, and on.
void LeafGather::joinSteps(std::size_t half, std::uint32_t end, UnionFind& parts) const {
  const auto steps = sights_.steps(half);
  while (end >= sights_.endCount()) {
    const auto& step = steps[end - sights_.endCount()];
    end = step.next;
    const auto next = end < sights_.endCount() ? end : steps[end - sights_.endCount()].by;
    if (next < sights_.leafCount()) parts.join(sights_.sideOf(step.by), sights_.sideOf(next));
  }
}

/// x, but for what few rays find too much missing of: with what came over links no leaf gets less than no light.
double LeafGather::solved(std::size_t h, std::size_t c, std::size_t v) const {
  return static_cast<double>(std::max(solved_[h][c][v], -light_.irradiance[h][v][static_cast<int>(c)]));
}

/// What comes straight from the sky, by rays as they are.
double LeafGather::skyAt(const Lost& lost, std::size_t c) const {
  const auto i = static_cast<int>(c);
  return static_cast<double>(lost.above) * light_.sky[0][i] + static_cast<double>(lost.below) * light_.sky[1][i];
}

/// Of a leaf that is parted rays may be lost in a dark strip of it, under a floor that it reaches through, which sends
/// nothing. By part of the scene and channel: how much of its light such leaves lose, of what they would lose if they
/// shone evenly: none of it, or several times as much where the other part is dark. They send, and where rays of others
/// end on them that much arrives; the rest is lost.
void LeafGather::weighPartedLoss(std::size_t h) {
  struct Flux {
    double sent = 0.0, even = 0.0, arrives = 0.0;  // `even`: lost by leaves that shine evenly
  };
  parted_loss_[h].assign(sides_.size(), {1.0, 1.0, 1.0});
  const auto leaves = sights_.leafCount();
  const auto steps = sights_.steps(h);
  std::vector<std::uint8_t> loses(sights_.endCount() + steps.size(), 0);  // by end of a ray
  for (std::uint32_t v = 0; v < leaves; ++v) loses[v] = losesApart(h, v) ? 1 : 0;
  if (std::ranges::count(loses, 1) == 0) return;
  for (std::size_t i = 0; i < steps.size(); ++i) loses[sights_.endCount() + i] = loses[steps[i].by];
  auto& radiosity = halves_[h].radiosity;
  std::vector<std::array<Flux, 3>> fluxes(sides_.size());
  for (std::uint32_t v = 0; v < leaves; ++v) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double sent =
          halves_[h].source[v][c] + static_cast<double>(light_.reflectance[v][static_cast<int>(c)]) * solved(h, c, v);
      radiosity[v][c] = static_cast<float>(sent);
      if (loses[v] == 0) continue;
      auto& flux = fluxes[part_[sights_.sideOf(v)]][c];
      flux.sent += areaOf(v) * sent;
      flux.even += areaOf(v) * sent * lostOf(h, v).all();
    }
  }
  for (auto end = leaves; end < sights_.endCount(); ++end) {
    for (std::size_t c = 0; c < 3; ++c) radiosity[end][c] = static_cast<float>(halves_[h].source[end][c]);
  }
  followSteps(h, &halves_[h].source);
  const auto arrive = [&](const Arrival& ray) {
    const auto by = ray.end < sights_.endCount() ? ray.end : steps[ray.end - sights_.endCount()].by;
    const double share = areaOf(ray.value) / sights_.counts()[ray.value];
    for (std::size_t c = 0; c < 3; ++c)
      fluxes[part_[sights_.sideOf(by)]][c].arrives += share * static_cast<double>(radiosity[ray.end][c]);
  };
  if (from_parted_[h]) {
    std::ranges::for_each(*from_parted_[h], arrive);
  } else {
    std::vector<Arrival> found;
    const std::size_t most = leaves / kLeavesAnArrival;
    for (std::uint32_t v = 0; v < leaves; ++v) {
      for (const auto end : sights_.seen(h, v)) {
        if (loses[end] == 0) continue;
        arrive({v, end});
        if (found.size() <= most) found.push_back({v, end});
      }
    }
    if (found.size() <= most) from_parted_[h] = std::move(found);
  }
  for (std::size_t p = 0; p < fluxes.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& flux = fluxes[p][c];
      if (flux.even > 0.0) parted_loss_[h][p][c] = std::clamp((flux.sent - flux.arrives) / flux.even, 0.0, kMostLoss);
    }
  }
}

/// Part of a leaf's light that is lost, of what rays of it are; by channel.
const std::array<double, 3>& LeafGather::lossOf(std::size_t h, std::uint32_t v) const {
  static constexpr std::array<double, 3> kAsRays{1.0, 1.0, 1.0};
  return losesApart(h, v) ? parted_loss_[h][part_[sights_.sideOf(v)]] : kAsRays;
}

/// By part of the scene and channel: what makes
/// sum a x = sum a (h (r + rho x) + s), h being the part of a leaf's light that other leaves get and s what comes from
/// the sky: x times a factor. Where x is as much below nothing as above it, as where shooters have sent the mean of
/// what is there and its pattern is left, that says nothing; all light of the part, with what came over links, makes up
/// for what little is off then.
LeafGather::Levels LeafGather::levels(std::size_t h) {
  if (has_parted_) weighPartedLoss(h);
  const auto sums = levelSums(h);
  Levels levels(sides_.size());
  for (std::size_t p = 0; p < sums.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& sum = sums[p][c];
      const double level = sum.left / sum.kept, part = (sum.left - sum.kept) / sum.all;
      levels[p][c].missed = sum.left - sum.kept;
      if (2.0 * sum.kept > sum.size && level * sum.least >= -1.0 && level > 1.0 / kMostLevel && level < kMostLevel) {
        levels[p][c].gathered = level;
      } else if (sum.all > 0.0 && std::abs(part) < kMostOff) {
        levels[p][c].gathered = 1.0 + part;
        levels[p][c].over_links = part;
      } else if (sum.stays > 0.0) {
        levels[p][c].missed *= sum.area / sum.stays;  // nothing makes up for it: all its bounces are missing, too
      }
    }
  }
  return levels;
}

/// If all leaves of a part of the scene had the same light: what they take of it, and lose, is what shines there. That
/// is most of what is solved for, and the sweeps that would find it last.
Gmres<float>::Vectors LeafGather::evenLight(std::size_t h) const {
  struct Sum {
    double shines = 0.0, takes = 0.0;
  };
  std::vector<std::array<Sum, 3>> sums(sides_.size());
  RayGmres::Vectors light;
  for (auto& channel : light) channel.assign(sights_.leafCount(), 0.0F);
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    auto& sum = sums[part_[s]];
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const auto lost = lostOf(h, v);
      const double area = areaOf(v), sends = 1.0 - lost.all();
      for (std::size_t c = 0; c < 3; ++c) {
        sum[c].shines += area * (sends * halves_[h].source[v][c] + skyAt(lost, c));
        sum[c].takes += area * (1.0 - sends * static_cast<double>(light_.reflectance[v][static_cast<int>(c)]));
      }
    }
  }
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& sum = sums[part_[s]][c];
      const auto level = sum.takes > 0.0 ? static_cast<float>(sum.shines / sum.takes) : 0.0F;
      for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v)
        light[c][v] = area_[v] > 0.0F ? level : 0.0F;
    }
  }
  return light;
}

/// By part of the scene and channel.
std::vector<std::array<LeafGather::LevelSum, 3>> LeafGather::levelSums(std::size_t h) {
  std::vector<std::array<LevelSum, 3>> sums(sides_.size());
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    auto& sum = sums[part_[s]];
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const double area = areaOf(v);
      if (area <= 0.0) continue;
      const auto lost = lostOf(h, v);
      const auto& loss = lossOf(h, v);
      for (std::size_t c = 0; c < 3; ++c) {
        const auto i = static_cast<int>(c);
        const double x = solved(h, c, v), over_links = static_cast<double>(light_.irradiance[h][v][i]);
        const double sends = 1.0 - loss[c] * lost.all();
        const double stays = 1.0 - sends * static_cast<double>(light_.reflectance[v][i]);
        sum[c].left += area * (sends * halves_[h].source[v][c] + skyAt(lost, c));
        sum[c].kept += area * stays * x;
        sum[c].size += area * stays * std::abs(x);
        sum[c].all += area * stays * (x + over_links);
        sum[c].area += area;
        sum[c].stays += area * stays;
        if (x < 0.0) sum[c].least = std::min(sum[c].least, x / over_links);
      }
    }
  }
  return sums;
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
      if (lost.all() <= 0.0) continue;
      const auto& loss = lossOf(half, v);
      for (std::size_t c = 0; c < 3; ++c) {
        const double flux = 0.5 * areaOf(v) * static_cast<double>(halves_[half].radiosity[v][c]) * loss[c];
        escaped_[c] += flux * lost.escaped();
        absorbed_[c] += flux * static_cast<double>(lost.absorbed);
        from_sky_[c] += 0.5 * areaOf(v) * skyAt(lost, c);
      }
    }
  }
}

}  // namespace radiosity::solver
