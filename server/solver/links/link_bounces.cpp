// How LinkSystem solves for all bounces: in slices, each half in its own thread.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "common/clones.h"
#include "server/solver/links/link_system.h"
#include "server/solver/math/halves.h"

namespace radiosity::solver {
namespace {

/// The residual that is left, of all flux that shines: far below any sampling error.
constexpr double kSolved = 1e-6;
/// Some ten are usual. More only where light passes to and fro between very many pairs of surfaces that all but touch.
constexpr int kMaxSweeps = 400;
/// No more flux than this many times what is emitted can be on its way (reflectance is at most 0.9999).
constexpr double kMostInterreflection = 1e5;
/// Noise makes single nodes a little darker than black; so much of all light it never is.
constexpr double kMostDarkness = 0.05;
/// Leaves whose links are looked at between two looks at the clock.
constexpr std::size_t kLeavesAtOnce = std::size_t{1} << 21U;
/// Columns whose entries are found together: as many as lie in a line of the cache or two.
constexpr std::uint32_t kColumnsAtOnce = 32;
constexpr std::size_t kLanes = 8;

/// Sum of products in kLanes partial sums, so that it vectorises with the same bits everywhere. In double precision:
/// where reflectance is near one, what matters is the small difference of large sums.
RADIOSITY_CLONES double dotDouble(const float* row, const double* x, std::size_t count) {
  double sum[kLanes] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) sum[k] += static_cast<double>(row[i + k]) * x[i + k];
  }
  double rest = 0.0;
  for (; i < count; ++i) rest += static_cast<double>(row[i]) * x[i];
  for (std::size_t k = 0; k < kLanes; ++k) rest += sum[k];
  return rest;
}

}  // namespace

int LinkSystem::solve() {
  begin();
  while (!advance(HUGE_VAL)) {
  }
  return std::max(halves_[0].sweeps, halves_[1].sweeps);
}

void LinkSystem::begin() {
  updateMeans();
  makeRows();
  next_column_ = 0;
  for (auto& half : halves_) half = {std::move(half.matrix), {}, {}, {}, {}, 0.0, 0, 0, 0.0, false};
}

bool LinkSystem::advance(double seconds) {
  const auto start = std::chrono::steady_clock::now();
  const auto inTime = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < seconds;
  };
  const auto count = static_cast<std::uint32_t>(shooters_.size());
  while (next_column_ < count) {
    const auto chunk = static_cast<std::uint32_t>(kLeavesAtOnce / std::max<std::size_t>(1, leaf_area_.size()) + 1);
    const auto last = std::min(count, next_column_ + chunk);
    inBothHalves([&](std::size_t h) {
      for (auto n = next_column_; n < last; n += kColumnsAtOnce)
        updateColumns(h, n, std::min(last, n + kColumnsAtOnce));
    });
    next_column_ = last;
    if (next_column_ == count) {
      known_ = count;
      for (auto& changed : changed_) std::fill(changed.begin(), changed.end(), false);
      no_row_.clear();
      for (std::size_t h = 0; h < 2; ++h) beginHalf(h);
    }
    if (!inTime()) return false;
  }
  inBothHalves([&](std::size_t h) {
    while (!halves_[h].done) {
      advanceHalf(h);
      if (!inTime()) return;
    }
  });
  return halves_[0].done && halves_[1].done;
}

/// From what was sent before.
void LinkSystem::beginHalf(std::size_t h) {
  Half& half = halves_[h];
  const std::size_t count = shooters_.size();
  half.shining = {};
  half.area = 0.0;
  std::vector<double> area(count, 0.0);
  Gmres<double>::Vectors start;
  for (auto& channel : start) channel.resize(count);
  for (std::size_t n = 0; n < count; ++n) {
    const Shooter& shooter = shooters_[n];
    if (!shooter.isLight()) half.area += area[n] = shooter.area;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto i = static_cast<int>(c);
      start[c][n] = static_cast<double>(shooter.sent[h][i]);
      half.shining[c] += shooter.area * (shooter.isLight() ? start[c][n] : static_cast<double>(emission_mean_[n][i]));
    }
  }
  std::array<double, 3> tolerance{};
  for (std::size_t c = 0; c < 3; ++c) {
    // A norm over areas bounds the sum over them (Cauchy and Schwarz).
    if (half.area > 0.0) tolerance[c] = kSolved * half.shining[c] / std::sqrt(half.area);
    if (half.shining[c] == 0.0) start[c].assign(count, 0.0);
  }
  for (auto* vectors : {&half.sent, &half.mean}) {
    for (auto& channel : *vectors) channel.assign(count, 0.0);
  }
  half.gmres.begin(std::move(start), std::move(area), tolerance, kMaxSweeps);
}

