#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "common/check.h"
#include "server/gpu/run/shot_crew.h"
#include "server/gpu/workers/gpu_transport.h"

namespace radiosity::gpu {
namespace {

class InProcessTransport final : public solver::Transport {
 public:
  explicit InProcessTransport(std::unique_ptr<ShotCrew> crew) : crew_(std::move(crew)) {}

  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override {
    store_ = FluxStore(patches->nodeCount());
    patches_ = patches;
    return crew_->setScene(std::move(patches));
  }

  Result<solver::TransportCounters> run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) override {
    const auto sink = store_.sink();
    auto counters = crew_->run(spanOf(batch), sink);
    if (counters) {
      sink.drainInto(into);
    } else {
      sink.clear();
    }
    return counters;
  }

  Result<solver::TransportCounters> measure(const solver::ShotBatch& batch, const TakeLinks& take) override {
    return crew_->measure(spanOf(batch), take);
  }

  [[nodiscard]] std::string description() const override {
    const auto hands = crew_->hands() > 1 ? fmt::format(", {} threads", crew_->hands()) : "";
    return fmt::format("{}, in process{}, {}", crew_->context().renderer(), hands, sightText(crew_->sight()));
  }

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches_; }

 private:
  std::unique_ptr<ShotCrew> crew_;
  std::shared_ptr<const scene::PatchScene> patches_;
  FluxStore store_;
};

}  // namespace

std::size_t handsFor(bool software, std::size_t contexts) {
  if (software) return 1;
  constexpr std::size_t kMostHands = 32;  // more would wait for the one that draws
  return std::clamp<std::size_t>(std::thread::hardware_concurrency() / contexts, 1, kMostHands);
}

Result<std::unique_ptr<solver::Transport>> makeInProcessTransport(std::size_t hands, std::optional<Drawing> drawing,
                                                                  Sight sight) {
  auto crew = ShotCrew::create(drawing);
  if (!crew) return tl::unexpected(crew.error());
  (*crew)->setSight(sight);
  (*crew)->setHands(hands > 0 ? hands : handsFor((*crew)->context().software(), 1));
  return std::make_unique<InProcessTransport>(std::move(*crew));
}

}  // namespace radiosity::gpu
