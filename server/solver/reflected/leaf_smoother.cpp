#include "server/solver/reflected/leaf_smoother.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/clones.h"
#include "common/give_back.h"
#include "common/parallel.h"

namespace radiosity::solver {
namespace {

/// Sides of fewer leaves across than this have no others to speak of than those at their edges.
constexpr std::uint32_t kNarrow = 12;
/// How far a leaf goes is told by what it and those so near to it would gain. Of fewer what is gained is chance, which
/// the error that is stated does not know: with 2 the truth was 1.34 times as much in two rooms, with 6 it is 1.2
/// times.
constexpr std::uint32_t kAround = 6;
/// Squares of what is less than two to this, and more than one by that, are well within single precision.
constexpr int kOrdinary = 32;

/// Of a row of leaves, or a column, how many lie so near to the one there, itself among them.
std::vector<float> countNear(std::uint32_t size) {
  std::vector<float> counts(size);
  for (std::uint32_t at = 0; at < size; ++at)
    counts[at] = static_cast<float>(std::min(at + kAround + 1, size) - (at - std::min(at, kAround)));
  return counts;
}

RADIOSITY_CLONES void enterRow(const double* row, std::size_t count, double* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] += row[i];
}
RADIOSITY_CLONES void leaveRow(const double* row, std::size_t count, double* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] -= row[i];
}

/// Replaces values of a side by their sums over squares of leaves around each. Along rows what lies before is
/// subtracted from what lies before and within; then rows enter a sum, and leave it.
class SumNear {
 public:
  void operator()(const Side& side, std::vector<double>& values) {
    const std::size_t width = side.width, height = side.height, around = kAround;
    before_.assign(width + 1, 0.0);
    sums_.assign(width, 0.0);
    rows_.resize(values.size());
    for (std::size_t y = 0; y < height; ++y) {
      const double* row = &values[y * width];
      for (std::size_t x = 0; x < width; ++x) before_[x + 1] = before_[x] + row[x];
      for (std::size_t x = 0; x < width; ++x)
        rows_[y * width + x] = before_[std::min(x + around + 1, width)] - before_[x - std::min(x, around)];
    }
    for (std::size_t y = 0; y < std::min(around, height); ++y) enterRow(&rows_[y * width], width, sums_.data());
    for (std::size_t y = 0; y < height; ++y) {
      if (y + around < height) enterRow(&rows_[(y + around) * width], width, sums_.data());
      if (y > around) leaveRow(&rows_[(y - around - 1) * width], width, sums_.data());
      std::copy(sums_.begin(), sums_.end(), &values[y * width]);
    }
  }

 private:
  std::vector<double> before_, sums_, rows_;
};

/// What is gained around the leaves of a row: the error of a step of length w towards the mean is
/// a + 2 slope w + bend w^2.
struct Gains {
  const double *slope, *bend;
};

/// How far each goes. One number that is chosen by the noise of n leaves gains twice an nth of it by chance (Mallows
/// 1973, "Some comments on Cp"), which neither the halves' difference nor what they have in common shows; nothing,
/// where noise has no say in it (Stein 1981, "Estimation of the mean of a multivariate normal distribution"). `noise`:
/// of each, the square of what the halves differ by. `near`: how many leaves are, along the row.
RADIOSITY_CLONES void choosePartsOfRow(std::size_t count, const Gains& gains, const float* noise, const float* near,
                                       float rows_near, float* parts, float* by_chance) {
  for (std::size_t x = 0; x < count; ++x) {
    const double slope = gains.slope[x], bend = gains.bend[x];
    const double ratio = -slope / std::max(bend, 1e-300);
    const double part = slope >= 0.0 ? 0.0 : bend > -slope ? ratio : 1.0;
    parts[x] = static_cast<float>(part);
    by_chance[x] = part > 0.0 && part < 1.0 ? 0.5F * noise[x] / (near[x] * rows_near) : 0.0F;
  }
}

