#include "server/solver/reflected/leaf_sights.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/give_back.h"
#include "common/parallel.h"
#include "server/solver/math/halves.h"
#include "server/solver/math/microfacets.h"
#include "server/solver/rays/ray_order.h"

namespace radiosity::solver {
namespace {

/// Leaves between two looks at the clock, of all threads together, and of one at a time.
constexpr std::uint32_t kLeavesASlice = 2048, kLeavesWithoutRoom = 64;
/// Between two looks at the clock: among thousands of large thin boxes a ray takes 60 us, and a leaf has a hundred.
constexpr std::uint32_t kLeavesAPart = 4;
/// So many rays of each half at most tell whether a leaf lies in part inside of something. With 8 those were missed of
/// which less than a tenth does, and that tenth kept its light from all rays that met the rest.
constexpr std::size_t kLooks = 64;
/// A ray goes on from so many leaves at most; then the mean of the next has to do. In gaps it might go on for ever.
constexpr std::size_t kMostSteps = 32;
/// Steps that no ray has any more are kept until they are one of so many.
constexpr std::size_t kFewSteps = 8;
/// Of steps, so that no slice makes more than 32 bits number.
constexpr std::size_t kMostNumbers = std::size_t{1} << 30;
/// No other number of a ray's is drawn with this.
constexpr std::uint64_t kAbsorbs = 0x50414e45ULL;

}  // namespace

LeafSights::LeafSights(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
                       std::shared_ptr<const LeafRays> rays)
    : sides_(sides),
      rays_(rays ? std::move(rays) : std::make_shared<const LeafRays>(patches, sides)),
      seed_(mixKeys(seed, 0x53494748ULL)) {
  for (const auto& side : sides) leaf_count_ = std::max(leaf_count_, side.first_value + side.leaf_count);
  count_.assign(leaf_count_, 0);
  first_.assign((leaf_count_ + kLeavesAFirst - 1) / kLeavesAFirst, 0);
  cursor_ = leaf_count_;
}

PackedNumbers LeafSights::roomFor(std::size_t rays, std::size_t steps) const {
  return {rays, endCount() + static_cast<std::uint32_t>(steps)};  // one more than there can be
}

/// So that so many steps have numbers.
void LeafSights::widen(std::size_t half, std::size_t steps) {
  if (endCount() + steps <= seen_[half].most()) return;
  auto room = roomFor(seen_[half].size(), steps);
  std::size_t ray = 0;
  for (const auto end : seen_[half].all()) {
    if (end != seen_[half].most()) room.set(ray, end);
    ++ray;
  }
  seen_[half] = std::move(room);
}

std::uint32_t LeafSights::untracedOf(std::size_t half, std::uint32_t value) const {
  const auto first = firstOf(value);
  std::uint32_t rays = 0;
  for (std::uint32_t k = 0; k < count_[value]; ++k) rays += endAt(half, first + k) == kUntraced ? 1 : 0;
  return rays;
}

void LeafSights::ask(std::span<const std::uint16_t> counts) {
  before_ = count_;
  layOut(counts);
  cursor_ = 0;
}

/// What is known moves to where it belongs, and steps that no ray has are dropped; before a half is laid out anew
/// nothing is lost should memory run out.
void LeafSights::layOut(std::span<const std::uint16_t> counts) {
  slice_.reset();  // its rays that have steps are traced anew
  std::vector<std::uint16_t> count(leaf_count_, 0);
  std::vector<std::size_t> first(first_.size(), 0);
  std::size_t all = 0;
  for (std::uint32_t value = 0; value < leaf_count_; ++value) {
    if (value % kLeavesAFirst == 0) first[value / kLeavesAFirst] = all;
    if (rays_->areaOf(value) > 0.0) count[value] = counts[value];
    all += count[value];
  }
  std::array<PackedNumbers, 2> seen;
  std::array<std::vector<Step>, 2> steps;
  inBothHalves([&](std::size_t half) {
    seen[half] = roomFor(all, steps_[half].size());
    std::size_t old_first = 0, new_first = 0;
    for (std::uint32_t value = 0; value < leaf_count_; ++value) {
      auto ray = new_first;
      for (const auto end : ends(half, old_first, std::min(count_[value], count[value]))) {
        if (end != seen_[half].most()) seen[half].set(ray, withSteps(end, half, steps[half]));
        ++ray;
      }
      old_first += count_[value];
      new_first += count[value];
    }
  });
  count_ = std::move(count);
  first_ = std::move(first);
  seen_ = std::move(seen);
  steps_ = std::move(steps);
  without_ray_ = {};
}

/// An end, whose steps are taken over.
std::uint32_t LeafSights::withSteps(std::uint32_t end, std::size_t half, std::vector<Step>& steps) const {
  if (end < endCount()) return end;
  const auto& step = steps_[half][end - endCount()];
  steps.push_back({step.by, withSteps(step.next, half, steps)});
  return endCount() + static_cast<std::uint32_t>(steps.size() - 1);
}

void LeafSights::expectPartlyInside(std::vector<bool> leaves) { partly_inside_ = std::move(leaves); }

void LeafSights::giveUp() {
  if (isTraced()) return;
  auto counts = count_;
  before_.resize(leaf_count_);
  for (auto value = cursor_; value < leaf_count_; ++value)
    if (before_[value] > 0) counts[value] = before_[value];
  layOut(counts);
}

std::uint64_t LeafSights::keyOf(std::uint32_t value, const Side& side, std::size_t half) const {
  return mixKeys(mixKeys(seed_, side.key), std::uint64_t{value - side.first_value} * 2 + half);
}

/// Where a ray is, and the steps by which it came there.
class LeafSights::Way {
 public:
  Way(const LeafSights& sights, const LeafRays::Place& place, const glm::dvec3& direction, std::uint64_t key)
      : sights_(sights), place_(place), direction_(direction), key_(key) {}

