#include "server/solver/transport/link_column.h"

#include <algorithm>
#include <bit>

#include "common/clones.h"

namespace radiosity::solver {
namespace {

/// Of a shooter that keeps less than this part of what it sends, the form factors say what arrives.
constexpr double kMostlyLost = 0.5;

/// Up to so many samples the average is rounded to nearest.
constexpr std::uint32_t kExactSamples = 64;

/// 0 to 4095, as good as random for each leaf and sample.
std::uint32_t ditherOf(std::uint32_t value, std::uint32_t sample) {
  std::uint32_t x = value * 0x9e3779b9U ^ sample * 0x85ebca6bU;
  x = (x ^ (x >> 16U)) * 0x7feb352dU;
  x = (x ^ (x >> 15U)) * 0x846ca68bU;
  return (x ^ (x >> 16U)) & 0xfffU;
}

/// Of codes that are shared at least so many are in use.
constexpr double kWorthSharing = 0.9;

/// The float whose exponent is the smallest of a link's, in units of a link's last bit.
constexpr std::uint32_t kExponentBase = 97U << 11U;

inline float decodeOne(std::uint16_t code) {
  const std::uint32_t bits = (static_cast<std::uint32_t>(code) + kExponentBase) << 12U;
  return code == 0 ? 0.0F : std::bit_cast<float>(bits);
}

// Both vectorise; clones with and without 256-bit vectors give the same bits (no fused multiply-add in either).
RADIOSITY_CLONES void decodeAll(const std::uint16_t* code, std::size_t count, float scale, float* value) {
  for (std::size_t i = 0; i < count; ++i) value[i] = scale * decodeOne(code[i]);
}

RADIOSITY_CLONES void addScaled(const std::uint16_t* code, std::size_t count, float r, float g, float b,
                                float* __restrict red, float* __restrict green, float* __restrict blue) {
  for (std::size_t i = 0; i < count; ++i) {
    const float value = decodeOne(code[i]);
    red[i] += r * value;
    green[i] += g * value;
    blue[i] += b * value;
  }
}

RADIOSITY_CLONES float productOf(const std::uint16_t* a, const std::uint16_t* b, const float* area, std::size_t count) {
  constexpr std::size_t kLanes = 8;
  float sum[kLanes] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) sum[k] += area[i + k] * decodeOne(a[i + k]) * decodeOne(b[i + k]);
  }
  float rest = 0.0F;
  for (; i < count; ++i) rest += area[i] * decodeOne(a[i]) * decodeOne(b[i]);
  for (std::size_t k = 0; k < kLanes; ++k) rest += sum[k];
  return rest;
}

}  // namespace

std::uint16_t encodeLink(float value, std::uint32_t dither) {
  if (!(value > 0.0F)) return 0;
  const std::uint32_t rounded = (std::bit_cast<std::uint32_t>(std::min(value, 8.0F)) + dither) >> 12U;
  if (rounded <= kExponentBase) return 0;
  return static_cast<std::uint16_t>(std::min(rounded - kExponentBase, 0xffffU));
}

float decodeLink(std::uint16_t code) { return decodeOne(code); }

