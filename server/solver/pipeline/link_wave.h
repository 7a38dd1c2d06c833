// A wave: samples of shooters that were planned together (LinkPlanner), and are measured one after the other, in
// slices. Lamps and nodes by the transport, many at once; lights without extent and crowds of lamps one by one. Owned
// by LinkedSolver; one thread.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "common/result.h"
#include "server/solver/lamps/crowd.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/links/link_planner.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/repair/repair.h"

namespace radiosity::solver {

class LinkWave {
 public:
  /// Lights that are no polygons, by their numbers in Shooter. To outlive it.
  struct Lamps {
    const PunctualLights& punctual;
    const std::vector<PunctualLights::Source>& sources;
    const std::vector<Crowd>& crowds;
  };
  /// Makes them when they are asked for first.
  using RaysOf = std::function<std::shared_ptr<const LeafRays>()>;
  /// Nothing is wanted. `slice`: in measurements.
  LinkWave(const LinkParts& parts, const Lamps& lamps, RaysOf rays, SliceLength slice)
      : parts_(parts), lamps_(lamps), rays_(std::move(rays)), slice_(slice) {}

  void begin(std::vector<Measurement> wanted);
  /// What was not measured will be asked for again.
  void clear() { begin({}); }
  [[nodiscard]] std::span<const Measurement> wanted() const { return wanted_; }
  [[nodiscard]] bool isMeasured() const { return measured_ == wanted_.size(); }

  /// Measures the next of it: short, so that an edit, a pause or the end of the server need not wait for all. Where the
  /// cuts lie, which depends on time, changes no bit. Errors: the transport's.
  [[nodiscard]] Result<void> advance(TransportCounters& counters);
  /// What has not been measured is not wanted any more.
  void endHere() { wanted_.resize(measured_); }
  /// Its time is over: of what has not been measured only crowds without which most of the light may be missing stay,
  /// and in haste they take less than one other measurement. False: nothing was measured, and nothing would be.
  [[nodiscard]] bool endInHaste();
  /// Once it is measured, and there is time again. True: what was measured in haste is forgotten.
  [[nodiscard]] bool forgetRough();

  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.wanted_, self.measured_, self.in_haste_, self.rough_);
  }
  /// After visit(): whether all of it is of shooters that there are.
  [[nodiscard]] bool fits() const;

 private:
  [[nodiscard]] bool isSource(const Measurement& want) const;
  [[nodiscard]] bool isFirstOfCrowd(const Measurement& want) const;
  [[nodiscard]] bool measureCrowd(const Measurement& want, TransportCounters& counters);
  [[nodiscard]] Result<void> measureSource(const Measurement& want, TransportCounters& counters);
  [[nodiscard]] Result<void> measureShots(TransportCounters& counters);
  void putOff(std::span<Measurement> slice, std::span<const Measurement* const> order, std::size_t taken);

  const LinkParts& parts_;
  Lamps lamps_;
  RaysOf rays_;
  std::vector<Measurement> wanted_;
  std::size_t measured_ = 0;
  bool in_haste_ = false;                      // its time is over
  std::vector<Measurement> rough_;             // what was measured of crowds in haste
  std::unique_ptr<CrowdSample> crowd_sample_;  // under way; null: it has not begun
  SliceLength slice_;
};

}  // namespace radiosity::solver