/// One sweep. Weights above one, of weak shooters that stand for others, can make light grow without end between
/// surfaces that all but touch, which send most of what they have to each other. Then all weights are at most one: a
/// little light is missing, which the balance of energy shows.
void LinkSystem::advanceHalf(std::size_t h) {
  Half& half = halves_[h];
  const bool solved = half.gmres.advance([&](Gmres<double>::Vectors& x, bool affine) { sweep(h, x, affine); });
  ++half.sweeps;
  if (!solved) return;
  if (isPhysical(half)) {
    take(h);
  } else if (half.attempt++ == 0) {
    lowerWeights(h, 1.0);
    beginHalf(h);
  } else {
    lowerWeights(h, 0.0);  // not even that: direct light is all that is sure
    half.done = true;
  }
}

void LinkSystem::lowerWeights(std::size_t half, double most) {
  for (auto& shooter : shooters_) {
    if (shooter.isLight()) continue;
    shooter.weight[half] = std::min(shooter.weight[half], most);
    shooter.mean[half] = shooter.sent[half] = glm::vec3(0.0F);
  }
}

/// Light that would grow without end has a solution of the equation too, but no positive one (Perron and Frobenius:
/// the part that grows sends more than it gets, so it would have to be darker than black).
bool LinkSystem::isPhysical(const Half& half) const {
  double shining = 0.0, area = 0.0, bright = 0.0, dark = 0.0, darkest = 0.0;  // all channels
  for (std::size_t c = 0; c < 3; ++c) {
    shining += half.shining[c];
    for (std::size_t m = 0; m < shooters_.size(); ++m) {
      if (shooters_[m].isLight()) continue;
      const double mean = half.mean[c][m];
      if (!std::isfinite(mean)) return false;
      (mean > 0.0 ? bright : dark) += shooters_[m].area * std::abs(mean);
      area += shooters_[m].area;
      darkest = std::max(darkest, -mean);
    }
  }
  return bright <= kMostInterreflection * shining && dark <= kMostDarkness * bright && darkest * area <= bright;
}

void LinkSystem::take(std::size_t h) {
  Half& half = halves_[h];
  for (std::size_t n = 0; n < shooters_.size(); ++n) {
    Shooter& shooter = shooters_[n];
    if (shooter.isLight()) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      shooter.mean[h][static_cast<int>(c)] = static_cast<float>(half.mean[c][n]);
      shooter.sent[h][static_cast<int>(c)] = static_cast<float>(half.gmres.solution()[c][n]);
    }
  }
  half.unsolved = 0.0;
  for (std::size_t c = 0; c < 3; ++c) {
    if (half.shining[c] > 0.0)
      half.unsolved = std::max(half.unsolved, half.gmres.residual()[c] * std::sqrt(half.area) / half.shining[c]);
  }
  half.done = true;
}

double LinkSystem::unsolved() const { return std::max(halves_[0].unsolved, halves_[1].unsolved); }

/// Of Gauss and Seidel. Where not `affine` nothing shines, and there is 0 where lights would be.
void LinkSystem::sweep(std::size_t h, Gmres<double>::Vectors& x, bool affine) {
  Half& half = halves_[h];
  const std::size_t count = shooters_.size();
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t n = 0; n < count; ++n) half.sent[c][n] = shooters_[n].carried(h) * x[c][n];
  }
  for (std::size_t m = 0; m < count; ++m) {
    const auto& shooter = shooters_[m];
    if (shooter.isLight()) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto i = static_cast<int>(c);
      const auto& row = rows_[m];
      const float* links = half.matrix[row.count == 1 ? row.first : row.first + c].data();
      double mean = dotDouble(links, half.sent[c].data(), count);
      if (row.count == 1) mean *= static_cast<double>(reflectance_mean_[m][i]);
      if (affine) mean += static_cast<double>(emission_mean_[m][i]);
      half.mean[c][m] = x[c][m] = mean;
      half.sent[c][m] = shooter.carried(h) * x[c][m];
    }
  }
}

}  // namespace radiosity::solver
