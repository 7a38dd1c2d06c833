#include "server/solver/reflected/leaf_gather.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/clones.h"
#include "common/give_back.h"
#include "server/solver/math/halves.h"

namespace radiosity::solver {
namespace {

/// Rays of each half of a leaf that a solve begins with.
constexpr std::uint16_t kFirstRays = 8;
constexpr int kMaxSweeps = 400;
/// What rays that went on from as many leaves as they may bring from where they end counts so many times: in a level of
/// closed pockets the error is 3.6 to 4.0 %, with this 3.1 % are stated, and with 1 2.2 %.
constexpr double kUnsure = 1.4;
/// What comes over links to a place of a leaf on the way is off by so large a part of what it differs by beside the
/// leaf. Of a lamp that shines on the ceiling from a fourteenth of a texel 2.6 % are true and 2.7 % stated; with 0 and
/// 0.5 that is 2.0 and 4.7 %.
constexpr double kWithin = 0.2;
/// Of a leaf in each half, floats: what GMRES keeps, and the sweeps, of which what is sent is known in double; and what
/// there is of its light.
constexpr std::size_t kVectors = 3 * (Gmres<float>::kRestart + 3) + 4 * 4, kLights = 5 * 3 + 4;
/// Where there are mirrors: what arrives by way of them, what only they show, and what they look like.
constexpr std::size_t kMirrorLights = 4 * 4 + 9;
/// So large a part of memory images of lamps may take, and caustics.
constexpr std::size_t kImagesPart = 8;

using Light32 = std::array<float, 4>;

__attribute__((always_inline)) inline void add(Light32& sum, const Light32& light) {
  for (std::size_t c = 0; c < 4; ++c) sum[c] += light[c];
}

/// Means over the rays of all leaves. So many are added up in single precision: of thousands equal numbers all sums
/// would be rounded alike, and white rooms make a thousand times as much of that.
constexpr std::size_t kSummedAtOnce = 32;
RADIOSITY_CLONES void averageSeen(const LeafSights& sights, std::size_t half, const Light32* radiosity, Light32* mean) {
  const auto counts = sights.counts();
  std::size_t first = 0;
  for (std::uint32_t value = 0; value < sights.leafCount(); first += counts[value++]) {
    std::array<double, 4> all{};
    for (std::size_t ray = 0; ray < counts[value]; ray += kSummedAtOnce) {
      Light32 sum{};
      for (const auto end : sights.ends(half, first + ray, std::min(kSummedAtOnce, counts[value] - ray)))
        add(sum, radiosity[end]);
      for (std::size_t c = 0; c < 4; ++c) all[c] += static_cast<double>(sum[c]);
    }
    const double part = counts[value] > 0 ? 1.0 / counts[value] : 0.0;
    for (std::size_t c = 0; c < 4; ++c) mean[value][c] = static_cast<float>(part * all[c]);
  }
}

Light32 rounded(const std::array<double, 4>& light) {
  return {static_cast<float>(light[0]), static_cast<float>(light[1]), static_cast<float>(light[2]), 0.0F};
}

/// At the edges of a side smoothing has leaves on two of four sides only, and another side's light changes most.
std::uint16_t firstRaysOfWide(const Side& side, std::uint32_t leaf, bool is_alone) {
  const auto x = leaf % side.width, y = leaf / side.width;
  const auto from_edge = std::min({x, y, side.width - 1 - x, side.height - 1 - y});
  const std::uint32_t usual = is_alone ? 2 * kFirstRays : kFirstRays;
  const std::uint32_t times = from_edge > 1 ? 1 : from_edge == 0 && is_alone ? 4 : from_edge == 0 || is_alone ? 2 : 1;
  return static_cast<std::uint16_t>(times * usual);
}

/// As many times as many rays each leaf has to begin with where leaves are few: a power of two.
std::size_t timesOfFew(std::size_t leaves, std::size_t fewest) {
  constexpr std::size_t kMost = LeafSights::kMostRays / kFirstRays / LeafSights::kMostTimes;  // noisy ones get more yet
  const auto usual = std::max<std::size_t>(1, 2 * kFirstRays * leaves);
  return std::bit_floor(std::clamp<std::size_t>(fewest / usual, 1, kMost));
}

/// Calls work(leaf value) for so many, on all cores where they are worth it.
template <typename Work>
void inLeaves(std::size_t leaves, const Work& work) {
  inShares(leaves / kLeavesAThread, [&](std::size_t share, std::size_t shares) {
    for (auto v = share * leaves / shares; v < (share + 1) * leaves / shares; ++v) work(v);
  });
}

}  // namespace

LeafGather::LeafGather(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
                       std::size_t most_bytes, std::shared_ptr<const LeafRays> rays, std::span<const float> areas)
    : sights_(patches, sides, seed, std::move(rays)),
      mirrored_lamps_(sides, sights_.rays(), seed, most_bytes / kImagesPart),
      most_bytes_(most_bytes),
      sides_(sides),
      own_area_(areas.empty() ? leafAreas(patches, sides) : std::vector<float>()),
      area_(areas.empty() ? std::span<const float>(own_area_) : areas) {
  limitSights();
}

void LeafGather::limitSights() {
  const std::size_t first = sights_.leafCount() * kFirstRays * LeafSights::kRayBytes;
  sights_.limit(most_bytes_ - std::min(most_bytes_, leastBytes() - first), stepBytes());
}

void LeafGather::reflectBy(std::shared_ptr<const SpecularLeaves> mirrors) {
  has_mirrors_ = mirrors != nullptr;
  sights_.reflectBy(std::move(mirrors));
  limitSights();
}

/// Of the light that steps bring, and of what is found for each while mirrors are weighed.
std::size_t LeafGather::stepBytes() const {
  return (sights_.rays()->hasTints() ? 4 : has_mirrors_ ? 3 : 1) * sizeof(Light32);
}

std::size_t LeafGather::leastBytes(std::size_t leaves, bool has_mirrors) {
  const auto lights = kLights + (has_mirrors ? kMirrorLights : 0);
  return leaves * (2 * (kVectors + lights) * sizeof(float) + kFirstRays * LeafSights::kRayBytes);
}

void LeafGather::inherit(const LeafGather& former, std::span<const std::uint32_t> value_before, const Shadows& change) {
  const std::size_t leaves = std::max(1U, sights_.leafCount()), least = leastBytes();
  const std::size_t of_ray = std::max(former.sights_.rayBytes(stepBytes()), sights_.rayBytes(0));
  const std::size_t rays = most_bytes_ > least ? (most_bytes_ - least) / (leaves * of_ray) : 0;
  const auto most = std::clamp<std::size_t>(rays, kFirstRays, LeafSights::kMostRays);
  sights_.inherit(former.sights_, value_before, change, static_cast<std::uint16_t>(most));
  mirrored_lamps_.setTimes(former.mirrored_lamps_.times());
}

void LeafGather::start(const std::vector<bool>& has_other, std::size_t fewest) {
  const auto counts = sights_.counts();
  if (std::ranges::any_of(counts, [](std::uint16_t count) { return count > 0; })) return;
  std::vector<std::uint16_t> asked(sights_.leafCount(), kFirstRays);
  for (std::size_t s = 0; s < sides_.size(); ++s) {
    const auto& side = sides_[s];
    const bool is_alone = !has_other.empty() && !has_other[s];
    for (std::uint32_t leaf = 0; leaf < side.leaf_count && isWide(side); ++leaf)
      asked[side.first_value + leaf] = firstRaysOfWide(side, leaf, is_alone);
  }
  const auto usual = std::reduce(asked.begin(), asked.end(), std::size_t{0});
  const auto fits = [&](std::size_t rays) { return leastBytes() + rays * LeafSights::kRayBytes <= most_bytes_; };
  auto times = timesOfFew(asked.size(), fewest);
  while (times > 1 && !fits(times * usual)) times /= 2;
  for (auto& count : asked)
    count = static_cast<std::uint16_t>(std::min<std::size_t>(times * count, LeafSights::kMostRays));
  if (!fits(times * usual)) std::ranges::fill(asked, kFirstRays);
  sights_.ask(asked);
}

void LeafGather::begin(LeftLight light) {
  light_ = std::move(light);
  if (!light_.sky_cells.empty()) sights_.tellCells();
  mirrored_lamps_.begin(std::move(light_.in_mirrors), shading_);
  stage_ = Stage::kTracing;
}

bool LeafGather::advance(double seconds) {
  const auto start = std::chrono::steady_clock::now();
  const auto spent = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  if (stage_ == Stage::kTracing) {
    if (!sights_.isTraced()) {
      is_weighed_ = false;  // nor is it where memory ends in between
      forgetShadedRays();
    }
    if (!sights_.trace(seconds)) return false;
    if (!mirrored_lamps_.advance(seconds - spent())) return false;
    if (!is_weighed_) {
      weighRays();
      smoother_.emplace(sides_, area_, [this](std::uint32_t v) { return sights_.isParted(v); });
    }
    is_weighed_ = true;
    joinParts();
    takeImages();
    inBothHalves([&](std::size_t half) { takeLight(half); });
    stage_ = Stage::kSolving;
  }
  if (stage_ == Stage::kSolving) {
    inBothHalves([&](std::size_t h) {
      while (!halves_[h].done && spent() < seconds) {
        halves_[h].done = halves_[h].gmres.advance([&](RayGmres::Vectors& x, bool affine) { sweep(h, x, affine); });
      }
    });
    if (!halves_[0].done || !halves_[1].done) return false;
    finish();
  }
  return true;
}

/// What the solution tells of itself; what it was made with takes no more memory.
void LeafGather::finish() {
  takeSolutions();
  smoother_->smooth(solved_);
  for (std::size_t half = 0; half < 2; ++half) {
    const auto& x = solved_[half];
    passOn(half, [&](std::uint32_t v) { return std::array{x[0][v], x[1][v], x[2][v]}; });
  }
  std::array<Levels, 2> levels;
  inBothHalves([&](std::size_t half) {
    levels[half] = this->levels(half);
    gathered_[half].assign(sights_.leafCount(), glm::vec3(0.0F));
    take(half, levels[half]);
  });
  solved_ = {};
  smoothed_ = bias_ = smoother_->bias();
  leaf_bias_ = smoother_->biasOfLeaves();
  weighLost();
  weighNoise();
  weighMirrors();
  weighShading();
  smoother_->forget();
  weighMissed(levels);
  weighDoubt();
  tellImages();
  unsolved_ = unsolved_square_ = 0.0;
  double area = 0.0;
  for (const float a : area_) area += static_cast<double>(a);
  for (auto& half : halves_) {
    double left = 0.0, square = 0.0;
    for (const double residual : half.gmres.residual()) left += residual * std::sqrt(area);
    for (const double error : half.gmres.errorOfShape()) square += error * error;
    if (half.shining > 0.0) unsolved_ = std::max(unsolved_, left / half.shining);
    unsolved_square_ = std::max(unsolved_square_, square);
    half = {};
  }
  light_ = {};
  stage_ = Stage::kDone;
  has_gathered_ = true;
}

/// From what these tell, and not from a solution before: it depends on rays and light alone.
void LeafGather::takeLight(std::size_t h) {
  Half& half = halves_[h];
  const std::size_t leaves = sights_.leafCount();
  half.source.assign(sights_.endCount(), {});
  half.radiosity.assign(sights_.endCount() + sights_.steps(h).size(), {});
  takeSky(h);
  takeMirrors(h);
  half.arriving.assign(leaves, {});
  half.passed.assign(light_.passing.empty() ? 0 : leaves, {});
  std::vector<SourceSum> sums(sides_.size());
  takeSources(h, sums);
  Light shining{};
  double area = 0.0;
  for (const auto& sum : sums) {
    addTo(shining, sum.shining);
    area += sum.area;
  }
  half.shining = shining[0] + shining[1] + shining[2];
  std::array<double, 3> tolerance{};
  for (std::size_t c = 0; c < 3; ++c) {
    // A norm over areas bounds the sum over them (Cauchy and Schwarz).
    if (area > 0.0) tolerance[c] = light_.residual * shining[c] / std::sqrt(area);
  }
  half.gmres.begin(evenLight(h, sums), {area_.begin(), area_.end()}, tolerance, kMaxSweeps, true);
  half.done = false;
}

/// What each end in the sky shines with, and where its cells do, what the rays of each leaf bring of it: the mean over
/// those that end there.
void LeafGather::takeSky(std::size_t h) {
  auto& half = halves_[h];
  const auto first = sights_.firstOfSky(), count = sights_.skyCount();
  const bool has_cells = light_.sky_cells.size() == count;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto& hemisphere = light_.sky[2 * i < count ? 0 : 1];
    for (int c = 0; c < 3; ++c)
      half.source[first + i][static_cast<std::size_t>(c)] =
          hemisphere[c] + (has_cells ? static_cast<double>(light_.sky_cells[i][c]) : 0.0);
  }
  half.sky.clear();  // a solve that was given up may have left that of another sky
  if (!has_cells || lost_[h].empty()) return;
  half.sky.assign(sights_.leafCount(), {});
  inLeaves(sights_.leafCount(), [&](std::size_t v) {
    if (!lost_[h].hasAny(v)) return;
    const auto seen = sights_.seen(h, static_cast<std::uint32_t>(v));
    Light sum{};
    for (const auto end : seen)
      if (sights_.isSky(end)) addTo(sum, half.source[end]);
    for (std::size_t c = 0; c < 3; ++c) half.sky[v][c] = static_cast<float>(sum[c] / static_cast<double>(seen.size()));
  });
}

