// Lamps that are too many for each to be a shooter: every leaf draws a few of them at a time (LightTree), and what all
// of them bring to it is known in the mean, as the links of one shooter. Plain values; one thread outside of measure().
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/solver/lamps/light_tree.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/side.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// What a crowd sends.
struct CrowdLight {
  std::uint64_t key = 0;     ///< of its lamps and of the ratios of their strengths
  glm::vec3 emission{0.0F};  ///< exitance of a lamp of strength 1, lm/m^2; 0: all are dark
  double area = 0.0;         ///< sum of strengths times areas, unit box squared

  [[nodiscard]] bool isDark() const { return emission == glm::vec3(0.0F); }
};

/// Lamps of one colour, whose strengths differ, or what many lamps emit in one channel.
struct Crowd : CrowdLight {
  std::shared_ptr<const LightTree> lamps;  ///< null: it has been dark since before the solver was restored
};

/// So many lamps are worth being shooters each, whatever they send, as far as memory for their links goes.
[[nodiscard]] std::size_t fewLights(std::size_t leaves, std::size_t link_memory);

/// Which lamps are worth being shooters, in the order of `lights`, and the crowds of all others. Where there are no
/// more than `few`, all are. O(n log^2 n), and O(n) where the crowds are `known`: their trees are taken from there.
struct DividedLights {
  std::vector<LightPolygon> shooters;
  std::vector<Crowd> crowds;
};
[[nodiscard]] DividedLights divideLights(std::vector<LightPolygon> lights, std::size_t few,
                                         std::span<const Crowd> known = {});

/// A sample of the links of a crowd, taken in slices: what arrives at every leaf for an emission of 1.
class CrowdSample {
 public:
  /// Lamps that a leaf draws for it, all from one place.
  static constexpr std::uint32_t kDraws = geometry::kPacket;

  /// Of a half, and which of its samples: together they are spread evenly. All are to outlive it.
  CrowdSample(const scene::PatchScene& patches, const std::vector<Side>& sides, const LeafRays& rays,
              std::uint64_t seed, Crowd crowd, std::size_t half, std::uint32_t index);

  [[nodiscard]] bool isOf(const Crowd& crowd, std::size_t half, std::uint32_t index) const {
    return crowd_.key == crowd.key && half_ == half && index_ == index;
  }
  enum class Leaves { kAll, kSome };
  /// Goes on for about `seconds`, on all cores. True: it is done, or, of kSome, in a hurry: one leaf of each block of
  /// 8 by 8 is, which come first. Where the cuts lie changes no bit.
  [[nodiscard]] bool advance(double seconds, Leaves leaves = Leaves::kAll);
  [[nodiscard]] bool isWhole() const { return done_ == order_.size(); }
  /// When it is done; some thousand rays more. Leaves that are not done are as the one of their block that is.
  [[nodiscard]] LinkSample links() const;

  /// What all of it takes, in microseconds of one core; only ratios count.
  [[nodiscard]] static double cost(std::size_t leaves) { return 1.0 * kDraws * static_cast<double>(leaves); }

 private:
  class Receiver;
  void orderLeaves();
  template <typename Visit>
  void forBlocks(Visit visit) const;
  [[nodiscard]] float arriving(std::uint32_t value) const;
  [[nodiscard]] std::vector<float> filled() const;
  void findLost(LinkSample& links) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  const LeafRays& rays_;
  Crowd crowd_;
  std::size_t half_;
  std::uint32_t index_;
  std::uint64_t key_;
  std::vector<float> values_;         ///< by leaf value
  std::vector<std::uint32_t> order_;  ///< leaf values: one of each block, then all others
  std::size_t some_ = 0, done_ = 0;   ///< of these
};

}  // namespace radiosity::solver
