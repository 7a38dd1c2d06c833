// What viewers see: which quantities are published, and when.
#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "server/engine/lit/thread_time.h"
#include "server/engine/loop/solve_loop_class.h"
#include "server/engine/publish/quantity_pages.h"

namespace radiosity::engine {
namespace {

/// Oftener than anyone can see a difference.
constexpr auto kPublishInterval = std::chrono::milliseconds(50);
/// Making pages takes no more than one part in so many of the solve thread's time, however large they are; ...
constexpr int kPublishShare = 20;
/// ... but while a solve is young, and every version shows much that is new, up to one part in so many.
constexpr int kEarlyShare = 4;

constexpr std::array kQuantities = {Quantity::kIrradiance, Quantity::kRadiosity, Quantity::kError, Quantity::kPatchId,
                                    Quantity::kMipLevel,   Quantity::kUnshot,    Quantity::kNormal};
static_assert(kQuantities.size() == kQuantityCount);

}  // namespace

bool SolveLoop::publishLightmaps(bool final) {
  const bool watched = std::any_of(kQuantities.begin(), kQuantities.end(), [&](auto q) { return watches_.wants(q); });
  owes_pages_.reset();
  if (!lit_) return false;
  if (!watched) {
    if (unpublished_ || final) ++unwatched_;
    return false;
  }
  const auto begin = threadTime();
  if (unpublished_ || final || (stepped_ && lacksPages())) {
    publisher_.startVersion();
    stepped_ = false;
  }
  unpublished_ = false;
  shown_is_own_ = true;
  updateStatus(false);
  for (const auto quantity : kQuantities) publishQuantity(quantity);
  next_publish_ = Clock::now() + publishPause(threadTime() - begin);
  return true;
}

/// Someone watches what the present version has no pages of: it was not asked for, or forgotten since. What was made of
/// it before may still be held, by those who come back to it and encoded: of a later moment it must not be made again.
bool SolveLoop::lacksPages() const {
  return std::any_of(kQuantities.begin(), kQuantities.end(), [&](auto quantity) {
    const auto& latest = publisher_.latest(quantity);
    return watches_.wants(quantity) && !(latest && latest->tile_version == publisher_.version());
  });
}

/// Until the next slices have solved for other light or colours, or for what moved, irradiance is what was published
/// before; pages of it would take a tenth of the time that such an edit does. Other quantities have other colours at
/// once.
bool SolveLoop::showsNothingNew() const {
  if (!lit_ || !shown_is_own_ || state_ != SolveState::kSolving || !publisher_.latest(Quantity::kIrradiance))
    return false;
  const bool is_own = lit_->showsOwnLight() && lit_->solver().isUnsettled() && !lit_->solver().isRepairing();
  return (is_own || lit_->showsFormerLight()) && watchesIrradianceAlone();
}

bool SolveLoop::watchesIrradianceAlone() const {
  return std::ranges::none_of(kQuantities, [&](auto q) { return q != Quantity::kIrradiance && watches_.wants(q); });
}

/// Where pages are laid out anew they show the light that there was. An edit that took so little time is solved for
/// about as soon, and pages of both would take a tenth of that: those of the light before are left out, unless they are
/// owed already.
void SolveLoop::showEdit() {
  if (showsNothingNew()) return;
  const auto now = Clock::now();
  const bool is_short = now - edit_began_ < options_.solved_soon;
  if (state_ == SolveState::kSolving && !owes_pages_ && is_short && watchesIrradianceAlone()) {
    owes_pages_ = now + options_.solved_soon;
  } else {
    publishLightmaps(false);
  }
}

/// After pages that took so long: never longer than the solve is old, where that leaves it most of its time.
auto SolveLoop::publishPause(Clock::duration took) const -> Clock::duration {
  const auto age = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds_));
  const Clock::duration pause = std::min(kPublishShare * took, std::max(kEarlyShare * took, age));
  return std::max<Clock::duration>(kPublishInterval, pause);
}

QuantityPages SolveLoop::pagesToShow(Quantity quantity) {
  if (quantity == Quantity::kIrradiance) return {quantity, lit_->shownPages(), {}, false};
  return makePages(*lit_, quantity);
}

void SolveLoop::publishQuantity(Quantity quantity) {
  auto shown = publisher_.latest(quantity);
  if (watches_.wants(quantity)) {
    const bool added = watches_.takeAdded(quantity);
    const bool current = shown && shown->tile_version == publisher_.version();
    if (current && !added) return;
    if (!current) shown = publisher_.publish(pagesToShow(quantity), status(), state_ == SolveState::kConverged);
  } else if (quantity == Quantity::kIrradiance) {
    return;  // its tile versions are for viewers who come back
  } else {
    publisher_.forget(quantity);
    shown.reset();
  }
  {
    const std::scoped_lock lock(mutex_);
    lightmaps_[static_cast<std::size_t>(quantity)] = shown;
  }
  if (shown) listeners_.tell([&](Listener& listener) { listener.onLightmaps(shown); });
}

void SolveLoop::welcomeWatchers() {
  const bool added = std::any_of(kQuantities.begin(), kQuantities.end(), [&](auto q) { return watches_.hasAdded(q); });
  if (added) publishLightmaps(false);
}

std::shared_ptr<void> SolveLoop::watch(Quantity quantity) {
  auto watching = watches_.add(quantity);
  queue_.wake();
  return watching;
}

std::shared_ptr<const Lightmaps> SolveLoop::lightmaps(Quantity quantity) const {
  const std::scoped_lock lock(mutex_);
  return lightmaps_[static_cast<std::size_t>(quantity)];
}

}  // namespace radiosity::engine
