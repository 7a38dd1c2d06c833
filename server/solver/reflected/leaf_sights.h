// Which leaves each leaf sees, by rays from all over it, more of them near its normal, as light arrives: the mean
// radiosity of those seen is its irradiance. Points and directions are Sobol's, scrambled leaf by leaf, so that more
// rays go on where fewer ended. Two independent halves. Owned by LeafGather; one thread outside of the calls.
//
// What passes through a leaf, or right before it, parts its light: a wall that stands on a leaf of the floor has the
// day on one side and the night on the other, and the leaf's mean would bring each to the other. So rays that end on
// such a leaf go on from where they end. So they do on leaves that lie in part within a wall of an open model: there
// some rays end at once, on the backs of what bounds it. In closed pockets what leaks is kept for all bounces.
//
// Rays that meet a mirror, metal or glass that they do not pass go on as well, as the surface reflects them
// (SpecularLeaves).
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/packed_numbers.h"
#include "server/solver/edits/shadows.h"
#include "server/solver/math/sampling.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"
#include "server/solver/reflected/specular_step.h"

namespace radiosity::solver {

class LeafSights {
 public:
  /// More rays no half of a leaf ever has.
  static constexpr std::uint32_t kMostRays = 16'384;

  /// `rays`: of the same two, where there are some already.
  LeafSights(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
             std::shared_ptr<const LeafRays> rays = nullptr);

  /// Where bytes(), with so many more for each step, might become more than `most`, no ray goes on any further. Those
  /// that do not end as rays do that went on as often as they may.
  void limit(std::size_t most, std::size_t step_bytes) {
    most_bytes_ = most;
    step_bytes_ = step_bytes;
  }

  /// Leaf values. What is seen is one of them, below this, or it isAbsorbed(), or isSky().
  [[nodiscard]] std::uint32_t leafCount() const { return leaf_count_; }
  [[nodiscard]] bool isAbsorbed(std::uint32_t end) const { return end == absorbed() || end == absorbedAtOnce(); }
  [[nodiscard]] bool isSky(std::uint32_t end) const { return end >= firstOfSky() && end < endCount(); }
  [[nodiscard]] bool isSkyAbove(std::uint32_t end) const {
    return end >= firstOfSky() && end < firstOfSky() + skyCount() / 2;
  }
  /// By number of end from the first of the sky on: its cells (SkyCells) where these are told apart, else its two
  /// hemispheres, above the horizon and below.
  [[nodiscard]] std::uint32_t firstOfSky() const { return leaf_count_ + 2; }
  [[nodiscard]] std::uint32_t skyCount() const { return tells_cells_ ? SkyCells::kCount : 2; }
  /// All of these are below this. What is not is a step: of number end - endCount().
  [[nodiscard]] std::uint32_t endCount() const { return firstOfSky() + skyCount(); }
  /// From now on rays that leave the scene know by which cell of the sky, those that are traced, too: of rays that went
  /// on before they left, of which only the scene tells that, it is asked again by the next trace(). O(rays). Throws
  /// std::bad_alloc, and nothing is changed then.
  void tellCells();
  [[nodiscard]] bool tellsCells() const { return tells_cells_; }
  /// Rays that end on this leaf go on.
  [[nodiscard]] bool isParted(std::uint32_t value) const {
    return rays_->isCut(value) || (!partly_inside_.empty() && partly_inside_[value]);
  }
  /// Leaves that reflect as mirrors do; null: none does. Rays that met, or now meet, others than before are to be
  /// traced anew.
  void reflectBy(std::shared_ptr<const SpecularLeaves> mirrors);
  [[nodiscard]] bool isMirror(std::uint32_t value) const {
    return mirrors_ && value < leaf_count_ && mirrors_->has(value);
  }
  /// The ray reached a leaf that is parted, or a mirror, and what it saw from there, or what it saw through coloured
  /// glass. Later ones go on to earlier ones.
  struct Step {
    std::uint32_t by;    ///< leaf value, or what SpecularStep or PaneStep says
    std::uint32_t next;  ///< an end, or the step before
  };
  [[nodiscard]] std::span<const Step> steps(std::size_t half) const { return steps_[half]; }
  /// Where a ray ends, or what it reaches first of what it goes on from, panes left aside: a leaf, or another end.
  [[nodiscard]] std::uint32_t firstEnd(std::size_t half, std::uint32_t end) const {
    end = behindPanes(half, end);
    return end < endCount() ? end : leafOf(steps_[half][end - endCount()]);
  }
  /// The end, or the step by a leaf, that a ray goes on to through coloured glass.
  [[nodiscard]] std::uint32_t behindPanes(std::size_t half, std::uint32_t end) const {
    while (end >= endCount() && PaneStep::is(steps_[half][end - endCount()].by))
      end = steps_[half][end - endCount()].next;
    return end;
  }
  /// Of light that goes through a pane.
  [[nodiscard]] const glm::vec3& tintOf(const Step& pane) const { return rays_->tint(PaneStep::of(pane.by).tint); }
  /// The leaf of a step that is no pane's.
  [[nodiscard]] static std::uint32_t leafOf(const Step& step) {
    return SpecularStep::is(step.by) ? SpecularStep::of(step.by).leaf : step.by;
  }
  /// The ray went on as often as a ray may, or there is no memory for more of that, and ends on another leaf that is
  /// parted, or on another mirror.
  [[nodiscard]] bool isDoubtful(std::size_t half, std::uint32_t end) const {
    return (is_short_ || end >= endCount()) && endsInDoubt(half, end);
  }

