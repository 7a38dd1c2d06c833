#include "server/engine/loop/refine_job.h"

#include <pthread.h>

#include <chrono>
#include <cmath>
#include <utility>

#include "server/engine/lit/memory.h"

namespace radiosity::engine {

RefineJob::RefineJob(Order order, solver::Transport& transport, std::function<void()> wake)
    : order_(std::move(order)), transport_(transport), wake_(std::move(wake)), thread_([this] { run(); }) {
  (void)pthread_setname_np(thread_.native_handle(), "refine");
}

RefineJob::~RefineJob() {
  task_.cancel();
  thread_.join();
}

/// Rows and columns are whole: where that makes more texels than there may be, coarser ones are tried.
RefineJob::Made RefineJob::layOut() {
  constexpr int kMostTries = 4;
  constexpr double kSpare = 0.97;
  for (int tries = 1;; ++tries) {
    auto lit = LitScene::make(*order_.document, order_.settings, transport_, order_.limits, order_.layout);
    if (!lit || (*lit)->patchCount() <= order_.settings.texels || tries == kMostTries) return lit;
    const auto part = static_cast<double>(order_.settings.texels) / static_cast<double>((*lit)->patchCount());
    for (auto& detail : order_.layout.detail) detail *= static_cast<float>(kSpare * std::sqrt(part));
  }
}

void RefineJob::run() {
  const auto begin = std::chrono::steady_clock::now();
  auto made = unlessCancelled(task_, [&]() -> Made {
    auto lit = layOut();
    if (!lit) return lit;
    (*lit)->setDraft(order_.draft_error);
    (*lit)->prepareSolve();  // all that the solve thread need not do
    (*lit)->prepareUpload();
    return lit;
  });
  {
    const std::scoped_lock lock(mutex_);
    made_ = std::move(made);
    seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  wake_();
}

std::optional<RefineJob::Made> RefineJob::take() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(made_, std::nullopt);
}

bool RefineJob::isDone() const {
  const std::scoped_lock lock(mutex_);
  return made_.has_value();
}

}  // namespace radiosity::engine