void LeafGather::average(std::size_t half) {
  averageSeen(sights_, half, halves_[half].radiosity.data(), halves_[half].arriving.data());
}

/// Where rays go on: what the leaf there has but for what rays bring, and what the ray finds. `source`: null for none.
void LeafGather::followSteps(std::size_t half, const std::vector<Light>* source) {
  if (light_.mirrors) return followMirrors(half, source);
  auto& radiosity = halves_[half].radiosity;
  const auto& passed = halves_[half].passed;
  auto to = radiosity.begin() + sights_.endCount();
  for (const auto& step : sights_.steps(half)) {
    const auto& reflectance = light_.reflectance[step.by];
    const auto& next = radiosity[step.next];
    for (std::size_t c = 0; c < 3; ++c) {
      float own = source != nullptr ? static_cast<float>((*source)[step.by][c]) : 0.0F;
      if (!passed.empty()) own += passed[step.by][c];
      (*to)[c] = reflectance[static_cast<int>(c)] * next[c] + own;
    }
    ++to;
  }
}

/// What arrives on the other side of translucent leaves; arriving(leaf value) has it by channel.
template <typename Arriving>
void LeafGather::passOn(std::size_t half, const Arriving& arriving) {
  for (const auto& leaf : light_.passing) {
    const auto& light = arriving(leaf.from);
    for (std::size_t c = 0; c < 3; ++c)
      halves_[half].passed[leaf.to][c] = leaf.transmittance[static_cast<int>(c)] * static_cast<float>(light[c]);
  }
}