  [[nodiscard]] const std::shared_ptr<const LeafRays>& rays() const { return rays_; }
  /// Index of the side of a leaf.
  [[nodiscard]] std::uint32_t sideOf(std::uint32_t value) const { return rays_->indexOfSide(value); }

  /// By leaf value: which lie in part inside of something, as far as is known; empty: none.
  [[nodiscard]] const std::vector<bool>& partlyInside() const { return partly_inside_; }
  /// That is known of rays to be traced anew.
  void expectPartlyInside(std::vector<bool> leaves);

  /// How many rays each half of a leaf has, by leaf value; 0 where it has no area.
  [[nodiscard]] std::span<const std::uint16_t> counts() const { return count_; }
  /// As many as this, or more than there are; leaves without area have none all the same. They are traced by trace().
  /// Throws std::bad_alloc.
  void ask(std::span<const std::uint16_t> counts);
  /// What is asked for and not traced is given up, where there are others.
  void giveUp();
  [[nodiscard]] bool isTraced() const { return cursor_ == leaf_count_; }
  /// How many are asked for and not traced, of both halves. O(rays).
  [[nodiscard]] std::uint64_t untraced() const;
  /// Goes on for about `seconds`, on all cores. True: isTraced(). Where the cuts lie changes nothing.
  bool trace(double seconds);

  /// After isTraced(): what is seen from a leaf.
  [[nodiscard]] PackedNumbers::Run seen(std::size_t half, std::uint32_t value) const {
    return ends(half, firstOf(value), count_[value]);
  }
  /// The same by rays of all leaves, in their order.
  [[nodiscard]] PackedNumbers::Run ends(std::size_t half, std::size_t first, std::size_t count) const {
    return seen_[half].run(first, count);
  }

  /// The rays of a leaf, as they were traced: calls visit(place, direction, end) for each.
  template <typename Visit>
  void visitRays(std::size_t half, std::uint32_t value, const Visit& visit) const {
    const auto draw = draws(value, rays_->sideOf(value), half);
    std::uint32_t k = 0;
    for (const auto end : seen(half, value)) {
      const auto at = draw(k++);
      const auto place = rays_->placeOn(value, {at.z, at.w});
      visit(place, cosineDirection(place.normal, at.x, at.y), end);
    }
  }

