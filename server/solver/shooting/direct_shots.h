// Direct light where links are forgotten: what the light polygons send in a round, as gathered shots. Weak lights of
// many take turns, so that a round of thousands takes no longer than one of hundreds. Owned by ShootingSolver; one
// thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/solver/patches/lights.h"
#include "server/solver/shooting/planner.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// In each half a light shoots in one round of a cycle, and then for all of the cycle: whatever shoots in a round
/// stands for what does not, and at the end of a cycle each has sent exactly what it emits.
struct ShotLight : LightPolygon {
  std::uint32_t cycle = 1;                ///< rounds
  std::array<std::uint32_t, 2> turn{};    ///< by half: in which of them it shoots, from 0 on
  std::array<glm::dvec3, 2> delivered{};  ///< by half: exitance gathered so far, summed over rounds

  /// What a half still owes up to this round, exitance summed over rounds; signed.
  [[nodiscard]] glm::dvec3 undelivered(std::uint32_t rounds, std::size_t half) const {
    const auto due = (rounds + cycle - 1 - turn[half]) / cycle * cycle;
    return static_cast<double>(due) * glm::dvec3(emission) - delivered[half];
  }
};

class DirectShots {
 public:
  /// `leaves` of the scene, which each shot asks.
  DirectShots(const PlannerSettings& settings, std::size_t leaves);

  /// The lights that there are now. Those that were there before and are no more take back what they sent.
  void take(const std::vector<LightPolygon>& lights);
  /// All that is owed up to this round is due.
  void startRound(std::uint32_t rounds);
  [[nodiscard]] bool isDue() const { return next_ < 2 * lights_.size(); }
  /// The next shots, some tenths of a second of them, from fresh points; their lights are marked as having delivered
  /// them. `flux`: what they carry is added, by channel.
  [[nodiscard]] ShotBatch next(std::array<double, 3>& flux);
  /// Flux that is still to be sent in this round, all channels.
  [[nodiscard]] double owed() const;

  [[nodiscard]] const std::vector<ShotLight>& lights() const { return lights_; }
  /// Whether what visit() read can be gone on with.
  [[nodiscard]] bool isWhole() const {
    return std::ranges::all_of(lights_, [](const ShotLight& light) { return light.cycle > 0; });
  }

  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.lights_, self.due_power_, self.rounds_, self.next_, self.gather_rounds_);
  }

 private:
  void takeTurns(std::vector<ShotLight> lights);
  [[nodiscard]] double powerOf(const ShotLight& light, std::size_t half) const;
  void addShot(const ShotLight& light, std::uint32_t half, std::uint32_t shot, std::uint32_t shots,
               std::uint32_t points, ShotBatch& batch) const;

  PlannerSettings settings_;
  std::size_t leaves_;
  std::vector<ShotLight> lights_;
  std::array<double, 2> due_power_{};  ///< by half, when the round began
  std::uint32_t rounds_ = 1;
  std::uint64_t next_ = 0;  ///< of lights and their halves
  std::uint32_t gather_rounds_ = 0;
};

}  // namespace radiosity::solver