void LeafGather::sweep(std::size_t h, RayGmres::Vectors& x, bool affine) {
  Half& half = halves_[h];
  const std::size_t leaves = sights_.leafCount();
  for (std::size_t v = 0; v < leaves; ++v) {
    for (std::size_t c = 0; c < 3; ++c)
      half.radiosity[v][c] = light_.reflectance[v][static_cast<int>(c)] * x[c][v] +
                             (affine ? static_cast<float>(half.source[v][c]) : 0.0F);
  }
  passOn(h, [&](std::uint32_t v) { return std::array{x[0][v], x[1][v], x[2][v]}; });
  for (const auto& leaf : light_.passing) add(half.radiosity[leaf.to], half.passed[leaf.to]);
  for (auto end = leaves; end < half.source.size(); ++end)
    half.radiosity[end] = affine ? rounded(half.source[end]) : Light32{};
  followSteps(h, affine ? &half.source : nullptr);
  average(h);
  for (std::size_t v = 0; v < leaves; ++v) {
    for (std::size_t c = 0; c < 3; ++c) x[c][v] = half.arriving[v][c];
  }
}

void LeafGather::takeSolutions() {
  for (std::size_t h = 0; h < 2; ++h) solved_[h] = halves_[h].gmres.solution();
}

/// What the rays of both halves make of the same light: light that differs is not theirs.
void LeafGather::weighNoise() {
  const std::size_t leaves = sights_.leafCount();
  auto& source = halves_[0].source;  // with the sky; neither half's own is needed any more
  inLeaves(leaves, [&](std::size_t v) {
    for (std::size_t c = 0; c < 3; ++c) {
      source[v][c] = 0.5 * (halves_[0].source[v][c] + halves_[1].source[v][c]);
      const float radiosity = 0.5F * (halves_[0].radiosity[v][c] + halves_[1].radiosity[v][c]);
      halves_[0].radiosity[v][c] = halves_[1].radiosity[v][c] = radiosity;
    }
  });
  meanOfShot();
  for (auto& half : halves_) half.passed.clear();
  for (const auto& leaf : light_.passing) {  // as all that leaves send but do not reflect
    const auto passed = leaf.transmittance * 0.5F * (gathered_[0][leaf.from] + gathered_[1][leaf.from]);
    addTo(source[leaf.to], lightOf(passed));
  }
  std::array<LeafSmoother::Light, 2> arriving;
  inBothHalves([&](std::size_t half) {
    for (auto end = leaves; end < source.size(); ++end) halves_[half].radiosity[end] = rounded(source[end]);
    followSteps(half, &source);
    average(half);
    for (std::size_t c = 0; c < 3; ++c) {
      arriving[half][c].resize(leaves);
      for (std::size_t v = 0; v < leaves; ++v) arriving[half][c][v] = halves_[half].arriving[v][c];
    }
    smoother_->apply(arriving[half]);
  });
  block_noise_.assign((leaves + kBlock - 1) / kBlock, 0.0);
  block_light_ = block_noise_;
  noise_ = smoothed_;
  side_noise_.assign(sides_.size(), 0.0);
  side_light_ = side_noise_;
  std::vector<std::array<double, 2>> squares(leaves);  // of noise and light, times area
  inLeaves(leaves, [&](std::size_t v) {
    double square = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double off = 0.5 * static_cast<double>(arriving[0][c][v] - arriving[1][c][v]);
      square += off * off;
    }
    const glm::dvec3 light(0.5F *
                           (gathered_[0][v] + gathered_[1][v] + light_.irradiance[0][v] + light_.irradiance[1][v]));
    squares[v] = {areaOf(v) * square, areaOf(v) * glm::dot(light, light)};
  });
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v) {
      const auto [noise, light] = squares[v];
      block_noise_[v / kBlock] += noise;
      block_light_[v / kBlock] += light;
      side_noise_[s] += noise;
      side_light_[s] += light;
    }
  }
  for (const double block : block_noise_) noise_ += block;
}

