// What lamps bring to probes straight, in spherical harmonics: for each lamp, or for some that shine alike, what an
// emission of one brings, found once and kept, so that other colours need no further look. Owned by whoever has the
// probes; one thread outside of the calls.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/probes/probe_rays.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// A lamp, by index into what PlaceLight has; sources come after surfaces.
struct ProbeEmitter {
  std::uint32_t index = 0;
  std::uint64_t key = 0;  ///< changes with its place and shape
  glm::dvec3 light{1.0};  ///< what its harmonics are told for: one, or, in a group of many colours, its own
};

class ProbeLamps {
 public:
  /// Independent of each other; their scatter tells the variance.
  static constexpr std::uint32_t kRounds = ProbeRays::kRounds;
  /// Points of a lamp that each of them looks at.
  static constexpr std::uint32_t kLooks = 4;

  /// `places`: unit box. `in_all`: probes of all that share kMostBytes. The same key gives the same bits, whatever the
  /// number of threads.
  ProbeLamps(std::vector<glm::dvec3> places, std::uint64_t key, std::size_t in_all)
      : places_(std::move(places)), key_(key), in_all_(in_all) {}

  /// Takes the lamps of `light`, of the same scene, in. Cost: kRounds kLooks shadow rays a probe for each lamp that is
  /// new, or was moved; of more than kFew lamps in one group kDraws of them in each round instead, drawn by what they
  /// bring. On all cores. Throws what interrupts the task (task.h), and std::bad_alloc.
  void update(const PlaceLight& light);
  /// Adds what arrives at a probe by these lamps.
  void addTo(std::size_t probe, ProbeSums& sums) const;
  /// Groups that were looked for by all calls of update().
  [[nodiscard]] std::uint64_t taken() const { return taken_; }

 private:
  /// Of a group, lamps that are looked at each by itself.
  static constexpr std::size_t kFew = 16;
  static constexpr std::uint32_t kDraws = 16;
  /// Of all columns of `in_all` probes, those of lamps that were switched off included; one column there may be always.
  static constexpr std::size_t kMostBytes = std::size_t{128} << 20, kMostColumns = 32;

  /// Mean and variance, by channel, of each coefficient.
  using Coefficients = std::array<std::array<glm::vec3, kHarmonics>, 2>;
  struct Column {
    std::uint64_t key = 0;
    glm::dvec3 light{0.0};  ///< what the coefficients are multiplied by
    std::vector<Coefficients> of_probe;
  };
  struct Group {
    Column column;
    std::vector<ProbeEmitter> emitters;
  };
  [[nodiscard]] std::size_t mostColumns() const;
  [[nodiscard]] std::size_t mostSpare() const { return mostColumns() / 2; }
  [[nodiscard]] std::vector<Group> groupsOf(const PlaceLight& light) const;
  void look(const PlaceLight& light, Group& group) const;
  [[nodiscard]] Coefficients lookFrom(const PlaceLight& light, const Group& group, std::size_t probe) const;

  std::vector<glm::dvec3> places_;
  std::uint64_t key_;
  std::size_t in_all_;
  std::vector<Column> columns_;
  std::vector<Column> spare_;  ///< of lamps that were switched off last
  std::uint64_t taken_ = 0;
};

}  // namespace radiosity::solver
