#include "server/solver/leaf_smoother.h"

#include <algorithm>
#include <numeric>

#include "common/clones.h"
#include "common/give_back.h"
#include "common/parallel.h"

namespace radiosity::solver {
namespace {

using Light = LeafSmoother::Light;

/// Sides of fewer leaves across than this have no others to speak of than those at their edges.
constexpr std::uint32_t kNarrow = 12;
/// How far a leaf goes is told by what it and those so near to it would gain. Of fewer what is gained is chance, which
/// the error that is stated does not know: with 2 the truth was 1.34 times as much in two rooms, with 6 it is 1.2
/// times.
constexpr std::uint32_t kAround = 6;

double dot(const Light& a, const Light& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Light less(const Light& a, const Light& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2], 0.0}; }

void move(Light& from, const Light& to, double part) {
  for (std::size_t c = 0; c < 3; ++c) from[c] += part * (to[c] - from[c]);
}

/// The error of a step of length w towards the mean is a + 2 b w + c w^2.
struct Gain {
  double slope = 0.0, bend = 0.0;
  std::uint32_t leaves = 1;
};

/// Sums over all leaves before (x, y), for sums over rectangles (Crow 1984, "Summed-area tables").
class GainTable {
 public:
  GainTable(const Side& side, std::span<const Gain> gains)
      : width_(side.width + 1), height_(side.height + 1), sums_(std::size_t{width_} * height_) {
    for (std::uint32_t y = 1; y < height_; ++y) {
      Gain row;
      for (std::uint32_t x = 1; x < width_; ++x) {
        const auto& gain = gains[(y - 1) * side.width + x - 1];
        row = {row.slope + gain.slope, row.bend + gain.bend, 1};
        const auto& above = sums_[(y - 1) * width_ + x];
        sums_[y * width_ + x] = {above.slope + row.slope, above.bend + row.bend, 1};
      }
    }
  }

  /// Of a square of leaves around (x, y), and how many these are.
  [[nodiscard]] Gain around(std::uint32_t x, std::uint32_t y) const {
    const auto x0 = x - std::min(x, kAround), x1 = std::min(x + kAround + 1, width_ - 1);
    const auto y0 = y - std::min(y, kAround), y1 = std::min(y + kAround + 1, height_ - 1);
    const auto &a = sums_[y0 * width_ + x0], &b = sums_[y0 * width_ + x1];
    const auto &c = sums_[y1 * width_ + x0], &d = sums_[y1 * width_ + x1];
    return {d.slope - b.slope - c.slope + a.slope, d.bend - b.bend - c.bend + a.bend, (x1 - x0) * (y1 - y0)};
  }

 private:
  std::uint32_t width_, height_;
  std::vector<Gain> sums_;
};

/// Times area, which comes last.
RADIOSITY_CLONES void timesArea(std::size_t count, const float* area, const Light* from, Light* weighted) {
  for (std::size_t i = 0; i < count; ++i) {
    const auto a = static_cast<double>(area[i]);
    for (std::size_t c = 0; c < 3; ++c) weighted[i][c] = a * from[i][c];
    weighted[i][3] = a;
  }
}

/// Three rows of leaves times area.
struct Rows {
  const Light *here, *below, *above;
};

/// Leaves of a row that have others on all sides: those of the rows, so far apart. The same sums in the same order as
/// of others, a leaf at a time in one vector.
RADIOSITY_CLONES void averageWithin(const Rows& rows, std::size_t step, std::size_t first, std::size_t end,
                                    Light* __restrict means) {
  for (auto x = first; x < end; ++x) {
    Light sum;
    for (std::size_t c = 0; c < 4; ++c) {
      double all = 4.0 * rows.here[x][c];
      all += 2.0 * rows.here[x - step][c];
      all += 2.0 * rows.here[x + step][c];
      all += 2.0 * rows.below[x][c];
      all += rows.below[x - step][c];
      all += rows.below[x + step][c];
      all += 2.0 * rows.above[x][c];
      all += rows.above[x - step][c];
      all += rows.above[x + step][c];
      sum[c] = all;
    }
    if (!(sum[3] > 0.0)) continue;
    for (std::size_t c = 0; c < 4; ++c) means[x][c] = sum[c] / sum[3];
  }
}

}  // namespace