/// What such rays bring from where they end may be the light of another side of a wall, or no light where there is
/// some: after all the leaves that they went on from, of which each took its part. And what came over links to those is
/// known as a mean over each, while it changes within them.
void LeafGather::weighDoubt() {
  doubt_ = 0.0;
  const auto counts = sights_.counts();
  for (std::uint32_t v = 0; v < sights_.leafCount(); ++v) {
    if (lostOf(0, v).doubtful + lostOf(1, v).doubtful <= 0.0F) continue;
    glm::dvec3 brought(0.0);
    for (std::size_t half = 0; half < 2; ++half) {
      for (const auto end : sights_.seen(half, v))
        if (sights_.isDoubtful(half, end)) brought += 0.5 / counts[v] * doubtOf(half, end);
    }
    const double square = glm::dot(brought, brought);
    doubt_ += areaOf(v) * square;
    leaf_bias_[v] += static_cast<float>(square);
  }
}

glm::dvec3 LeafGather::doubtOf(std::size_t half, std::uint32_t end) const {
  glm::dvec3 part(1.0), sum(0.0);
  while (end >= sights_.endCount()) {
    const auto& step = sights_.steps(half)[end - sights_.endCount()];
    end = step.next;
    if (SpecularStep::is(step.by) || PaneStep::is(step.by)) {
      const auto tint = tintOf(step);
      part *= glm::dvec3(tint[0], tint[1], tint[2]);
      continue;
    }
    part *= glm::dvec3(light_.reflectance[step.by]);
    sum += kWithin * part * changeAcross(step.by);
  }
  if (sights_.isMirror(end)) return part * cutOffAt(end);
  const auto& sent = halves_[half].radiosity[end];
  return sum + kUnsure * part * glm::abs(glm::dvec3(sent[0], sent[1], sent[2]));
}

