// Which leaves get more rays.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include "server/solver/reflected/leaf_gather.h"

namespace radiosity::solver {
namespace {

/// In a round a leaf gets at most so many times as many rays as it had, in powers of two.
constexpr auto kMostTimes = std::uint32_t{LeafSights::kMostTimes};
/// The square of the error of n rays falls as n^-1.3: measured in three rooms, from 4 to 64 rays (Sobol's points; the
/// edges of what is seen keep it from n^-1.5).
constexpr double kFall = 1.3;
/// Noise beside light of less than this part of what is usual is black; and so many rays of a half are enough anywhere.
constexpr double kBlack = 0.02;
constexpr std::uint32_t kMostForBlotches = 256;
/// What is borne on wide sides, of what is elsewhere.
constexpr double kOnWide = 0.3;

}  // namespace

double LeafGather::noiseLeft(double times) { return std::pow(times, -kFall); }

double LeafGather::timesFor(double left) { return left < 1.0 ? std::pow(left, -1.0 / kFall) : 1.0; }

std::uint64_t LeafGather::rays() const {
  std::uint64_t all = 0;
  for (const auto count : sights_.counts()) all += 2U * count;
  return all;
}

std::vector<LeafGather::BlockRays> LeafGather::blockRays() const {
  std::vector<BlockRays> blocks(block_noise_.size());
  const auto counts = sights_.counts();
  for (std::uint32_t v = 0; v < counts.size(); ++v) {
    auto& block = blocks[v / kBlock];
    block.rays += counts[v];
    block.leaves += counts[v] > 0 ? 1U : 0U;
    block.most = std::max<std::uint32_t>(block.most, counts[v]);
  }
  return blocks;
}

/// Twice as many, if that many may be, and there is room for them beside what all rays take already.
bool LeafGather::takeDouble(BlockRays& block, Room& taken) {
  if (block.rays == 0 || block.times >= kMostTimes || 2 * block.times * block.most > LeafSights::kMostRays)
    return false;
  const auto more = std::size_t{block.times} * block.rays * taken.ray_bytes;
  if (taken.bytes + more > most_bytes_) {
    lacks_memory_ = true;
    return false;
  }
  taken.bytes += more;
  block.times *= 2;
  return true;
}

/// Half a difference of smoothed light says little of few leaves, whose noise goes together: a block is as noisy as it
/// is itself, or as its side is.
void LeafGather::refineBlotches(const BesideLight& beside, std::vector<BlockRays>& blocks, Room& taken) {
  const double light = std::reduce(side_light_.begin(), side_light_.end());
  const auto areaBetween = [this](std::size_t first, std::size_t end) {
    double sum = 0.0;
    for (auto v = first; v < end; ++v) sum += areaOf(v);
    return sum;
  };
  const double all = areaBetween(0, area_.size());
  const double black = all > 0.0 ? kBlack * kBlack * light / all : 0.0;
  std::vector<double> noisy(blocks.size(), 0.0), area(blocks.size(), 0.0);  // squares of noise, of those of light
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const auto first = sides_[s].first_value;
    const double side = side_light_[s] + black * areaBetween(first, first + sides_[s].leaf_count);
    const double noise = side_noise_[s] / side / (isWide(sides_[s]) ? kOnWide * kOnWide : 1.0);
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      area[v / kBlock] += areaOf(v);
      if (areaOf(v) > 0.0) noisy[v / kBlock] = std::max(noisy[v / kBlock], noise);
    }
  }
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (area[b] <= 0.0) continue;
    noisy[b] = std::max(noisy[b], block_noise_[b] / (block_light_[b] + black * area[b]));
    auto& block = blocks[b];
    if (noisy[b] <= beside.borne * beside.borne) continue;
    while (noisy[b] * noiseLeft(block.times) > beside.goal * beside.goal &&
           2 * block.times * block.rays <= kMostForBlotches * block.leaves && takeDouble(block, taken))
      continue;
  }
}

bool LeafGather::refine(double goal, const BesideLight& beside) {
  struct Gain {
    double gain;  ///< of noise() for each ray of its next doubling
    std::uint32_t block;
    bool operator<(const Gain& other) const { return gain != other.gain ? gain < other.gain : block > other.block; }
  };
  auto blocks = blockRays();
  lacks_memory_ = false;
  const auto steps = sights_.steps(0).size() + sights_.steps(1).size();
  Room taken{leastBytes() + sights_.bytes() + sights_.widerBytes(kMostTimes * steps), sights_.rayBytes(stepBytes())};
  taken.bytes += steps * stepBytes();
  refineBlotches(beside, blocks, taken);
  double noise = rayNoise();
  std::priority_queue<Gain> queue;
  const auto push = [&](std::uint32_t b) {
    const auto& block = blocks[b];
    if (block.rays == 0 || block_noise_[b] <= 0.0 || block.times >= kMostTimes) return;
    const double left = block_noise_[b] * noiseLeft(block.times);
    queue.push({left * (1.0 - noiseLeft(2.0)) / (static_cast<double>(block.times) * block.rays), b});
  };
  for (std::uint32_t b = 0; b < blocks.size(); ++b) {
    noise -= block_noise_[b] * (1.0 - noiseLeft(blocks[b].times));
    push(b);
  }
  while (!queue.empty() && noise > goal) {
    const auto b = queue.top().block;
    queue.pop();
    auto& block = blocks[b];
    if (!takeDouble(block, taken)) continue;
    noise -= block_noise_[b] * (noiseLeft(block.times / 2.0) - noiseLeft(block.times));
    push(b);
  }
  if (std::ranges::all_of(blocks, [](const BlockRays& block) { return block.times == 1; })) return false;
  const auto counts = sights_.counts();
  std::vector<std::uint16_t> asked(counts.begin(), counts.end());
  for (std::uint32_t v = 0; v < asked.size(); ++v)
    asked[v] = static_cast<std::uint16_t>(asked[v] * blocks[v / kBlock].times);
  forgetShadedRays();  // they will take the room
  sights_.ask(asked);
  return true;
}

}  // namespace radiosity::solver