  void see(const geometry::Hit* first = nullptr) {
    if (!sights_.rays_->hasTints()) {
      seen_ = sights_.rays_->see(place_, direction_, key_, there_, first);
      return;
    }
    LeafRays::Panes panes;
    seen_ = sights_.rays_->see(place_, direction_, key_, there_, first, &panes);
    if (panes.count > 0) goThrough(panes);
  }
  [[nodiscard]] std::uint32_t seen() const { return seen_; }
  [[nodiscard]] const LeafRays::Place& there() const { return there_; }

  /// Whether it went on from where it was, and sees something else now.
  [[nodiscard]] bool goOn() {
    if (hops_ < SpecularLeaves::kMostHops && count_ + Reflection::kMostBounces <= kMostSteps &&
        sights_.isMirror(seen_)) {
      reflect();
    } else if (count_ < kMostSteps && seen_ < sights_.leaf_count_ && seen_ == there_.value && sights_.isParted(seen_) &&
               !sights_.isMirror(seen_)) {
      scatter();
    } else {
      return false;
    }
    see();
    return true;
  }

  /// From the last to the first; returns where the ray ends, or the number of the first.
  [[nodiscard]] std::uint32_t takeSteps(std::uint32_t end, std::vector<Step>& steps) {
    while (count_ > 0) {
      steps.push_back({by_[--count_], end});
      end = sights_.endCount() + static_cast<std::uint32_t>(steps.size() - 1);
    }
    return end;
  }

 private:
  /// Where there is no memory for steps the ray ends in the glass, by chance: as often as light does that is of all
  /// channels alike.
  void goThrough(const LeafRays::Panes& panes) {
    for (std::size_t i = 0; sights_.goes_on_ && i < panes.count && count_ < kMostSteps; ++i)
      by_[count_++] = PaneStep{panes.which[i]}.code();
    if (sights_.goes_on_) return;
    const auto& tint = panes.tint;
    if (uniformFromKey(mixKeys(key_, kAbsorbs)) >= (tint.x + tint.y + tint.z) / 3.0) seen_ = LeafRays::kNothing;
  }

  void scatter() {
    by_[count_++] = seen_;
    key_ = mixKeys(key_, count_);
    const auto draw = sobol4(0, key_);
    place_ = there_;
    direction_ = cosineDirection(place_.normal, draw.x, draw.y);
  }

  void reflect() {
    ++hops_;
    const auto leaf = seen_;
    key_ = mixKeys(key_, count_ + 1);
    const auto reflection =
        reflectByMicrofacets(there_.normal, direction_, sights_.mirrors_->roughness(leaf), mixKeys(key_, 1));
    for (std::size_t i = 0; i < reflection.count; ++i) {
      const auto level = SpecularStep::levelOf(reflection.edge[i], uniformFromKey(mixKeys(key_, 2 + i)));
      by_[count_++] = SpecularStep{leaf, level, i > 0}.code();
    }
    place_ = there_;
    direction_ = reflection.direction;
  }

