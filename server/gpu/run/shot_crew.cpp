#include "server/gpu/run/shot_crew.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <future>

#include "common/task.h"

namespace radiosity::gpu {
namespace {

/// Parts for each hand: two, since no two take the same time; not more, since each asks for its images once.
constexpr std::size_t kPartsAHand = 2;
/// What hands may hold, and what one holds for each node and whatever the scene: sums of flux, places on receivers,
/// images.
constexpr std::size_t kHandsBytes = std::size_t{1} << 30U;
constexpr std::size_t kNodeBytes = 200, kImageBytes = std::size_t{20} << 20U;

}  // namespace

Result<std::unique_ptr<ShotCrew>> ShotCrew::create(std::optional<Drawing> drawing) {
  auto renderers = Renderers::create(drawing);
  if (!renderers) return tl::unexpected(renderers.error());
  return std::unique_ptr<ShotCrew>(new ShotCrew(std::move(*renderers)));
}

Result<void> ShotCrew::setScene(std::shared_ptr<const scene::PatchScene> patches) {
  hands_.clear();  // before others take their memory; and what they know is of no use to other images
  if (auto set = renderers_->setScene(patches); !set) return set;
  const auto receivers = std::make_shared<const Receivers>(patches);
  // Else the first light would wait for them, and whoever waits for that.
  if (sight() == Sight::kRays) (void)receivers->rays();
  const std::size_t fit = kHandsBytes / (kImageBytes + kNodeBytes * patches->nodeCount());
  const std::size_t count = std::clamp<std::size_t>(fit, 1, wanted_);
  std::vector<std::unique_ptr<Hand>> hands;
  for (std::size_t i = 0; i < count; ++i) {
    hands.push_back(std::make_unique<Hand>(ImageSource(*renderers_, count > 1 ? &desk_ : nullptr), weights_));
    hands.back()->runner.setScene(receivers, sight());
    if (count > 1) hands.back()->store = FluxStore(patches->nodeCount());
  }
  hands_ = std::move(hands);
  return {};
}

Result<solver::TransportCounters> ShotCrew::run(const ShotSpan& shots, const FluxSink& sink) {
  if (hands_.empty()) return fail(ErrorCode::kInternal, "setScene must come before run");
  if (hands_.size() == 1) return hands_.front()->runner.run(shots, sink);
  Result<solver::TransportCounters> done;
  try {
    done = share(partsOf(shots),
                 [](Hand& hand, const Part& part) { return hand.runner.run(part.shots, hand.store.sink()); });
  } catch (...) {
    clearStores();
    throw;
  }
  if (done) {
    for (auto& hand : hands_) hand->store.sink().drainInto(sink);
  } else {
    clearStores();
  }
  return done;
}

/// Links are handed on as soon as those of all shots before are there, by this thread, as others ask it for images.
Result<solver::TransportCounters> ShotCrew::measure(const ShotSpan& shots, const solver::Transport::TakeLinks& take) {
  if (hands_.empty()) return fail(ErrorCode::kInternal, "setScene must come before measure");
  if (hands_.size() == 1) return hands_.front()->runner.measure(shots, take);
  std::vector<std::optional<solver::LinkSample>> links(shots.gather.size() + shots.scatter.size());
  std::size_t taken = 0;
  const auto hand_on = [&](std::size_t first, std::vector<solver::LinkSample>& found) {
    for (std::size_t i = 0; i < found.size(); ++i) links[first + i] = std::move(found[i]);
    for (; taken < links.size() && links[taken]; ++taken) {
      take(taken, std::move(*links[taken]));
      links[taken].reset();
    }
  };
  return share(partsOf(shots), [&](Hand& hand, const Part& part) {
    std::vector<solver::LinkSample> found;
    auto done = hand.runner.measure(
        part.shots, [&](std::size_t, solver::LinkSample&& sample) { found.push_back(std::move(sample)); });
    if (done) desk_.ask([&] { hand_on(part.first, found); });
    return done;
  });
}

void ShotCrew::clearStores() {
  for (auto& hand : hands_) hand->store.sink().clear();
}

std::vector<ShotCrew::Part> ShotCrew::partsOf(const ShotSpan& shots) const {
  std::vector<Part> parts;
  const std::size_t wanted = kPartsAHand * hands_.size();
  const auto cut = [&](auto ShotSpan::*kind, std::size_t before) {
    const auto all = shots.*kind;
    const std::size_t most = std::max<std::size_t>((all.size() + wanted - 1) / wanted, 1);
    for (std::size_t first = 0; first < all.size(); first += most) {
      Part part{shots, before + first};
      part.shots.scatter = {};
      part.shots.gather = {};
      part.shots.point_lights = {};
      part.shots.parallel = {};
      part.shots.lamps = {};
      part.shots.*kind = all.subspan(first, std::min(most, all.size() - first));
      parts.push_back(part);
    }
  };
  cut(&ShotSpan::gather, 0);
  cut(&ShotSpan::parallel, 0);
  cut(&ShotSpan::point_lights, 0);
  cut(&ShotSpan::lamps, 0);
  cut(&ShotSpan::scatter, shots.gather.size());
  return parts;
}

/// Hands take parts in turn, each in a thread of its own; this one draws for them. After an error the rest is left.
Result<solver::TransportCounters> ShotCrew::share(const std::vector<Part>& parts, const Work& work) {
  std::atomic<std::size_t> next{0};
  std::vector<Result<solver::TransportCounters>> done(parts.size());
  const auto workThrough = [&, task = currentTask()](Hand& hand) {
    const TaskScope scope(task);
    struct Leave {
      RenderDesk& desk;
      std::atomic<std::size_t>& next;
      std::size_t end;
      ~Leave() {
        if (std::uncaught_exceptions() > 0) next = end;
        desk.leave();
      }
    } leave{desk_, next, parts.size()};
    for (auto i = next++; i < parts.size(); i = next++) {
      done[i] = work(hand, parts[i]);
      if (!done[i]) next = parts.size();
    }
  };
  std::vector<std::future<void>> threads;
  threads.reserve(hands_.size());
  std::exception_ptr not_started;
  try {
    while (threads.size() < std::min(hands_.size(), parts.size()))
      threads.push_back(std::async(std::launch::async, workThrough, std::ref(*hands_[threads.size()])));
  } catch (...) {  // no more threads to be had: those that there are do it all
    not_started = std::current_exception();
  }
  desk_.serve(threads.size());  // come what may: they wait for it
  for (auto& thread : threads) thread.wait();
  for (auto& thread : threads) thread.get();
  if (threads.empty() && not_started) std::rethrow_exception(not_started);
  solver::TransportCounters counters;
  for (const auto& part : done) {
    if (!part) return tl::unexpected(part.error());
    counters += *part;
  }
  return counters;
}

}  // namespace radiosity::gpu