void LinkColumn::makeRoom(std::span<const std::uint32_t> reached, const std::vector<Side>& sides) {
  auto run = runs_.begin();
  const auto has = [&](std::uint32_t side) {
    while (run != runs_.end() && run->side + run->side_count <= side) ++run;
    return run != runs_.end() && run->side <= side;
  };
  if (std::all_of(reached.begin(), reached.end(), has)) return;
  std::vector<std::uint32_t> all(reached.begin(), reached.end());
  for (const auto& old : runs_) {
    for (std::uint32_t i = 0; i < old.side_count; ++i) all.push_back(old.side + i);
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  std::vector<Run> runs;
  std::uint32_t size = 0;
  for (const auto s : all) {
    const Side& side = sides[s];
    const std::uint32_t end = side.first_value + side.leaf_count;
    const bool joins =
        !runs.empty() && (side.first_value - runs.back().first_value - runs.back().count) * kLeafBytes <= sizeof(Run);
    if (!joins) runs.push_back({s, 0, side.first_value, 0, size});
    runs.back().side_count = s + 1 - runs.back().side;
    runs.back().count = end - runs.back().first_value;
    size = runs.back().offset + runs.back().count;
  }
  runs.shrink_to_fit();
  std::vector<std::uint16_t> code(size, 0);
  auto to = runs.begin();
  for (const auto& old : runs_) {
    while (to->first_value + to->count <= old.first_value) ++to;
    std::copy_n(code_.at(old.offset), old.count, code.begin() + to->offset + (old.first_value - to->first_value));
  }
  runs_ = std::move(runs);
  code_.set(std::move(code));
}

/// Room for the largest link of a sample, with as much again for what averages and further samples may bring.
void LinkColumn::grow(const LinkExpander& sample, const std::vector<Side>& sides) {
  float largest = 0.0F;
  for (const auto side : sample.sidesReached()) {
    const auto values = sample.values().subspan(sides[side].first_value, sides[side].leaf_count);
    for (const float value : values) largest = std::max(largest, value);
  }
  growTo(largest);
}

void LinkColumn::growTo(float largest) {
  while (scale_ < 0.5F * std::min(largest, 1e30F)) scale_ *= 2.0F;
}

void LinkColumn::add(const LinkExpander& sample, const LinkSample& totals, double points,
                     std::span<const float> leaf_areas, const std::vector<Side>& sides, double factor) {
  makeRoom(sample.sidesReached(), sides);
  const double sum = points_ + points;
  const auto old_part = static_cast<float>(points_ / sum), new_part = static_cast<float>(points / sum);
  const float old_scale = scale_;
  grow(sample, sides);
  const float kept = old_part * (old_scale / scale_), added = new_part / scale_;
  auto next = sample.sidesReached().begin();
  const auto end = sample.sidesReached().end();
  for (const auto& run : runs_) {
    for (std::uint32_t s = run.side; s < run.side + run.side_count; ++s) {
      const Side& side = sides[s];
      const bool is_new = next != end && *next == s;
      if (is_new) ++next;
      addTo(run, side.first_value, side.leaf_count, kept, added,
            is_new ? sample.values().subspan(side.first_value, side.leaf_count) : std::span<const float>());
    }
  }
  // Of which nothing is known, that should arrive which does.
  const double delivered = totals.delivered > 0.0 ? totals.delivered : sample.flux();
  const double due = totals.due > 0.0 ? totals.due : delivered;
  const auto average = [&](double& old, double fresh) { old = (old * points_ + factor * fresh * points) / sum; };
  average(due_, due);
  average(delivered_, delivered);
  average(escaped_, totals.escaped);
  average(absorbed_, totals.absorbed);
  average(presumed_, 0.0);
  const bool unsaid = totals.open_looks.bits == 0 && totals.escaped + totals.absorbed > 0.0;
  const Looks open = unsaid ? Looks{~std::uint64_t{0}} : totals.open_looks;
  open_looks_.add(open, static_cast<std::uint32_t>(points_), static_cast<std::uint32_t>(points));
  points_ = sum;
  ++samples_;
  keepFlux(leaf_areas);
}

/// `fresh`: what the sample brings to the `count` values from `first_value` on; empty: nothing.
void LinkColumn::addTo(const Run& run, std::uint32_t first_value, std::uint32_t count, float kept, float added,
                       std::span<const float> fresh) {
  // To the average of very many, one more adds less than half a last bit: then chance rounds, and the mean stays true.
  const bool chance = samples_ >= kExactSamples;
  std::uint16_t* code = &code_.own()[run.offset + (first_value - run.first_value)];
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t dither = chance ? ditherOf(first_value + i, samples_) : 2048;
    code[i] = encodeLink(kept * decodeOne(code[i]) + added * (fresh.empty() ? 0.0F : fresh[i]), dither);
  }
}

void LinkColumn::keepFlux(std::span<const float> leaf_area) {
  thread_local std::vector<float> links;
  double coded = 0.0;
  for (const auto& run : runs_) {
    links.resize(run.count);
    decodeAll(code_.at(run.offset), run.count, 1.0F, links.data());
    coded += fluxOf(links, &leaf_area[run.first_value]);
  }
  coded *= static_cast<double>(scale_);
  // What little stays where most is lost, form factors know better than the pixels through which the rest is lost.
  const double arrives = due_ < kMostlyLost * (due_ + escaped_ + absorbed_) ? delivered_ : due_;
  // Where nearly all links are too small for a code there is nothing to lay the rest on.
  gain_ = arrives > 0.0 && coded > 0.0 ? static_cast<float>(std::clamp(arrives / coded, 0.25, 4.0)) : 1.0F;
}

void LinkColumn::replace(std::span<const ValueRun> leaves, std::span<const float> values, const Totals& totals,
                         std::span<const float> leaf_area, const std::vector<Side>& sides) {
  std::vector<std::uint32_t> reached;
  float largest = 0.0F;
  std::uint32_t s = 0;
  for (const auto& run : leaves) {
    float here = 0.0F;
    for (std::uint32_t v = run.first; v < run.first + run.count; ++v) here = std::max(here, values[v]);
    largest = std::max(largest, here);
    while (sides[s].first_value + sides[s].leaf_count <= run.first) ++s;
    if (here > 0.0F && (reached.empty() || reached.back() != s)) reached.push_back(s);
  }
  makeRoom(reached, sides);
  const float old_scale = scale_;
  growTo(largest);
  if (scale_ != old_scale) {
    for (auto& code : code_.own()) code = encodeLink(old_scale / scale_ * decodeOne(code));
  }
  const float unit = 1.0F / scale_;
  auto to = runs_.begin();
  for (const auto& run : leaves) {
    while (to != runs_.end() && to->first_value + to->count <= run.first) ++to;
    if (to == runs_.end()) break;
    if (to->first_value > run.first) continue;  // no room was made: all of them are zero
    std::uint16_t* code = &code_.own()[to->offset + (run.first - to->first_value)];
    for (std::uint32_t i = 0; i < run.count; ++i) code[i] = encodeLink(unit * values[run.first + i]);
  }
  due_ = delivered_ = totals.due;  // of a shooter that loses next to nothing
  escaped_ = totals.escaped;
  absorbed_ = totals.absorbed;
  open_looks_ = totals.open_looks;
  presumed_ = totals.presumed;
  keepFlux(leaf_area);
}