RADIOSITY_CLONES void addAll(const float* others, std::size_t count, float* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] += others[i];
}
RADIOSITY_CLONES void twice(const float* values, std::size_t count, float* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] = 2.0F * values[i];
}
RADIOSITY_CLONES void sumOfThree(const float* below, const float* here, const float* above, std::size_t count,
                                 float* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] = 2.0F * here[i] + below[i] + above[i];
}
RADIOSITY_CLONES void multiply(const float* a, const float* b, std::size_t count, float* products) {
  for (std::size_t i = 0; i < count; ++i) products[i] = a[i] * b[i];
}
/// Means by sums and one by the sums of weights; where that is 0, what is there.
RADIOSITY_CLONES void divide(const float* sums, const float* per_sum, const float* values, std::size_t count,
                             float* means) {
  for (std::size_t i = 0; i < count; ++i) means[i] = per_sum[i] > 0.0F ? sums[i] * per_sum[i] : values[i];
}

/// Of leaves in a row along some dimension, those to which the one below is added, and the one above.
struct Ends {
  struct Range {
    std::size_t first, end;
    [[nodiscard]] bool has(std::size_t at) const { return at >= first && at < end; }
  };
  Range below, above;
};
/// `alone`: also where only one of the two is there.
Ends endsOf(std::uint32_t count, std::uint32_t step, bool alone) {
  const std::size_t first = std::min(step, count), end = count - first;
  if (alone) return {{first, count}, {0, end}};
  return {{first, std::max(first, end)}, {first, std::max(first, end)}};
}

/// Sides in a row that have so many leaves together, or one that has more.
constexpr std::uint32_t kLeavesATurn = 512;
/// Leaves beside parted ones that a thread is worth.
constexpr std::size_t kBesideAShare = 64;
std::vector<std::span<const Side>> groupsOf(const std::vector<Side>& sides) {
  std::vector<std::span<const Side>> groups;
  std::size_t first = 0, leaves = 0;
  for (std::size_t s = 0; s < sides.size(); ++s) {
    leaves += sides[s].leaf_count;
    if (leaves < kLeavesATurn && s + 1 < sides.size()) continue;
    groups.push_back(std::span(sides).subspan(first, s + 1 - first));
    first = s + 1;
    leaves = 0;
  }
  return groups;
}

/// Of the largest value; 0 where there is none to speak of.
int exponentOf(const std::array<LeafSmoother::Light, 2>& halves) {
  float largest = 0.0F;
  for (const auto& half : halves) {
    for (const auto& channel : half)
      for (const float value : channel) largest = std::max(largest, std::abs(value));
  }
  return largest > 0.0F && std::isfinite(largest) ? std::ilogb(largest) : 0;
}
void scale(std::array<LeafSmoother::Light, 2>& halves, int exponent) {
  if (exponent == 0) return;
  for (auto& half : halves) {
    for (auto& channel : half)
      for (auto& value : channel) value = std::ldexp(value, exponent);
  }
}

/// Values of both halves of a side, by channel: as they were, as they are, and the means around them.
struct Planes {
  std::array<const float*, 3> raw, now, mean;
};

/// What a step towards the means would gain at each leaf, by channel added to what others would.
RADIOSITY_CLONES void addGains(std::size_t count, std::size_t channel, const Planes& first, const Planes& second,
                               float* slopes, float* bends) {
  const float *raw0 = first.raw[channel], *raw1 = second.raw[channel];
  const float *now0 = first.now[channel], *now1 = second.now[channel];
  const float *mean0 = first.mean[channel], *mean1 = second.mean[channel];
  for (std::size_t i = 0; i < count; ++i) {
    // Of what was taken so far (p) and what the step would take (q) the halves' noise is independent, so that it
    // cancels in products across; of the noise that is left half the difference is known.
    const float p0 = now0[i] - raw0[i], p1 = now1[i] - raw1[i], q0 = mean0[i] - now0[i], q1 = mean1[i] - now1[i];
    const float noise = now0[i] - now1[i], change = q0 - q1;
    slopes[i] += 0.5F * (p0 * q1 + q0 * p1) + 0.25F * noise * change;
    bends[i] += q0 * q1 + 0.25F * change * change;
  }
}

