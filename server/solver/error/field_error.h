// What two independent solutions of the same field say about its error. Plain values; one thread.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// Sums over all leaves and channels, weighted by area; `first` and `second` are the halves' irradiances.
class FieldError {
 public:
  explicit FieldError(const scene::PatchScene& patches) : patches_(patches) {}

  void addSide(const Side& side, std::span<const glm::vec3> first, std::span<const glm::vec3> second);
  /// Of other leaves.
  void add(const FieldError& other);

  /// Area-weighted sum of the squares of the mean of the halves.
  [[nodiscard]] double square() const { return square_; }
  /// Half the difference of the halves: relative RMS sampling error of their mean.
  [[nodiscard]] double sampling() const;
  /// Leaf against the bilinear interpolation of its parents, a third of it (interpolation is of second order).
  [[nodiscard]] double discretization() const;

 private:
  const scene::PatchScene& patches_;
  double square_ = 0.0, spread_ = 0.0;     // over all leaves
  double bent_ = 0.0, bent_square_ = 0.0;  // over leaves with four parents
};

}  // namespace radiosity::solver