  const LeafSights& sights_;
  LeafRays::Place place_, there_;
  glm::dvec3 direction_;
  std::uint64_t key_;
  std::uint32_t seen_ = LeafRays::kNothing;
  std::array<std::uint32_t, kMostSteps> by_{};
  std::size_t count_ = 0, hops_ = 0;
};

std::uint32_t LeafSights::endOfRay(const LeafRays::Place& place, const glm::dvec3& direction, std::uint64_t key,
                                   const geometry::Hit& first, std::vector<Step>& steps) const {
  Way way(*this, place, direction, key);
  way.see(&first);
  const bool at_once = way.seen() == LeafRays::kNothing && way.there().value == LeafRays::kNothing &&
                       glm::distance(place.position, way.there().position) < rays_->widthOf(place.value);
  while (goes_on_ && way.goOn()) continue;
  const auto seen = way.seen();
  const std::uint32_t end = LeafRays::isSky(seen)        ? skyEnd(seen - LeafRays::kSky)
                            : at_once                    ? absorbedAtOnce()
                            : seen == LeafRays::kNothing ? absorbed()
                                                         : seen;
  return way.takeSteps(end, steps);
}

/// Those that met a leaf that goes on otherwise now, or ended there.
void LeafSights::reflectBy(std::shared_ptr<const SpecularLeaves> mirrors) {
  if (leaf_count_ >= SpecularStep::kMostLeaves) mirrors = nullptr;
  if (!mirrors && !mirrors_) return;
  std::vector<bool> differs;
  for (std::uint32_t value = 0; value < leaf_count_; ++value) {
    if (SpecularLeaves::goOnAlike(mirrors.get(), value, mirrors_.get(), value)) continue;
    differs.resize(endCount());
    differs[value] = true;
  }
  mirrors_ = std::move(mirrors);
  // Nobody could follow what is left of mirrors where there are none.
  if (!differs.empty() && seen_[0].size() > 0) giveUpRays(differs, mirrors_ == nullptr);
}

/// Rays that end on these leaves, or pass them, are to be traced anew. `drops_steps`: even where few had steps.
void LeafSights::giveUpRays(const std::vector<bool>& differs, bool drops_steps) {
  if (isTraced()) before_ = count_;
  slice_.reset();
  cursor_ = 0;  // whatever happens, what is given up below is traced before anyone asks for it
  inBothHalves([&](std::size_t half) { without_ray_[half] += giveUpRaysAt(differs, half); });
  // To drop a few takes longer than to keep them.
  const auto steps = steps_[0].size() + steps_[1].size();
  const bool are_many = kFewSteps * (without_ray_[0] + without_ray_[1]) > steps;
  if (are_many || drops_steps) layOut(std::vector(count_));
}

bool LeafSights::endsInDoubt(std::size_t half, std::uint32_t end) const {
  std::size_t count = 0;
  for (; end >= endCount(); ++count) end = steps_[half][end - endCount()].next;
  if (end >= leaf_count_) return false;
  return isMirror(end) || ((count == kMostSteps || is_short_) && isParted(end));
}

std::uint32_t LeafSights::traceLeaf(std::uint32_t value, const Side& side, std::size_t half, NewSteps& made) {
  const auto wanted = untracedOf(half, value);
  if (wanted == 0) return 0;
  const auto draw = draws(value, side, half);
  const auto chance = mixKeys(keyOf(value, side, half), 1);
  const auto first = firstOf(value);
  thread_local RayOrder pending;
  pending.clear();
  for (std::uint32_t k = 0; k < count_[value]; ++k)
    if (endAt(half, first + k) == kUntraced) pending.add(k, draw(k));
  pending.sort();
  std::array<LeafRays::Place, geometry::kPacket> place;
  std::array<glm::dvec3, geometry::kPacket> direction;
  std::array<geometry::Hit, geometry::kPacket> hit;
  for (std::size_t from = 0; from < pending.size(); from += geometry::kPacket) {
    const auto together = std::min<std::size_t>(geometry::kPacket, pending.size() - from);
    for (std::size_t i = 0; i < together; ++i) {
      const auto& at = pending[from + i].draw;
      place[i] = rays_->placeOn(value, {at.z, at.w});
      direction[i] = cosineDirection(place[i].normal, at.x, at.y);
    }
    rays_->meetFirst(std::span(place).first(together), std::span(direction).first(together),
                     std::span(hit).first(together));
    for (std::size_t i = 0; i < together; ++i) {
      const auto number = pending[from + i].number;
      const auto ray = first + number;
      const auto end = endOfRay(place[i], direction[i], mixKeys(chance, number), hit[i], made.steps);
      if (end < endCount()) {
        seen_[half].set(ray, end);
      } else {
        made.rays.push_back({ray, end});
      }
    }
  }
  return wanted;
}

/// In the order of leaves, whoever traced them.
void LeafSights::takeSteps(std::span<const std::array<NewSteps, 2>> made) {
  for (std::size_t half = 0; half < 2; ++half) {  // all room first
    std::size_t more = 0;
    for (const auto& halves : made) more += halves[half].steps.size();
    widen(half, steps_[half].size() + more);
    if (steps_[half].size() + more > steps_[half].capacity())
      steps_[half].reserve(std::max(steps_[half].size() + more, 2 * steps_[half].capacity()));
  }
  for (const auto& halves : made) {
    for (std::size_t half = 0; half < 2; ++half) {
      const auto before = static_cast<std::uint32_t>(steps_[half].size());
      for (const auto& [ray, end] : halves[half].rays) seen_[half].set(ray, end + before);
      for (const auto& step : halves[half].steps)
        steps_[half].push_back({step.by, step.next < endCount() ? step.next : step.next + before});
    }
  }
}

/// Where the slice that begins at cursor_ ends: before its rays, should all go on as often as rays may, would take more
/// than there is room for. Where that is so of a single leaf no ray of some goes on.
LeafSights::Slice LeafSights::beginSlice() {
  const auto steps = steps_[0].size() + steps_[1].size();
  const auto taken = bytes() + steps * step_bytes_;
  const auto roomBeside = [&](std::size_t bytes) {
    return bytes < most_bytes_ ? (most_bytes_ - bytes) / (sizeof(Step) + step_bytes_) : 0;
  };
  const auto room = roomBeside(taken + widerBytes(steps + roomBeside(taken)));
  const auto most = std::min(room, kMostNumbers - std::min(kMostNumbers, steps)) / kMostSteps;
  const auto last = std::min(leaf_count_, cursor_ + kLeavesASlice);
  auto end = last;
  if (2 * std::accumulate(count_.begin() + cursor_, count_.begin() + last, std::size_t{0}) > most) {
    end = cursor_;
    for (std::size_t rays = 0; end < last; ++end) {
      for (std::size_t half = 0; half < 2; ++half) rays += untracedOf(half, end);
      if (rays > most) break;
    }
  }
  goes_on_ = end > cursor_;
  is_short_ = is_short_ || !goes_on_;
  if (!goes_on_) end = std::min(leaf_count_, cursor_ + kLeavesWithoutRoom);
  Slice slice{.end = end, .made = {}, .done = 0};
  slice.made.resize((end - cursor_ + kLeavesAPart - 1) / kLeavesAPart);
  return slice;
}

/// Goes on with a slice that begins at cursor_ until `end`, each thread by one part at least. Where memory runs out,
/// rays with steps are as good as not traced, and the slice is to begin anew.
void LeafSights::traceSlice(Slice slice, Clock::time_point end) {
  const auto parts = slice.made.size();
  std::atomic<std::size_t> next{slice.done};
  std::atomic<std::uint64_t> traced{0};
  inShares(parts - slice.done, [&](std::size_t, std::size_t) {
    do {
      const auto part = next++;
      if (part >= parts) return;
      interruptionPoint();
      traced += tracePart(slice, part);
    } while (Clock::now() < end);
  });
  slice.done = std::min(parts, next.load());
  traced_ += traced;
  if (slice.done < parts) {
    slice_ = std::move(slice);
    return;
  }
  takeSteps(slice.made);
  cursor_ = slice.end;
}

/// Returns how many rays.
std::uint64_t LeafSights::tracePart(Slice& slice, std::size_t part) {
  const auto from = cursor_ + static_cast<std::uint32_t>(part) * kLeavesAPart;
  std::uint64_t rays = 0;
  for (auto value = from; value < std::min(slice.end, from + kLeavesAPart); ++value) {
    if (count_[value] == 0) continue;
    const Side& side = rays_->sideOf(value);
    for (std::size_t half = 0; half < 2; ++half) rays += traceLeaf(value, side, half, slice.made[part][half]);
  }
  return rays;
}

/// By the first rays of all.
std::vector<bool> LeafSights::findPartlyInside() const {
  std::array<std::vector<std::uint8_t>, 2> inside;
  inBothHalves([&](std::size_t half) {
    inside[half].resize(leaf_count_);
    std::size_t first = 0;
    for (std::uint32_t value = 0; value < leaf_count_; first += count_[value++]) {
      const auto run = ends(half, first, std::min<std::size_t>(count_[value], kLooks));
      inside[half][value] = static_cast<std::uint8_t>(std::count(run.begin(), run.end(), absorbedAtOnce()));
    }
  });
  std::vector<bool> found;
  for (std::uint32_t value = 0; value < leaf_count_; ++value) {
    const auto looks = 2 * std::min<std::size_t>(count_[value], kLooks);
    const std::size_t of_both = std::size_t{inside[0][value]} + inside[1][value];
    if (of_both == 0 || of_both == looks) continue;
    found.resize(leaf_count_);
    found[value] = true;
  }
  return found;
}

/// Rays that ended where they are to go on, and those that went on from where they are not to, are to be traced anew.
void LeafSights::takePartlyInside() {
  auto found = findPartlyInside();
  if (found == partly_inside_) return;
  std::vector<bool> differs(endCount(), false);
  for (std::uint32_t value = 0; value < leaf_count_; ++value)
    differs[value] = (!found.empty() && found[value]) != (!partly_inside_.empty() && partly_inside_[value]);
  giveUpRays(differs, false);
  partly_inside_ = std::move(found);
}

/// Those that end on such leaves, or go on from there. How many steps they had.
std::size_t LeafSights::giveUpRaysAt(const std::vector<bool>& leaves, std::size_t half) {
  auto& seen = seen_[half];
  std::size_t steps = 0;
  std::size_t ray = 0;
  for (const auto end : seen.all()) {
    const auto at = ray++;
    if (end < endCount()) {
      if (leaves[end]) seen.set(at, seen.most());
      continue;
    }
    if (end == seen.most()) continue;
    bool passes = false;
    auto last = end;
    std::size_t count = 0;
    for (; last >= endCount(); last = steps_[half][last - endCount()].next, ++count) {
      const auto& step = steps_[half][last - endCount()];
      passes = passes || (!PaneStep::is(step.by) && leaves[leafOf(step)]);
    }
    if (!passes && !leaves[last]) continue;
    seen.set(at, seen.most());
    steps += count;
  }
  return steps;
}

bool LeafSights::trace(double seconds) {
  constexpr double kLongest = 1e6;  // what clocks can add
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(std::min(seconds, kLongest)));
  while (cursor_ < leaf_count_) {
    traceSlice(slice_ ? *std::exchange(slice_, std::nullopt) : beginSlice(), end);
    if (isTraced()) takePartlyInside();
    if (Clock::now() >= end) break;
  }
  if (!isTraced()) return false;
  for (auto& half : steps_) half.shrink_to_fit();  // they grew by doubling
  giveBack(before_);
  return true;
}