/// Pairs on both sides first, whose mean is that of the leaf wherever light changes evenly, as it does towards a wall
/// that stands at the edge of this one: means over one side made the outermost row of a ceiling 5 % too bright. At the
/// ends of what is narrow that leaves little to average, so there others follow, as far as they lower the error.
const std::array<LeafSmoother::Pass, 5> LeafSmoother::kPasses{Pass{0, false}, Pass{1, false}, Pass{2, false},
                                                              Pass{0, true}, Pass{1, true}};

bool LeafSmoother::Pass::takesEnds(std::uint32_t size) const { return one_sided && size <= kNarrow && size > step(); }

/// False: there are none to average.
bool LeafSmoother::isFor(const Pass& pass, const Side& side) {
  if (pass.one_sided) return pass.takesEnds(side.width) || pass.takesEnds(side.height);
  return std::max(side.width, side.height) > 2 * pass.step();
}

LeafSmoother::LeafSmoother(const std::vector<Side>& sides, std::span<const float> area,
                           const std::function<bool(std::uint32_t)>& is_parted)
    : sides_(sides), area_(area), is_parted_(area.size(), false), beside_(sides.size()) {
  for (std::size_t s = 0; s < sides.size() && is_parted; ++s) findParted(s, is_parted);
}

void LeafSmoother::findParted(std::size_t s, const std::function<bool(std::uint32_t)>& is_parted) {
  constexpr std::uint32_t kReach = kSteps.back();
  const auto& side = sides_[s];
  std::vector<bool> beside;
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    if (areaOf(side.first_value + leaf) <= 0.0 || !is_parted(side.first_value + leaf)) continue;
    is_parted_[side.first_value + leaf] = true;
    beside.resize(side.leaf_count);
    const auto x = leaf % side.width, y = leaf / side.width;
    for (auto ny = y - std::min(y, kReach); ny < std::min(y + kReach + 1, side.height); ++ny)
      for (auto nx = x - std::min(x, kReach); nx < std::min(x + kReach + 1, side.width); ++nx)
        beside[ny * side.width + nx] = true;
  }
  for (std::uint32_t leaf = 0; leaf < beside.size(); ++leaf)
    if (beside[leaf]) beside_[s].push_back({leaf, {}});
  beside_[s].shrink_to_fit();
  for (auto& one : beside_[s])
    for (std::size_t k = 0; k < kSteps.size(); ++k) one.open[k] = openWays(side, one.leaf, kSteps[k]);
}

/// Nothing stands between the leaf and where these bits say, nor on either.
std::uint16_t LeafSmoother::openWays(const Side& side, std::uint32_t leaf, std::uint32_t step) const {
  const std::int64_t x = leaf % side.width, y = leaf / side.width, apart = step;
  const auto isOpen = [&](std::int64_t dx, std::int64_t dy) {
    for (std::int64_t k = 0; k <= apart; ++k) {
      const auto to_x = x + k * dx, to_y = y + k * dy;
      if (to_x < 0 || to_y < 0 || to_x >= std::int64_t{side.width} || to_y >= std::int64_t{side.height}) return false;
      const auto there = static_cast<std::uint32_t>(to_y) * side.width + static_cast<std::uint32_t>(to_x);
      if (is_parted_[side.first_value + there]) return false;
    }
    return true;
  };
  std::uint32_t open = 0;
  for (std::uint32_t way = 0; way < 9; ++way)
    if (isOpen(std::int64_t{way % 3} - 1, std::int64_t{way / 3} - 1)) open |= 1U << way;
  return static_cast<std::uint16_t>(open);
}