LinkColumn LinkColumn::renumbered(const std::vector<std::uint32_t>& side_after, const std::vector<Side>& before,
                                  const std::vector<Side>& after) const {
  struct Piece {
    std::uint32_t side, from, count;  // new number; where its codes are
  };
  std::vector<Piece> pieces;
  std::size_t codes = 0;
  for (const auto& old : runs_) {
    for (std::uint32_t s = old.side; s < old.side + old.side_count; ++s) {
      if (side_after[s] == scene::kNone) continue;
      const auto count = after[side_after[s]].leaf_count;
      pieces.push_back({side_after[s], old.offset + (before[s].first_value - old.first_value), count});
      codes += count;
    }
  }
  // An edit that changes the order of nodes changes that of sides.
  if (!std::ranges::is_sorted(pieces, {}, &Piece::side)) std::ranges::sort(pieces, {}, &Piece::side);
  const bool share = static_cast<double>(codes) >= kWorthSharing * static_cast<double>(code_.all().size());
  std::vector<Run> runs;
  std::vector<std::uint16_t> code;
  if (!share) code.reserve(codes);  // not more, or they would be copied once more to give the rest back
  for (const auto& piece : pieces) {
    const auto offset = share ? piece.from : static_cast<std::uint32_t>(code.size());
    if (!share) code.insert(code.end(), code_.at(piece.from), code_.at(piece.from) + piece.count);
    const bool joins = !runs.empty() && runs.back().side + runs.back().side_count == piece.side &&
                       runs.back().offset + runs.back().count == offset;
    if (!joins) runs.push_back({piece.side, 0, after[piece.side].first_value, 0, offset});
    ++runs.back().side_count;
    runs.back().count += piece.count;
  }
  runs.shrink_to_fit();
  LinkColumn column;
  column.runs_ = std::move(runs);
  if (share) {
    column.code_ = code_;
  } else {
    column.code_.set(std::move(code));
  }
  column.scale_ = scale_;
  column.gain_ = gain_;
  column.samples_ = samples_;
  column.points_ = points_;
  column.due_ = due_;
  column.delivered_ = delivered_;
  column.escaped_ = escaped_;
  column.absorbed_ = absorbed_;
  column.open_looks_ = open_looks_;
  column.presumed_ = presumed_;
  return column;
}

void LinkColumn::apply(const std::array<float, 3>& radiosity, const std::array<float*, 3>& irradiance) const {
  const float scale = scale_ * gain_;
  for (const auto& run : runs_) {
    addScaled(code_.at(run.offset), run.count, scale * radiosity[0], scale * radiosity[1], scale * radiosity[2],
              irradiance[0] + run.first_value, irradiance[1] + run.first_value, irradiance[2] + run.first_value);
  }
}

void LinkColumn::addSquares(float factor, std::span<float> sums) const {
  const float scale = scale_ * gain_;
  for (const auto& run : runs_) {
    for (std::uint32_t i = 0; i < run.count; ++i) {
      const float link = scale * decodeOne(*code_.at(run.offset + i));
      sums[run.first_value + i] += factor * link * link;
    }
  }
}

double LinkColumn::product(const LinkColumn& a, const LinkColumn& b, std::span<const float> leaf_area) {
  double sum = 0.0;
  auto other = b.runs_.begin();
  for (const auto& run : a.runs_) {
    const std::uint32_t run_end = run.first_value + run.count;
    while (other != b.runs_.end() && other->first_value + other->count <= run.first_value) ++other;
    for (auto with = other; with != b.runs_.end() && with->first_value < run_end; ++with) {
      const std::uint32_t first = std::max(run.first_value, with->first_value);
      const std::uint32_t end = std::min(run_end, with->first_value + with->count);
      sum += static_cast<double>(productOf(a.code_.at(run.offset + (first - run.first_value)),
                                           b.code_.at(with->offset + (first - with->first_value)), &leaf_area[first],
                                           end - first));
    }
  }
  return sum * static_cast<double>(a.scale_ * a.gain_) * static_cast<double>(b.scale_ * b.gain_);
}

bool LinkColumn::decode(std::uint32_t first_value, std::span<float> leaves) const {
  const auto after = std::upper_bound(runs_.begin(), runs_.end(), first_value,
                                      [](auto value, const Run& run) { return value < run.first_value; });
  if (after == runs_.begin()) return false;
  const Run& run = *(after - 1);
  if (first_value >= run.first_value + run.count) return false;
  decodeAll(code_.at(run.offset + (first_value - run.first_value)), leaves.size(), scale_ * gain_, leaves.data());
  return true;
}

}  // namespace radiosity::solver