RADIOSITY_CLONES void addSquares(std::size_t count, const float* a, const float* b, float* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] += (a[i] - b[i]) * (a[i] - b[i]);
}

RADIOSITY_CLONES void moveTowards(std::size_t count, const float* means, const float* parts, float* values) {
  for (std::size_t i = 0; i < count; ++i) values[i] += parts[i] * (means[i] - values[i]);
}

}  // namespace

/// To work in, of one thread: many sides are a few leaves, of which to ask for memory would take longer than the rest.
struct LeafSmoother::Room {
  std::vector<float> per_sum;  ///< of a pass over a side: one by the sum of the weights of each leaf's mean
  std::vector<float> weighted, rows, means, slopes, bends, noise, by_chance;
  std::vector<double> slope, bend;
  std::vector<Apart> apart;
  SumNear sumNear;
};

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

/// As openWays() where nothing stands: what lies on the side.
std::uint16_t LeafSmoother::waysWithin(const Side& side, std::uint32_t leaf, std::uint32_t step) {
  const auto within = [step](std::uint32_t at, std::uint32_t size) {  // below, here, above, as bits
    return (at >= step ? 1U : 0U) | 2U | (at + step < size ? 4U : 0U);
  };
  const auto across = within(leaf % side.width, side.width), up = within(leaf / side.width, side.height);
  std::uint32_t ways = 0;
  for (std::uint32_t y = 0; y < 3; ++y) ways |= ((up >> y) & 1U) * across << (3 * y);
  return static_cast<std::uint16_t>(ways);
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
    if (beside[leaf]) beside_[s].push_back({leaf, {}, {}});
  beside_[s].shrink_to_fit();
  inShares(beside_[s].size() / kBesideAShare, [&](std::size_t share, std::size_t shares) {
    for (auto i = share; i < beside_[s].size(); i += shares) {
      auto& one = beside_[s][i];
      for (std::size_t k = 0; k < kSteps.size(); ++k) {
        one.open[k] = openWays(side, one.leaf, kSteps[k]);
        one.cut[k] = one.open[k] != waysWithin(side, one.leaf, kSteps[k]);
      }
    }
  });
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

/// The mean around one leaf, of those between which and it nothing stands.
LeafSmoother::Apart LeafSmoother::apart(const Side& side, const Beside& beside, const Pass& pass) const {
  Apart apart{beside.leaf, 0, {}, {}};
  const auto open = beside.open[pass.step_index];
  const auto isOpen = [&](std::size_t way) { return ((open >> way) & 1U) != 0; };
  float all = 0.0F;
  for (std::size_t way = 0; way < 9; ++way) {
    if (!isOpen(way) || (!pass.one_sided && !isOpen(8 - way))) continue;
    const std::ptrdiff_t dx = static_cast<std::ptrdiff_t>(way % 3) - 1, dy = static_cast<std::ptrdiff_t>(way / 3) - 1;
    const std::ptrdiff_t step = pass.step(), width = side.width;
    const auto there = static_cast<std::uint32_t>(std::ptrdiff_t{beside.leaf} + step * (dy * width + dx));
    const float weight = (dx == 0 ? 2.0F : 1.0F) * (dy == 0 ? 2.0F : 1.0F) * area_[side.first_value + there];
    apart.with[apart.count] = there;
    apart.weight[apart.count++] = weight;
    all += weight;
  }
  if (!(all > 0.0F)) return {beside.leaf, 1, {beside.leaf}, {1.0F}};
  for (auto& weight : apart.weight) weight /= all;
  return apart;
}

/// Replaces values of a side by binomial sums of those around them, rows first.
void LeafSmoother::sumAround(const Side& side, const Pass& pass, std::vector<float>& values, std::vector<float>& rows) {
  const std::size_t step = pass.step(), width = side.width, apart = step * width;
  const auto across = endsOf(side.width, pass.step(), pass.takesEnds(side.width));
  const auto up = endsOf(side.height, pass.step(), pass.takesEnds(side.height));
  rows.resize(values.size());
  for (std::size_t y = 0; y < side.height; ++y) {
    const float* from = &values[y * width];
    float* sums = &rows[y * width];
    const auto addEnds = [&](std::size_t x) {
      sums[x] = 2.0F * from[x];
      if (across.below.has(x)) sums[x] += from[x - step];
      if (across.above.has(x)) sums[x] += from[x + step];
    };
    const std::size_t first = std::min(step, width), end = std::max(first, width - first);
    for (std::size_t x = 0; x < first; ++x) addEnds(x);
    if (end > first) sumOfThree(from + first - step, from + first, from + first + step, end - first, sums + first);
    for (std::size_t x = end; x < width; ++x) addEnds(x);
  }
  for (std::size_t y = 0; y < side.height; ++y) {
    const float* row = &rows[y * width];
    float* sums = &values[y * width];
    const bool has_below = up.below.has(y), has_above = up.above.has(y);
    if (has_below && has_above) {
      sumOfThree(row - apart, row, row + apart, width, sums);
      continue;
    }
    twice(row, width, sums);
    if (has_below) addAll(row - apart, width, sums);
    if (has_above) addAll(row + apart, width, sums);
  }
}

void LeafSmoother::weigh(const Side& side, const Pass& pass, Room& room) const {
  const auto* area = &area_[side.first_value];
  room.per_sum.assign(area, area + side.leaf_count);
  sumAround(side, pass, room.per_sum, room.rows);
  for (auto& sum : room.per_sum) sum = sum > 0.0F ? 1.0F / sum : 0.0F;
  room.weighted.resize(side.leaf_count);
  room.apart.clear();
  for (const auto& beside : beside_[static_cast<std::size_t>(&side - sides_.data())])
    if (pass.one_sided || beside.cut[pass.step_index]) room.apart.push_back(apart(side, beside, pass));
}

/// Of one channel: binomial, of the leaves there are.
void LeafSmoother::average(const Side& side, const Pass& pass, const float* from, float* means, Room& room) const {
  multiply(from, &area_[side.first_value], side.leaf_count, room.weighted.data());
  sumAround(side, pass, room.weighted, room.rows);
  divide(room.weighted.data(), room.per_sum.data(), from, side.leaf_count, means);
  for (const auto& apart : room.apart) {
    float mean = 0.0F;
    for (std::uint32_t i = 0; i < apart.count; ++i) mean += apart.weight[i] * from[apart.with[i]];
    means[apart.leaf] = mean;
  }
}

void LeafSmoother::smooth(std::array<Light, 2>& halves) {
  // Squares of what is very bright, or dark, are beyond single precision. By powers of two nothing is rounded.
  const int largest = exponentOf(halves), exponent = std::abs(largest) < kOrdinary ? 0 : largest;
  scale(halves, -exponent);
  const auto raw = halves;
  towards_.assign(kPasses.size(), std::vector<float>(area_.size(), 0.0F));
  taken_.assign(area_.size(), 0.0);
  by_chance_.assign(area_.size(), 0.0);
  const auto smoothAll = [&](const Side& side, Room& room) {
    for (std::size_t pass = 0; pass < kPasses.size(); ++pass)
      if (isFor(kPasses[pass], side)) smoothSide(side, pass, raw, halves, room);
    for (auto v = side.first_value; v < side.first_value + side.leaf_count; ++v) {
      float both = 0.0F;
      for (std::size_t c = 0; c < 3; ++c) both += (halves[0][c][v] - raw[0][c][v]) * (halves[1][c][v] - raw[1][c][v]);
      taken_[v] = areaOf(v) * static_cast<double>(both);
    }
  };
  const auto groups = groupsOf(sides_);
  inTurns(groups.size(), [&](std::size_t g) {
    Room room;
    for (const auto& side : groups[g]) smoothAll(side, room);
  });
  scale(halves, exponent);
  for (auto* squares : {&taken_, &by_chance_}) {
    for (auto& square : *squares) square = exponent == 0 ? square : std::ldexp(square, 2 * exponent);
  }
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
    const auto first = static_cast<std::ptrdiff_t>(side.first_value), end = first + std::ptrdiff_t{side.leaf_count};
    std::vector<double> taken(taken_.begin() + first, taken_.begin() + end),
        area(area_.begin() + first, area_.begin() + end);
    SumNear sumNear;
    sumNear(side, taken);
    sumNear(side, area);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto v = side.first_value + leaf;
      if (area[leaf] > 0.0) bias[v] += std::max(0.0, taken[leaf]) * areaOf(v) / area[leaf];
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

void LeafSmoother::smoothSide(const Side& side, std::size_t pass, const std::array<Light, 2>& raw,
                              std::array<Light, 2>& halves, Room& room) {
  const auto first = side.first_value;
  const std::size_t count = side.leaf_count;
  weigh(side, kPasses[pass], room);
  room.means.resize(6 * count);
  for (auto* sums : {&room.slopes, &room.bends, &room.noise}) sums->assign(count, 0.0F);
  const auto meansOf = [&](std::size_t h, std::size_t c) { return &room.means[(3 * h + c) * count]; };
  std::array<Planes, 2> planes{};
  for (std::size_t h = 0; h < 2; ++h) {
    for (std::size_t c = 0; c < 3; ++c) {
      average(side, kPasses[pass], &halves[h][c][first], meansOf(h, c), room);
      planes[h].raw[c] = &raw[h][c][first];
      planes[h].now[c] = &halves[h][c][first];
      planes[h].mean[c] = meansOf(h, c);
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    addGains(count, c, planes[0], planes[1], room.slopes.data(), room.bends.data());
    addSquares(count, planes[0].now[c], planes[1].now[c], room.noise.data());
  }
  chooseParts(side, room, &towards_[pass][first]);
  const auto* parts = &towards_[pass][first];
  for (std::size_t leaf = 0; leaf < count; ++leaf)
    by_chance_[first + leaf] += areaOf(first + leaf) * static_cast<double>(room.by_chance[leaf]);
  for (std::size_t h = 0; h < 2; ++h) {
    for (std::size_t c = 0; c < 3; ++c) moveTowards(count, meansOf(h, c), parts, &halves[h][c][first]);
  }
}

void LeafSmoother::chooseParts(const Side& side, Room& room, float* parts) const {
  for (auto* sums : {&room.slope, &room.bend}) sums->resize(side.leaf_count);
  for (std::size_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const double area = areaOf(side.first_value + leaf);
    room.slope[leaf] = area * static_cast<double>(room.slopes[leaf]);
    room.bend[leaf] = area * static_cast<double>(room.bends[leaf]);
  }
  room.sumNear(side, room.slope);
  room.sumNear(side, room.bend);
  room.by_chance.resize(side.leaf_count);
  const auto across = countNear(side.width), up = countNear(side.height);
  for (std::size_t y = 0; y < side.height; ++y) {
    const auto row = y * side.width;
    choosePartsOfRow(side.width, {&room.slope[row], &room.bend[row]}, &room.noise[row], across.data(), up[y],
                     parts + row, &room.by_chance[row]);
  }
}

void LeafSmoother::apply(const Side& side, const std::array<float*, 3>& values, Room& room) const {
  for (std::size_t pass = 0; pass < towards_.size(); ++pass) {
    if (!isFor(kPasses[pass], side)) continue;
    weigh(side, kPasses[pass], room);
    room.means.resize(side.leaf_count);
    for (auto* channel : values) {
      average(side, kPasses[pass], channel, room.means.data(), room);
      moveTowards(side.leaf_count, room.means.data(), &towards_[pass][side.first_value], channel);
    }
  }
}

void LeafSmoother::apply(std::size_t side, const std::array<float*, 3>& values) const {
  Room room;
  apply(sides_[side], values, room);
}

void LeafSmoother::apply(Light& values) const {
  Room room;
  for (const auto& side : sides_) {
    const auto first = side.first_value;
    apply(side, {values[0].data() + first, values[1].data() + first, values[2].data() + first}, room);
  }
}

}  // namespace radiosity::solver