/// As average(), of one leaf and of those between which and it nothing stands.
LeafSmoother::Light LeafSmoother::averageApart(const Side& side, const Beside& beside, const Pass& pass,
                                               std::span<const Light> from) const {
  Light mean = from[beside.leaf], sum{};
  const auto open = beside.open[pass.step_index];
  const auto isOpen = [&](std::size_t way) { return ((open >> way) & 1U) != 0; };
  double all = 0.0;
  for (std::size_t way = 0; way < 9; ++way) {
    if (!isOpen(way) || (!pass.one_sided && !isOpen(8 - way))) continue;
    const std::ptrdiff_t dx = static_cast<std::ptrdiff_t>(way % 3) - 1, dy = static_cast<std::ptrdiff_t>(way / 3) - 1;
    const std::ptrdiff_t apart = pass.step(), width = side.width;
    const auto there = static_cast<std::size_t>(std::ptrdiff_t{beside.leaf} + apart * (dy * width + dx));
    const double weight = (dx == 0 ? 2.0 : 1.0) * (dy == 0 ? 2.0 : 1.0) * areaOf(side.first_value + there);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * from[there][c];
    all += weight;
  }
  for (std::size_t c = 0; c < 3 && all > 0.0; ++c) mean[c] = sum[c] / all;
  return mean;
}

/// Binomial, of the leaves there are.
void LeafSmoother::average(const Side& side, const Pass& pass, std::span<const Light> from,
                           std::span<Light> means) const {
  const auto step = pass.step();
  const auto near = [&](std::uint32_t at, std::uint32_t size, auto take) {
    take(at, 2.0);
    const bool below = at >= step, above = at + step < size;
    if (below != above && !pass.takesEnds(size)) return;
    if (below) take(at - step, 1.0);
    if (above) take(at + step, 1.0);
  };
  const auto isInside = [&](std::uint32_t at, std::uint32_t size) { return at >= step && at + step < size; };
  std::copy(from.begin(), from.end(), means.begin());
  std::vector<Light> weighted;
  if (!pass.one_sided && side.width > 2 * step && side.height > 2 * step) {
    weighted.resize(side.leaf_count);
    timesArea(side.leaf_count, &area_[side.first_value], from.data(), weighted.data());
  }
  for (std::uint32_t y = 0; y < side.height; ++y) {
    if (!weighted.empty() && isInside(y, side.height)) {
      const auto* row = &weighted[y * side.width];
      const auto apart = std::ptrdiff_t{step} * side.width;
      averageWithin({row, row - apart, row + apart}, step, step, side.width - step, &means[y * side.width]);
    }
    for (std::uint32_t x = 0; x < side.width; ++x) {
      if (isInside(x, side.width) && isInside(y, side.height)) {
        if (!weighted.empty()) x = side.width - step - 1;
        continue;
      }
      Light sum{};
      double all = 0.0;
      auto& mean = means[y * side.width + x];
      near(y, side.height, [&](std::uint32_t ny, double wy) {
        near(x, side.width, [&](std::uint32_t nx, double wx) {
          const auto leaf = ny * side.width + nx;
          const double weight = wx * wy * areaOf(side.first_value + leaf);
          for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * from[leaf][c];
          all += weight;
        });
      });
      for (std::size_t c = 0; c < 3 && all > 0.0; ++c) mean[c] = sum[c] / all;
    }
  }
  for (const auto& beside : beside_[static_cast<std::size_t>(&side - sides_.data())])
    means[beside.leaf] = averageApart(side, beside, pass, from);
}

void LeafSmoother::smooth(std::array<std::vector<Light>, 2>& halves) {
  const auto raw = halves;
  towards_.assign(kPasses.size(), std::vector<float>(area_.size(), 0.0F));
  taken_.assign(area_.size(), 0.0);
  by_chance_.assign(area_.size(), 0.0);
  inTurns(sides_.size(), [&](std::size_t s) {
    const auto& side = sides_[s];
    for (std::size_t pass = 0; pass < kPasses.size(); ++pass)
      if (isFor(kPasses[pass], side)) smoothSide(side, pass, raw, halves);
    for (auto v = side.first_value; v < side.first_value + side.leaf_count; ++v)
      taken_[v] = areaOf(v) * dot(less(halves[0][v], raw[0][v]), less(halves[1][v], raw[1][v]));
  });
  bias_ = std::max(0.0, std::reduce(taken_.begin(), taken_.end())) + std::reduce(by_chance_.begin(), by_chance_.end());
}

void LeafSmoother::forget() {
  giveBack(towards_);
  giveBack(taken_);
  giveBack(by_chance_);
}

