// Restarted GMRES (Saad and Schultz 1986) around sweeps of Gauss and Seidel: x = G x + g for the three channels at
// once, each a system of its own. A sweep alone gains a digit after 2.3 / (1 - rho) of them; here what converges slowly
// (the level of light in a room of reflectance near one, one unknown a room) is found within a few. In a fixed order:
// the same bits whoever calls, however the calls are spread over time. One thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace radiosity::solver {

/// `Real`: float takes half of the memory, and of the time that it takes to go through it; for tolerances well above
/// 1e-6 of what is solved for, times one less the largest reflectance. Sums over the unknowns are doubles all the same.
template <typename Real>
class Gmres {
 public:
  using Vectors = std::array<std::vector<Real>, 3>;  ///< by channel and unknown
  /// Vectors of each channel that are kept at once, beside three more. No scene of links has needed as many.
  static constexpr std::size_t kRestart = 24;
  /// Replaces x by G x, or by G x + g where `affine`.
  using Sweep = std::function<void(Vectors& x, bool affine)>;

  /// From `start` until the norm of each channel's residual G x + g - x, weighted by `weight`, is at most its
  /// tolerance, or `max_sweeps` are used up. Unknowns of weight 0 are left alone: a sweep must not change them where
  /// `affine`, and finds 0 there otherwise. `always_steps`: also where the start is as good as asked, for error(),
  /// unless a thousandth of that is left.
  void begin(Vectors start, std::vector<Real> weight, const std::array<double, 3>& tolerance, int max_sweeps,
             bool always_steps = false);

  /// Does one sweep. True: solution() is done.
  bool advance(const Sweep& sweep);

  /// The result of the last affine sweep.
  [[nodiscard]] const Vectors& solution() const { return solution_; }
  /// Norm of the residual before the last affine sweep, by channel.
  [[nodiscard]] const std::array<double, 3>& residual() const { return residual_; }
  /// Estimated norm of what was lacking then, by channel: of the error the last step of a cycle left about the part q
  /// that it left of the residual, so that it is what that step added times q / (1 - q). Several times too small where
  /// that step took most of all else and what is left is the level of light. Infinite where no step tells.
  [[nodiscard]] std::array<double, 3> error() const;
  /// Of what is no level of light, what the last affine sweep left: as much again as the last step left of the
  /// residual. For who finds the level otherwise. Too small, ten times now and then, of what one room has more than
  /// the next.
  [[nodiscard]] std::array<double, 3> errorOfShape() const;
  [[nodiscard]] int sweeps() const { return sweeps_; }

 private:
  /// The least squares of one channel, brought up to date column by column by Givens rotations.
  struct Channel {
    std::vector<std::vector<Real>> basis;
    std::vector<std::array<double, kRestart>> triangle;  // by column
    std::array<double, kRestart> cosine{}, sine{};
    std::array<double, kRestart + 1> right{};
    std::size_t columns = 0;
    bool growing = false;
    double step = 0.0, before = 0.0;  ///< what the last column of a cycle added, and the residual before it
  };
  void startCycle();
  void addColumn(std::size_t c, std::vector<Real>& image);
  void endCycle();
  [[nodiscard]] static std::array<double, kRestart> factors(const Channel& channel, std::size_t columns);
  /// Of the residual of a channel, the part that the last step left.
  [[nodiscard]] double left(std::size_t c) const { return residual_[c] / channel_[c].before; }
  [[nodiscard]] double product(const std::vector<Real>& a, const std::vector<Real>& b) const;

  std::vector<Real> weight_;
  std::array<double, 3> tolerance_{}, residual_{};
  Vectors x_, solution_, image_;
  std::array<Channel, 3> channel_;
  int sweeps_ = 0, max_sweeps_ = 0;
  bool in_cycle_ = false, always_steps_ = false;
};

extern template class Gmres<float>;
extern template class Gmres<double>;

}  // namespace radiosity::solver
