#include "server/solver/math/gmres.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/clones.h"

namespace radiosity::solver {
namespace {

/// A cycle aims a little lower than asked: rounding makes its true residual, checked afterwards, larger than it knows.
constexpr double kAim = 0.95;
/// Steps take more of the residual than of the error where the level of light converges last: in a room of reflectance
/// 0.99 four in ten leave more than the estimate says, one in four more than this many times as much.
constexpr double kDoubt = 2.0;
/// A start whose residual is so small a part of what is asked is the solution.
constexpr double kNoStep = 1e-3;
/// What is left of a vector when so small a part of it is, is rounding.
template <typename Real>
constexpr double kRounding = 45.0 * std::numeric_limits<Real>::epsilon();

/// Sum of w a b, in the order of so many lanes whichever processor adds them: one sum after the other waits for each.
/// In double: squares of what is small are beyond single precision.
template <typename Real>
__attribute__((always_inline)) inline double sumOfProducts(const Real* w, const Real* a, const Real* b,
                                                           std::size_t count) {
  constexpr std::size_t kLanes = 16;
  const auto product = [&](std::size_t i) {
    return static_cast<double>(w[i]) * static_cast<double>(a[i]) * static_cast<double>(b[i]);
  };
  std::array<double, kLanes> sums{};
  const std::size_t whole = count - count % kLanes;
  for (std::size_t i = 0; i < whole; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) sums[k] += product(i + k);
  }
  double sum = 0.0;
  for (const double lane : sums) sum += lane;
  for (std::size_t i = whole; i < count; ++i) sum += product(i);
  return sum;
}
RADIOSITY_CLONES double weightedProduct(const double* w, const double* a, const double* b, std::size_t count) {
  return sumOfProducts(w, a, b, count);
}
RADIOSITY_CLONES double weightedProduct(const float* w, const float* a, const float* b, std::size_t count) {
  return sumOfProducts(w, a, b, count);
}

/// to += factor from.
RADIOSITY_CLONES void addScaled(double factor, const double* from, double* to, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) to[i] += factor * from[i];
}
RADIOSITY_CLONES void addScaled(float factor, const float* from, float* to, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) to[i] += factor * from[i];
}

}  // namespace

template <typename Real>
double Gmres<Real>::product(const std::vector<Real>& a, const std::vector<Real>& b) const {
  return weightedProduct(weight_.data(), a.data(), b.data(), a.size());
}

template <typename Real>
void Gmres<Real>::begin(Vectors start, std::vector<Real> weight, const std::array<double, 3>& tolerance, int max_sweeps,
                        bool always_steps) {
  x_ = std::move(start);
  always_steps_ = always_steps;
  weight_ = std::move(weight);
  tolerance_ = tolerance;
  max_sweeps_ = max_sweeps;
  sweeps_ = 0;
  in_cycle_ = false;
  for (auto& channel : channel_) channel.step = channel.before = 0.0;
}

template <typename Real>
bool Gmres<Real>::advance(const Sweep& sweep) {
  ++sweeps_;
  if (!in_cycle_) {
    solution_ = x_;
    sweep(solution_, true);
    startCycle();
    const bool done = std::none_of(channel_.begin(), channel_.end(), [](const Channel& c) { return c.growing; });
    return done || sweeps_ >= max_sweeps_;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    if (channel_[c].growing) {
      image_[c] = channel_[c].basis.back();
    } else {
      image_[c].assign(weight_.size(), Real{0});
    }
  }
  sweep(image_, false);
  for (std::size_t c = 0; c < 3; ++c) {
    if (channel_[c].growing) addColumn(c, image_[c]);
  }
  if (std::none_of(channel_.begin(), channel_.end(), [](const Channel& c) { return c.growing; })) endCycle();
  return false;
}

/// Measures the residual; a channel that is not done gets it as the first vector of its basis.
template <typename Real>
void Gmres<Real>::startCycle() {
  for (std::size_t c = 0; c < 3; ++c) {
    Channel& channel = channel_[c];
    auto& residual = image_[c];
    residual.resize(weight_.size());
    for (std::size_t i = 0; i < residual.size(); ++i)
      residual[i] = weight_[i] > Real{0} ? solution_[c][i] - x_[c][i] : Real{0};
    residual_[c] = std::sqrt(product(residual, residual));
    channel.basis.clear();
    channel.triangle.clear();
    channel.columns = 0;
    const double enough = always_steps_ && sweeps_ == 1 ? kNoStep * tolerance_[c] : tolerance_[c];
    // What is no number any more will not become one.
    channel.growing = residual_[c] > enough && std::isfinite(residual_[c]);
    if (!channel.growing) continue;
    const auto scale = static_cast<Real>(1.0 / residual_[c]);
    for (auto& value : residual) value *= scale;
    channel.right = {};
    channel.right[0] = residual_[c];
    channel.basis.push_back(std::move(residual));
  }
  in_cycle_ = true;
}