/// What was taken of one leaf is a product of two uncertain numbers; of many around it the mean tells.
std::vector<float> LeafSmoother::biasOfLeaves() const {
  std::vector<double> bias(by_chance_);
  const auto weighSide = [&](std::size_t s) {
    const auto& side = sides_[s];
    std::vector<Gain> taken(side.leaf_count);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      taken[leaf] = {taken_[side.first_value + leaf], areaOf(side.first_value + leaf), 1};
    const GainTable table(side, taken);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto around = table.around(leaf % side.width, leaf / side.width);
      const auto v = side.first_value + leaf;
      if (around.bend > 0.0) bias[v] += std::max(0.0, around.slope) * areaOf(v) / around.bend;
    }
  };
  inTurns(sides_.size(), weighSide, area_.size() / kLeavesAThread);
  const double all = std::reduce(bias.begin(), bias.end());
  std::vector<float> of_leaf(bias.size(), 0.0F);
  for (std::size_t v = 0; v < bias.size(); ++v) {
    if (all > 0.0 && areaOf(v) > 0.0) of_leaf[v] = static_cast<float>(bias_ / all * bias[v] / areaOf(v));
  }
  return of_leaf;
}

void LeafSmoother::smoothSide(const Side& side, std::size_t pass, const std::array<std::vector<Light>, 2>& raw,
                              std::array<std::vector<Light>, 2>& halves) {
  const auto first = side.first_value;
  std::array<std::vector<Light>, 2> means;
  for (std::size_t h = 0; h < 2; ++h) {
    means[h].resize(side.leaf_count);
    average(side, kPasses[pass], std::span(halves[h]).subspan(first, side.leaf_count), means[h]);
  }
  std::vector<Gain> gains(side.leaf_count);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto v = first + leaf;
    // Of what was taken so far (p) and what the step would take (q) the halves' noise is independent, so that it
    // cancels in products across; of the noise that is left half the difference is known.
    const auto p0 = less(halves[0][v], raw[0][v]), p1 = less(halves[1][v], raw[1][v]);
    const auto q0 = less(means[0][leaf], halves[0][v]), q1 = less(means[1][leaf], halves[1][v]);
    const auto noise = less(halves[0][v], halves[1][v]), change = less(q0, q1);
    gains[leaf] = {areaOf(v) * (0.5 * (dot(p0, q1) + dot(q0, p1)) + 0.25 * dot(noise, change)),
                   areaOf(v) * (dot(q0, q1) + 0.25 * dot(change, change)), 1};
  }
  const GainTable table(side, gains);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto gain = table.around(leaf % side.width, leaf / side.width);
    const double part = gain.slope >= 0.0 ? 0.0 : gain.bend > -gain.slope ? -gain.slope / gain.bend : 1.0;
    // One number that is chosen by the noise of n leaves gains twice an nth of it by chance (Mallows 1973, "Some
    // comments on Cp"), which neither the halves' difference nor what they have in common shows; nothing, where noise
    // has no say in it (Stein 1981, "Estimation of the mean of a multivariate normal distribution").
    const auto noise = less(halves[0][first + leaf], halves[1][first + leaf]);
    if (part > 0.0 && part < 1.0)
      by_chance_[first + leaf] += areaOf(first + leaf) * 2.0 * 0.25 * dot(noise, noise) / gain.leaves;
    towards_[pass][first + leaf] = static_cast<float>(part);
    for (std::size_t h = 0; h < 2; ++h)
      move(halves[h][first + leaf], means[h][leaf], static_cast<double>(towards_[pass][first + leaf]));
  }
}

void LeafSmoother::apply(std::vector<Light>& values) const {
  std::vector<Light> means;
  for (const auto& side : sides_) {
    for (std::size_t pass = 0; pass < towards_.size(); ++pass) {
      if (!isFor(kPasses[pass], side)) continue;
      means.resize(side.leaf_count);
      average(side, kPasses[pass], std::span(values).subspan(side.first_value, side.leaf_count), means);
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
        move(values[side.first_value + leaf], means[leaf],
             static_cast<double>(towards_[pass][side.first_value + leaf]));
    }
  }
}

}  // namespace radiosity::solver