/// What a mirror reflects that ends rays all the same, of which they bring nothing: as if it did so diffusely.
glm::dvec3 LeafGather::cutOffAt(std::uint32_t value) const {
  glm::dvec3 arriving(0.0);
  for (std::size_t half = 0; half < 2; ++half)
    arriving += 0.5 * glm::dvec3(light_.irradiance[half][value] + gathered_[half][value]);
  return glm::dvec3(light_.mirrors->meanReflectance(value)) * glm::abs(arriving);
}

/// By how much what came over links differs beside the leaf, at most; all of it where nothing is beside.
glm::dvec3 LeafGather::changeAcross(std::uint32_t value) const {
  const auto lightOf = [&](std::uint32_t v) {
    return 0.5 * glm::dvec3(light_.irradiance[0][v] + light_.irradiance[1][v]);
  };
  const Side& side = sides_[sights_.sideOf(value)];
  const auto x = (value - side.first_value) % side.width, y = (value - side.first_value) / side.width;
  const auto here = lightOf(value);
  glm::dvec3 most(0.0);
  bool is_alone = true;
  const auto look = [&](bool is_there, std::uint32_t beside) {
    if (!is_there || areaOf(beside) <= 0.0) return;
    is_alone = false;
    most = glm::max(most, glm::abs(lightOf(beside) - here));
  };
  look(x > 0, value - 1);
  look(x + 1 < side.width, value + 1);
  look(y > 0, value - side.width);
  look(y + 1 < side.height, value + side.width);
  return is_alone ? here : most;
}