  /// After an edit of geometry, at first: rays of the scene before that pass nothing that changed see what they saw.
  /// `value_before`: by leaf value, what it was there, or kNone where it is new, moved or altered. All others are
  /// traced with the next trace(), so that all see what they would without it. No half of a leaf gets more than `most`.
  void inherit(const LeafSights& former, std::span<const std::uint32_t> value_before, const Shadows& change,
               std::uint16_t most);

  [[nodiscard]] std::size_t bytes() const;
  /// Bytes of a ray asked for, one of each half, but for its steps, in a scene of any size.
  static constexpr std::size_t kRayBytes = 2 * sizeof(std::uint32_t);
  /// The same of this scene, with as many steps as those there are have; `step_bytes`: whoever follows them takes for
  /// each.
  [[nodiscard]] std::size_t rayBytes(std::size_t step_bytes) const;
  /// What the rays there are take more once there are so many steps, which need wider numbers.
  [[nodiscard]] std::size_t widerBytes(std::size_t steps) const;
  /// In a round there come to be at most so many times as many rays.
  static constexpr std::size_t kMostTimes = 4;
  /// Rays traced so far, of both halves; those inherited count apart.
  [[nodiscard]] std::uint64_t traced() const { return traced_; }
  [[nodiscard]] std::uint64_t kept() const { return kept_; }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::uint32_t kUntraced = scene::kNone;
  /// Leaves of which it is known together where their rays begin.
  static constexpr std::uint32_t kLeavesAFirst = 16;
  [[nodiscard]] std::size_t firstOf(std::uint32_t value) const {
    std::size_t first = first_[value / kLeavesAFirst];
    for (auto before = value / kLeavesAFirst * kLeavesAFirst; before < value; ++before) first += count_[before];
    return first;
  }
  /// Where a ray ends, or kUntraced.
  [[nodiscard]] std::uint32_t endAt(std::size_t half, std::size_t ray) const {
    const auto end = seen_[half][ray];
    return end == seen_[half].most() ? kUntraced : end;
  }
  [[nodiscard]] bool endsInDoubt(std::size_t half, std::uint32_t end) const;
  [[nodiscard]] std::uint32_t untracedOf(std::size_t half, std::uint32_t value) const;
  /// For rays, of which none is traced, that may end anywhere, or go on over so many steps.
  [[nodiscard]] PackedNumbers roomFor(std::size_t rays, std::size_t steps) const;
  void widen(std::size_t half, std::size_t steps);
  /// Bytes of each end, for so many steps.
  [[nodiscard]] std::size_t widthOf(std::size_t steps) const;
  /// On an unlit side; within the width of the leaf that the ray comes from.
  [[nodiscard]] std::uint32_t absorbed() const { return leaf_count_; }
  [[nodiscard]] std::uint32_t absorbedAtOnce() const { return leaf_count_ + 1; }
  [[nodiscard]] std::uint32_t skyEnd(std::uint32_t cell) const {
    return firstOfSky() + (tells_cells_ ? cell : SkyCells::isAbove(cell) ? 0 : 1);
  }
  [[nodiscard]] PackedNumbers withCells(std::size_t half, std::uint32_t more) const;
  /// Steps, numbered from 0, and the rays that have them.
  struct NewSteps {
    struct Ray {
      std::size_t ray;    ///< into seen_
      std::uint32_t end;  ///< by these numbers
    };
    std::vector<Step> steps;
    std::vector<Ray> rays;
  };
  /// Leaves from cursor_ that are traced together: what room there is for their steps is looked at before.
  struct Slice {
    std::uint32_t end = 0;
    std::vector<std::array<NewSteps, 2>> made;  ///< by part
    std::size_t done = 0;                       ///< parts
  };
  void layOut(std::span<const std::uint16_t> counts);
  /// Returns how many rays.
  std::uint32_t traceLeaf(std::uint32_t value, const Side& side, std::size_t half, NewSteps& made);
  class Way;
  [[nodiscard]] std::uint32_t endOfRay(const LeafRays::Place& place, const glm::dvec3& direction, std::uint64_t key,
                                       const geometry::Hit& first, std::vector<Step>& steps) const;
  void giveUpRays(const std::vector<bool>& differs, bool drops_steps);
  [[nodiscard]] std::uint32_t withSteps(std::uint32_t end, std::size_t half, std::vector<Step>& steps) const;
  [[nodiscard]] Slice beginSlice();
  void traceSlice(Slice slice, Clock::time_point end);
  std::uint64_t tracePart(Slice& slice, std::size_t part);
  [[nodiscard]] std::vector<bool> findPartlyInside() const;
  void takePartlyInside();
  std::size_t giveUpRaysAt(const std::vector<bool>& leaves, std::size_t half);
  void takeSteps(std::span<const std::array<NewSteps, 2>> made);
  /// Draws of the rays of a leaf.
  [[nodiscard]] std::uint64_t keyOf(std::uint32_t value, const Side& side, std::size_t half) const;
  [[nodiscard]] Sobol4 draws(std::uint32_t value, const Side& side, std::size_t half) const {
    return Sobol4(keyOf(value, side, half));
  }
  void forgetStandIns(const LeafSights& former, std::vector<std::uint32_t>& value_after) const;
  [[nodiscard]] bool passes(std::span<const scene::ChangedBox> boxes, std::uint32_t value,
                            const glm::dvec4& draw) const;
  /// What is taken over after an edit of geometry.
  struct Inheritance {
    const LeafSights& former;
    std::span<const std::uint32_t> value_before, value_after;  ///< by leaf value; by ends of `former`
    const std::vector<bool>& stands_in;  ///< by leaf value: rays that are said to end on it may end beside it
    const Shadows& change;
  };
  /// Of rays of a leaf: where they end, or what parted leaf they meet first, in this scene; kUntraced: it is gone.
  struct FirstMet {
    std::vector<std::uint32_t> end;
    std::vector<std::int32_t> leaf, may_hide;  ///< the same where it is a leaf; what Shadows::Look::screen() says
    void resize(std::size_t rays) {
      end.resize(rays);
      leaf.resize(rays);
      may_hide.resize(rays);
    }
  };
  /// Rays of one half of a leaf, which lie together.
  struct LeafRun {
    std::uint32_t value;
    std::size_t half, first_ray;
  };
  [[nodiscard]] std::uint64_t inheritHalf(std::size_t half, const Inheritance& from);
  void findFirstMet(std::size_t half, const PackedNumbers::Run& old, const Shadows::Look& look, const Inheritance& from,
                    FirstMet& met) const;
  [[nodiscard]] std::uint64_t inheritLeaf(const LeafRun& leaf, const PackedNumbers::Run& old, const Shadows::Look& look,
                                          const Inheritance& from, const FirstMet& met);
  std::uint32_t inheritStep(std::size_t half, std::uint32_t end, const Inheritance& from);

  const std::vector<Side>& sides_;
  std::shared_ptr<const LeafRays> rays_;
  std::shared_ptr<const SpecularLeaves> mirrors_;
  std::uint64_t seed_;
  std::uint32_t leaf_count_ = 0;
  std::uint32_t cursor_ = 0;                   ///< leaves below are traced
  std::optional<Slice> slice_;                 ///< the one at cursor_, where some of it is traced
  std::vector<std::uint16_t> count_, before_;  ///< by leaf value; before what was asked for last
  std::vector<std::size_t> first_;             ///< by kLeavesAFirst leaf values: into seen_
  std::array<PackedNumbers, 2> seen_;          ///< the largest that fits: not traced
  std::array<std::size_t, 2> without_ray_{};   ///< of steps_, by half
  std::array<std::vector<Step>, 2> steps_;
  std::vector<bool> partly_inside_;  ///< by leaf value; empty: none is
  std::size_t most_bytes_ = SIZE_MAX, step_bytes_ = 0;
  bool goes_on_ = true, is_short_ = false;  ///< rays of this slice; some did not
  bool tells_cells_ = false;                ///< of the sky
  std::uint64_t traced_ = 0, kept_ = 0;
};

}  // namespace radiosity::solver
