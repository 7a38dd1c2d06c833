#include <fmt/format.h>

#include "common/check.h"
#include "server/gpu/gpu_transport.h"
#include "server/gpu/shot_runner.h"

namespace radiosity::gpu {
namespace {

class InProcessTransport final : public solver::Transport {
 public:
  explicit InProcessTransport(std::unique_ptr<ShotRunner> runner) : runner_(std::move(runner)) {}

  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override {
    store_ = FluxStore(patches->nodeCount());
    patches_ = patches;
    return runner_->setScene(std::move(patches));
  }

  Result<solver::TransportCounters> run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) override {
    const auto sink = store_.sink();
    auto counters = runner_->run(spanOf(batch), sink);
    if (counters) {
      sink.drainInto(into);
    } else {
      sink.clear();
    }
    return counters;
  }

  Result<solver::TransportCounters> measure(const solver::ShotBatch& batch, const TakeLinks& take) override {
    return runner_->measure(spanOf(batch), take);
  }

  [[nodiscard]] std::string description() const override {
    return fmt::format("{}, in process", runner_->context().renderer());
  }

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches_; }

 private:
  std::unique_ptr<ShotRunner> runner_;
  std::shared_ptr<const scene::PatchScene> patches_;
  FluxStore store_;
};

}  // namespace

Result<std::unique_ptr<solver::Transport>> makeInProcessTransport() {
  auto runner = ShotRunner::create();
  if (!runner) return tl::unexpected(runner.error());
  return std::make_unique<InProcessTransport>(std::move(*runner));
}

}  // namespace radiosity::gpu
