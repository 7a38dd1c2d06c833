#include "server/gpu/shot_crew.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <system_error>

namespace radiosity::gpu {
namespace {

/// Parts for each hand: several, since no two take the same time; not one for each shot, since each asks for its images
/// once.
constexpr std::size_t kPartsAHand = 4;

}  // namespace

Result<std::unique_ptr<ShotCrew>> ShotCrew::create() {
  auto renderers = Renderers::create();
  if (!renderers) return tl::unexpected(renderers.error());
  return std::unique_ptr<ShotCrew>(new ShotCrew(std::move(*renderers)));
}

Result<void> ShotCrew::setScene(std::shared_ptr<const scene::PatchScene> patches) {
  if (auto set = renderers_->setScene(patches); !set) return set;
  hands_.clear();
  auto* desk = wanted_ > 1 ? &desk_ : nullptr;
  for (std::size_t i = 0; i < wanted_; ++i) hands_.push_back(std::make_unique<Hand>(ImageSource(*renderers_, desk)));
  const auto receivers = std::make_shared<const Receivers>(patches);
  for (auto& hand : hands_) {
    hand->runner.setScene(receivers);
    if (desk != nullptr) hand->store = FluxStore(patches->nodeCount());
  }
  return {};
}

Result<solver::TransportCounters> ShotCrew::run(const ShotSpan& shots, const FluxSink& sink) {
  if (hands_.size() == 1) return hands_.front()->runner.run(shots, sink);
  auto done = share(partsOf(shots),
                    [](Hand& hand, const Part& part) { return hand.runner.run(part.shots, hand.store.sink()); });
  for (auto& hand : hands_) {
    if (done) {
      hand->store.sink().drainInto(sink);
    } else {
      hand->store.sink().clear();
    }
  }
  return done;
}

Result<solver::TransportCounters> ShotCrew::measure(const ShotSpan& shots, const solver::Transport::TakeLinks& take) {
  if (hands_.size() == 1) return hands_.front()->runner.measure(shots, take);
  std::vector<solver::LinkSample> links(shots.gather.size() + shots.scatter.size());
  auto done = share(partsOf(shots), [&](Hand& hand, const Part& part) {
    const auto keep = [&](std::size_t i, solver::LinkSample&& sample) { links[part.first + i] = std::move(sample); };
    return hand.runner.measure(part.shots, keep);
  });
  if (!done) return done;
  for (std::size_t i = 0; i < links.size(); ++i) take(i, std::move(links[i]));
  return done;
}

std::vector<ShotCrew::Part> ShotCrew::partsOf(const ShotSpan& shots) const {
  std::vector<Part> parts;
  const auto cut = [&](auto ShotSpan::*kind, std::size_t before) {
    const auto all = shots.*kind;
    const std::size_t most =
        std::max<std::size_t>((all.size() + kPartsAHand * hands_.size() - 1) / (kPartsAHand * hands_.size()), 1);
    for (std::size_t first = 0; first < all.size(); first += most) {
      Part part{shots, before + first};
      part.shots.scatter = {};
      part.shots.gather = {};
      part.shots.point_lights = {};
      part.shots.parallel = {};
      part.shots.*kind = all.subspan(first, std::min(most, all.size() - first));
      parts.push_back(part);
    }
  };
  cut(&ShotSpan::gather, 0);
  cut(&ShotSpan::parallel, 0);
  cut(&ShotSpan::point_lights, 0);
  cut(&ShotSpan::scatter, shots.gather.size());
  return parts;
}

/// Hands take parts in turn, each in a thread of its own; this one draws for them. After an error the rest is left.
Result<solver::TransportCounters> ShotCrew::share(const std::vector<Part>& parts, const Work& work) {
  if (hands_.empty()) return fail(ErrorCode::kInternal, "setScene must come before run");
  std::atomic<std::size_t> next{0};
  std::vector<Result<solver::TransportCounters>> done(parts.size());
  const auto workThrough = [&](Hand& hand) {
    struct Leave {
      RenderDesk& desk;
      ~Leave() { desk.leave(); }
    } leave{desk_};
    for (auto i = next++; i < parts.size(); i = next++) {
      done[i] = work(hand, parts[i]);
      if (!done[i]) next = parts.size();
    }
  };
  std::vector<std::future<void>> threads;
  try {
    for (std::size_t i = 0; i < std::min(hands_.size(), parts.size()); ++i)
      threads.push_back(std::async(std::launch::async, workThrough, std::ref(*hands_[i])));
  } catch (const std::system_error& error) {  // no more threads to be had: those that there are do it all
    if (threads.empty()) return fail(ErrorCode::kUnavailable, std::string("cannot start a thread: ") + error.what());
  }
  desk_.serve(threads.size());
  for (auto& thread : threads) thread.get();
  solver::TransportCounters counters;
  for (const auto& part : done) {
    if (!part) return tl::unexpected(part.error());
    counters += *part;
  }
  return counters;
}

}  // namespace radiosity::gpu