void LeafGather::save(ArchiveWriter& to) const {
  const auto counts = sights_.counts();
  to(mirrored_lamps_.times(), image_noise_, has_gathered_, std::vector<std::uint16_t>(counts.begin(), counts.end()),
     sights_.partlyInside(), noise_, smoothed_, bias_, doubt_, block_noise_, escaped_, absorbed_, from_sky_,
     mirrored_flux_, spread_, imaged_flux_, unsolved_, unsolved_square_, leaf_bias_, block_light_, side_noise_,
     side_light_);
}

bool LeafGather::restore(ArchiveReader& from) {
  std::vector<std::uint16_t> counts;
  std::vector<bool> partly_inside;
  MirroredLamps::Times times{};
  from(times, image_noise_, has_gathered_, counts, partly_inside, noise_, smoothed_, bias_, doubt_, block_noise_,
       escaped_, absorbed_, from_sky_, mirrored_flux_, spread_, imaged_flux_, unsolved_, unsolved_square_, leaf_bias_,
       block_light_, side_noise_, side_light_);
  const auto fits = [](std::uint16_t count) { return count <= LeafSights::kMostRays; };
  std::size_t all = 0;
  for (const auto count : counts) all += count;
  if (!from.ok() || !MirroredLamps::areTimes(times) || counts.size() != sights_.leafCount() ||
      !std::ranges::all_of(counts, fits) || all * sights_.rayBytes(0) > most_bytes_ ||
      (!partly_inside.empty() && partly_inside.size() != counts.size()) ||
      (!block_noise_.empty() && block_noise_.size() != (counts.size() + kBlock - 1) / kBlock) ||
      block_light_.size() != block_noise_.size() || side_noise_.size() != side_light_.size() ||
      (!block_noise_.empty() && side_noise_.size() != sides_.size()) ||
      (has_gathered_ ? leaf_bias_.size() != counts.size() : !leaf_bias_.empty()))
    return false;
  mirrored_lamps_.setTimes(times);
  sights_.expectPartlyInside(std::move(partly_inside));
  if (all > 0) sights_.ask(counts);
  return true;
}

}  // namespace radiosity::solver
