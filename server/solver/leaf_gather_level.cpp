// The level of reflected light: what is sent and does not leave the scene arrives. Rays know each exchange between two
// leaves badly, and this very well.
#include <algorithm>
#include <cmath>

#include "server/solver/leaf_gather.h"

namespace radiosity::solver {
namespace {

/// By more than this the level of all light is not changed: rays that know it this badly are few.
constexpr double kMostLevel = 4.0, kMostOff = 0.5;
/// Light that both halves lack by more than so many times what they differ by is not lacking by chance.
constexpr double kByChance = 2.0;
}  // namespace

/// x, but for what few rays find too much missing of: with what came over links no leaf gets less than no light.
double LeafGather::solved(std::size_t h, std::size_t c, std::size_t v) const {
  return std::max(solved_[h][v][c], -static_cast<double>(light_.irradiance[h][v][static_cast<int>(c)]));
}

/// What comes straight from the sky, by rays as they are.
double LeafGather::skyAt(std::size_t h, std::size_t c, std::size_t v) const {
  const auto i = static_cast<int>(c);
  const auto lost = lostOf(h, v);
  return static_cast<double>(lost.above) * light_.sky[0][i] + static_cast<double>(lost.below) * light_.sky[1][i];
}

/// Of what ends on leaves that are parted, of the light in radiosity: by part of the scene and channel, and all of it.
std::vector<std::array<double, 3>> LeafGather::broughtByParted(std::size_t h, std::array<double, 3>& all) const {
  const auto& radiosity = halves_[h].radiosity;
  const auto counts = sights_.counts();
  std::vector<std::array<double, 3>> brought(sides_.size());
  all = {};
  for (std::uint32_t s = 0; s < sides_.size() && has_parted_; ++s) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      Light sum{};
      for (const auto end : sights_.seen(h, v)) {
        if (!sights_.endsOnParted(end)) continue;
        for (std::size_t c = 0; c < 3; ++c) sum[c] += radiosity[end][c];
      }
      for (std::size_t c = 0; c < 3 && counts[v] > 0; ++c) {
        brought[part_[s]][c] += area_[v] * sum[c] / counts[v];
        all[c] += area_[v] * sum[c] / counts[v];
      }
    }
  }
  return brought;
}

/// By part of the scene and channel: what makes
/// sum a x = sum a (h (r + rho x) + s), h being the part of a leaf's light that other leaves get and s what comes from
/// the sky: x times a factor. Of a leaf that is parted the part that rays lose may be a dark one, under a floor that it
/// reaches through, which sends nothing: of what such leaves send only that is known which arrives. Where x is as much
/// below nothing as above it, as where shooters have sent the mean of what is there and its pattern is left, that says
/// nothing; all light of the part, with what came over links, makes up for what little is off then.
LeafGather::Levels LeafGather::levels(std::size_t h) {
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

/// By part of the scene and channel.
std::vector<std::array<LeafGather::LevelSum, 3>> LeafGather::levelSums(std::size_t h) {
  std::vector<std::array<LevelSum, 3>> sums(sides_.size());
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    auto& sum = sums[part_[s]];
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const auto lost = lostOf(h, v);
      const double sends = sights_.isParted(v) ? 0.0 : 1.0 - lost.escaped() - static_cast<double>(lost.absorbed);
      for (std::size_t c = 0; c < 3 && area_[v] > 0.0; ++c) {
        const auto i = static_cast<int>(c);
        const double x = solved(h, c, v), over_links = static_cast<double>(light_.irradiance[h][v][i]);
        const double stays = 1.0 - sends * static_cast<double>(light_.reflectance[v][i]);
        sum[c].left += area_[v] * (sends * halves_[h].source[v][c] + skyAt(h, c, v));
        sum[c].kept += area_[v] * stays * x;
        sum[c].size += area_[v] * stays * std::abs(x);
        sum[c].all += area_[v] * stays * (x + over_links);
        sum[c].area += area_[v];
        sum[c].stays += area_[v] * stays;
        if (x < 0.0) sum[c].least = std::min(sum[c].least, x / over_links);
      }
    }
  }
  if (has_parted_) addParted(h, sums);
  return sums;
}

/// What parted leaves send, by what is left by shooters and by x, each by itself.
void LeafGather::addParted(std::size_t h, std::vector<std::array<LevelSum, 3>>& sums) {
  auto& half = halves_[h];
  std::array<double, 3> all{};
  const auto brought = [&](bool by_source) {
    std::ranges::fill(half.radiosity, Light{});
    if (by_source) std::ranges::copy(half.source, half.radiosity.begin());
    for (std::uint32_t v = 0; v < sights_.leafCount() && !by_source; ++v) {
      for (std::size_t c = 0; c < 3; ++c)
        half.radiosity[v][c] = static_cast<double>(light_.reflectance[v][static_cast<int>(c)]) * solved(h, c, v);
    }
    followSteps(h, by_source ? &half.source : nullptr, half.radiosity);
    return broughtByParted(h, all);
  };
  const auto by_source = brought(true), by_x = brought(false);
  for (std::size_t p = 0; p < sums.size(); ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      auto& sum = sums[p][c];
      sum.left += by_source[p][c];
      for (auto* of : {&sum.kept, &sum.size, &sum.all}) *of -= by_x[p][c];
    }
  }
}

/// What is small, and shines, neither half may have seen: its light is sent and does not arrive, in both alike, and the
/// level gives it to others. Nobody knows where it belongs, so that all leaves of the part of the scene lack the same.
void LeafGather::weighMissed(const std::array<Levels, 2>& levels) {
  std::vector<double> area(sides_.size(), 0.0), square(sides_.size(), 0.0);
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v)
      area[part_[s]] += area_[v];
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
      if (area_[v] <= 0.0) continue;
      const double part = square[part_[s]] * area_[v] / area[part_[s]];
      block_noise_[v / kBlock] += part;
      noise_ += part;
      bias_ += part;
      leaf_bias_[v] += static_cast<float>(part / area_[v]);
    }
  }
}

/// A ray is drawn as light leaves, too: what part of a leaf's rays leave the scene, or end on unlit sides, that part of
/// its light does. Of leaves that are parted it is what they send and nobody gets.
void LeafGather::weighLost() {
  escaped_ = absorbed_ = from_sky_ = {};
  for (std::size_t half = 0; half < 2; ++half) {
    std::array<double, 3> escaped{}, absorbed{}, sent{}, arrives{};  // of parted leaves
    auto& radiosity = halves_[half].radiosity;
    if (has_parted_) {
      followSteps(half, &halves_[half].source, radiosity);
      (void)broughtByParted(half, arrives);
    }
    for (std::uint32_t v = 0; v < sights_.leafCount(); ++v) {
      const auto lost = lostOf(half, v);
      const bool is_parted = sights_.isParted(v);
      for (std::size_t c = 0; c < 3; ++c) {
        const double flux = 0.5 * area_[v] * radiosity[v][c];
        (is_parted ? escaped : escaped_)[c] += flux * lost.escaped();
        (is_parted ? absorbed : absorbed_)[c] += flux * static_cast<double>(lost.absorbed);
        if (is_parted) sent[c] += flux;
        from_sky_[c] += 0.5 * area_[v] * skyAt(half, c, v);
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const double all = escaped[c] + absorbed[c], lost = std::max(0.0, sent[c] - 0.5 * arrives[c]);
      if (all <= 0.0) continue;
      escaped_[c] += lost * escaped[c] / all;
      absorbed_[c] += lost * absorbed[c] / all;
    }
  }
}

}  // namespace radiosity::solver
