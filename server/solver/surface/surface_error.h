// The error that people see: how far bilinear lookups in lightmaps are off at random places of surfaces, whatever it is
// by -- noise, light that is still to be shot, or texels that are too wide. Owned by whoever solves; one thread outside
// of the calls.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// Relative to the RMS of irradiance over all places and channels.
struct SurfaceErrorParts {
  double total = 0.0;      ///< RMS over places and channels
  double deviation = 0.0;  ///< standard deviation of that, as far as the places tell
  double p95 = 0.0;        ///< of 95 % of places it is less, each relative to its own light (or to 1 % of the mean)
  std::size_t places = 0;
};

class SurfaceError {
 public:
  static constexpr std::size_t kPlaces = 2048;
  /// So many rounds of kPlaces at most, until the total is known well enough.
  static constexpr std::uint32_t kMostRounds = 8;

  /// Places are spread over all that has texels: half of them by area, half where lookups are likelier to be off, since
  /// light changes from leaf to leaf, or something stands on them; each counts as what it stands for. By area alone one
  /// place beside the leg of a chair was two thirds of all that was found in a room. `seed`: the same gives the same.
  /// Throws std::bad_alloc.
  SurfaceError(const SolvedScene& solved, std::uint64_t seed, std::size_t places = kPlaces);

  /// Where lookups are to be made, for all rounds.
  struct Lookup {
    std::uint32_t surface = 0, side = 0;
    glm::vec2 texel{0.0F};
  };
  [[nodiscard]] std::vector<Lookup> lookups() const;
  /// More places are measured while the total is likely to be off by more than this, and by more than an eighth of
  /// itself.
  void setWantedDeviation(double deviation) { wanted_deviation_ = deviation; }
  /// There is no time for another round.
  void hurry() { most_rounds_ = std::min(most_rounds_, rounds_ + 1); }
  /// What they find, lux, in that order. Before advance().
  void take(std::vector<glm::vec3> found) { found_ = std::move(found); }

  /// Goes on for about `seconds`, on all cores. Throws std::bad_alloc, and may be called again then. True: it is done.
  /// Where the cuts lie changes no bit. Cost: PlaceLight, twice a place and round; a quarter of a second on two cores
  /// in a room of a thousand triangles, a round.
  [[nodiscard]] bool advance(double seconds);
  /// When it is done: what was found at each place that was measured, in the order of lookups().
  struct Measured {
    Lookup lookup;
    double square = 0.0;  ///< of what the lookup is off by, all channels, lux^2: below zero by chance
    double area = 0.0;    ///< that the place stands for, unit box squared
  };
  [[nodiscard]] std::vector<Measured> measured() const;
  /// When it is done. Where there is no light all is zero, or one where lookups find some.
  [[nodiscard]] SurfaceErrorParts stated() const;

 private:
  [[nodiscard]] double percentile(std::span<const std::array<double, 2>> weights, double floor) const;
  [[nodiscard]] Lookup lookupAt(std::size_t place) const;
  void addSlice();
  [[nodiscard]] bool isSure() const;
  /// Irradiance, lux: one of the two estimates of a place.
  [[nodiscard]] const glm::dvec3& trueLight(std::size_t place, std::size_t estimate) const {
    return light_at_[place][estimate];
  }
  /// Of all rounds that are whole.
  [[nodiscard]] std::size_t placeCount() const { return rounds_ > 0 ? round_ends_[rounds_ - 1] : 0; }
  [[nodiscard]] bool isWhole() const { return rounds_ > 0 && done_ == placeCount(); }

  PlaceLight light_;
  std::uint64_t seed_;
  std::vector<PlaceLight::Spot> spots_;
  std::vector<double> stands_for_;  ///< unit box squared, by place, of its round alone
  std::vector<std::size_t> round_ends_;
  std::vector<glm::vec3> found_;
  std::vector<std::array<glm::dvec3, 2>> light_at_;  ///< two independent estimates, by place
  std::size_t done_ = 0;                             ///< places
  std::uint32_t rounds_ = 0, most_rounds_ = kMostRounds;
  bool is_done_ = false;
  double wanted_deviation_ = 1.0;
};

}  // namespace radiosity::solver