std::uint64_t LeafSights::untraced() const {
  if (isTraced()) return 0;
  std::uint64_t rays = 0;
  for (const auto& half : seen_) rays += static_cast<std::uint64_t>(std::ranges::count(half.all(), half.most()));
  return rays;
}

std::size_t LeafSights::bytes() const {
  return seen_[0].bytes() + seen_[1].bytes() + first_.size() * sizeof(std::size_t) +
         (steps_[0].size() + steps_[1].size()) * sizeof(Step);
}

std::size_t LeafSights::rayBytes(std::size_t step_bytes) const {
  const auto rays = std::max<std::size_t>(1, seen_[0].size()), steps = steps_[0].size() + steps_[1].size();
  const auto width = std::max({seen_[0].width(), seen_[1].width(), widthOf(kMostTimes * steps)});
  return 2 * width + (steps * (sizeof(Step) + step_bytes) + rays - 1) / rays;
}

std::size_t LeafSights::widthOf(std::size_t steps) const {
  return PackedNumbers::widthFor(endCount() + static_cast<std::uint32_t>(std::min(steps, kMostNumbers)));
}

std::size_t LeafSights::widerBytes(std::size_t steps) const {
  std::size_t wider = 0;
  for (const auto& half : seen_) wider += half.size() * (std::max(widthOf(steps), half.width()) - half.width());
  return wider;
}

}  // namespace radiosity::solver
