// A stage of the gathered solve. After an edit of geometry it measures again, with the same points as before, what
// links the edit may have changed: those that matter before light is shown, and the others when there is nothing else
// to do. Hundreds of shooters send next to nothing past what changed: with their links as they were before, the light
// is wrong by a small part of the target, which is stated.
//
// Lights look again with some of their points first, and with as many more as the shadows need. Most edits change
// little of the light of a lamp, and each of its looks takes as long as several others.
//
// Owned by LinkedSolver; one thread. Is not saved: a solve that lacks links is none to go on from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/result.h"
#include "server/solver/edits/change_reach.h"
#include "server/solver/repair/repair.h"
#include "server/solver/repair/repair_batch.h"
#include "server/solver/repair/rough_lights.h"

namespace radiosity::solver {

class EditRepair {
 public:
  /// Nothing is to be repaired. `slice`: in repairs.
  EditRepair(const LinkParts& parts, RoughLights::RaysOf rays, SliceLength slice);
  EditRepair(const EditRepair&) = delete;
  EditRepair& operator=(const EditRepair&) = delete;

  /// What was changed; before add() and plan().
  [[nodiscard]] EditShadows& shadows() { return shadows_; }
  [[nodiscard]] const EditShadows& shadows() const { return shadows_; }
  /// Goes on counting from what the solver before the edit counted.
  void countFrom(const EditRepair& former) { counters_ = former.counters_; }
  /// A column that may have changed; both halves of a shooter follow each other.
  void add(const Repair& repair) { repairs_.push_back(repair); }
  /// Those that were added from there on, before plan().
  [[nodiscard]] std::span<const Repair> added(std::size_t first = 0) const {
    return std::span(repairs_).subspan(first);
  }
  /// Leaves what is needed of those that were added, makes room for what it may bring, and says what comes first.
  /// `norm`: of the irradiance before the edit, or 0: not known. `error`: of that solve, all but what waited there.
  void plan(double norm, double error, const ChangeReach& change);

  /// Some are to be taken again before anything else is done.
  [[nodiscard]] bool isRepairing() const { return repaired_ < due_; }
  /// Some are still those of before.
  [[nodiscard]] bool lacksLinks() const { return repaired_ < repairs_.size(); }
  /// Samples that the edit may have changed, at most.
  [[nodiscard]] std::uint64_t affectedSamples() const { return affected_; }
  [[nodiscard]] std::span<const Repair> waiting() const { return std::span(repairs_).subspan(repaired_); }
  /// Whether every light has looked again with some points at least.
  [[nodiscard]] bool knowsLights() const;
  /// Area-weighted norm of the error of irradiance that links which are not due may cause.
  [[nodiscard]] double missing() const;
  /// What repairs add to LinkCounters: those that an edit left, took again, and has waiting.
  void addTo(LinkCounters& counters) const;

  /// Takes the next of those that are due: short, so that an edit, a pause or the end of the server need not wait.
  /// `is_idle`: nothing else is to be done. Errors: the transport's.
  [[nodiscard]] Result<TransportCounters> advance(bool is_idle);
  /// Solved and told: the next of those that waited are due. An edit that comes in between need not wait for the
  /// others, nor long for those under way: an undo takes less time than a whole slice, and the many points of a few
  /// lights take longer than all nodes that wait.
  void catchUp();
  /// All of them are due, and lights look with all points.
  void beExact();
  /// What few points find is noisier than what all would. True: the lights whose shadows are the noisiest are due, with
  /// more.
  [[nodiscard]] bool lightsAreTooRough();
  /// After light was solved for, of this norm. True: some of what waited must not wait, and is due.
  [[nodiscard]] bool findsMoreDue(double norm);
  /// Where the target would be reached but for what waits, that is the least work. True: some of it is due.
  [[nodiscard]] bool isDueForTarget(double error, double norm);
  /// Shooters have new numbers (kNone: gone): what is left is due.
  void renumber(std::span<const std::uint32_t> shooter_after);

 private:
  [[nodiscard]] bool isNeeded(Repair& repair);
  [[nodiscard]] bool isSeen(const Repair& repair, bool& gathers) const;
  void keepNeeded();
  void findReach(const ChangeReach& change);
  [[nodiscard]] double reachOf(const Repair& repair, const ChangeReach& change) const;
  [[nodiscard]] double missing(const Repair& repair) const;
  void setPostponed(double error);
  void planDue(double norm);
  void weighRough(RepairBatch& batch);
  void takeOver(RepairBatch& batch);
  [[nodiscard]] double mostRoughness() const;

  const LinkParts& parts_;
  RoughLights rough_lights_;
  EditShadows shadows_;
  RepairRules rules_;
  std::vector<Repair> repairs_;
  std::size_t repaired_ = 0;   // of these
  std::size_t due_ = 0;        // of these, before anything else is done
  double shot_seconds_ = 0.0;  // as the last of them took; 0: not known
  double postponed_ = 0.0;     // part of the target error that the others may cause
  double roughness_ = 0.0;     // likewise: lights that look again with some points only
  double norm_before_ = 0.0;   // of irradiance before the edit; 0: not known
  std::uint64_t affected_ = 0;
  SliceLength slice_;
  LinkCounters counters_;
};

}  // namespace radiosity::solver