/// `image` is G v of the last basis vector v; the operator of the equation is v - G v.
template <typename Real>
void Gmres<Real>::addColumn(std::size_t c, std::vector<Real>& image) {
  Channel& channel = channel_[c];
  const std::size_t k = channel.columns++;
  const auto& last = channel.basis.back();
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = weight_[i] > Real{0} ? last[i] - image[i] : Real{0};
  channel.triangle.resize(k + 1);
  auto& column = channel.triangle[k];
  const double before = std::sqrt(product(image, image));
  for (std::size_t j = 0; j <= k; ++j) {
    column[j] = product(channel.basis[j], image);
    addScaled(static_cast<Real>(-column[j]), channel.basis[j].data(), image.data(), image.size());
  }
  double length = std::sqrt(product(image, image));
  if (!(length > kRounding<Real> * before)) length = 0.0;  // the basis holds the solution
  for (std::size_t j = 0; j < k; ++j) {
    const double upper = channel.cosine[j] * column[j] + channel.sine[j] * column[j + 1];
    column[j + 1] = channel.cosine[j] * column[j + 1] - channel.sine[j] * column[j];
    column[j] = upper;
  }
  const double diagonal = std::hypot(column[k], length);
  channel.cosine[k] = diagonal > 0.0 ? column[k] / diagonal : 1.0;
  channel.sine[k] = diagonal > 0.0 ? length / diagonal : 0.0;
  column[k] = diagonal;
  channel.right[k + 1] = -channel.sine[k] * channel.right[k];
  channel.right[k] *= channel.cosine[k];
  channel.growing = length > 0.0 && channel.columns < kRestart && sweeps_ + 1 < max_sweeps_ &&
                    std::abs(channel.right[k + 1]) > kAim * tolerance_[c];
  if (!channel.growing) return;
  const auto scale = static_cast<Real>(1.0 / length);
  for (auto& value : image) value *= scale;
  channel.basis.push_back(std::move(image));
}

/// Of so many basis vectors, the combination that leaves the least residual.
template <typename Real>
std::array<double, Gmres<Real>::kRestart> Gmres<Real>::factors(const Channel& channel, std::size_t columns) {
  std::array<double, kRestart> factor{};
  for (std::size_t j = columns; j-- > 0;) {
    double rest = channel.right[j];
    for (std::size_t k = j + 1; k < columns; ++k) rest -= channel.triangle[k][j] * factor[k];
    // A column of zeros: G leaves something as it is, light that nothing takes away.
    factor[j] = channel.triangle[j][j] > 0.0 ? rest / channel.triangle[j][j] : 0.0;
  }
  return factor;
}

/// Adds what leaves the least residual.
template <typename Real>
void Gmres<Real>::endCycle() {
  for (std::size_t c = 0; c < 3; ++c) {
    Channel& channel = channel_[c];
    const auto last = channel.columns;
    if (last == 0) {  // was done before
      x_[c] = solution_[c];
      continue;
    }
    const auto factor = factors(channel, last), without_last = factors(channel, last - 1);
    channel.step = 0.0;
    for (std::size_t j = last; j-- > 0;) {
      addScaled(static_cast<Real>(factor[j]), channel.basis[j].data(), x_[c].data(), x_[c].size());
      channel.step = std::hypot(channel.step, factor[j] - without_last[j]);
    }
    channel.before = std::hypot(channel.right[last - 1], channel.right[last]);
  }
  in_cycle_ = false;
}

template <typename Real>
std::array<double, 3> Gmres<Real>::error() const {
  std::array<double, 3> error{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto& channel = channel_[c];
    if (residual_[c] == 0.0) continue;
    const double q = left(c);
    const double by_step =
        q < 1.0 && channel.step > 0.0 ? channel.step * q / (1.0 - q) : std::numeric_limits<double>::infinity();
    error[c] = std::max(residual_[c], kDoubt * by_step);
  }
  return error;
}

template <typename Real>
std::array<double, 3> Gmres<Real>::errorOfShape() const {
  auto error = this->error();
  for (std::size_t c = 0; c < 3; ++c) {
    if (error[c] > 0.0 && std::isfinite(error[c])) error[c] *= std::min(1.0, left(c));
  }
  return error;
}

template class Gmres<float>;
template class Gmres<double>;

}  // namespace radiosity::solver
