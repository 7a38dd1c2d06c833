// Lays a scene out anew with finer texels where its light wants them, on a thread of its own, while the layout before
// is shown and edited. The solve thread owns the job; one that goes is called off, and its end is waited for.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "common/result.h"
#include "common/task.h"
#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"
#include "server/scene/document/document.h"

namespace radiosity::engine {

class RefineJob {
 public:
  struct Order {
    std::shared_ptr<const scene::Document> document;
    SolveSettings settings;
    scene::ImportLimits limits;
    scene::TexelLayout layout;
    double draft_error = 0.0;  ///< LitScene::setDraft()
  };
  using Made = Result<std::unique_ptr<LitScene>>;

  /// `wake`, which does not throw, is called from another thread when take() has something. Throws std::system_error.
  RefineJob(Order order, solver::Transport& transport, std::function<void()> wake);
  ~RefineJob();
  RefineJob(const RefineJob&) = delete;
  RefineJob& operator=(const RefineJob&) = delete;

  /// Any thread: it is of no use any more, and ends at its next interruption point.
  void cancel() { task_.cancel(); }
  /// Nothing: it is not done yet. Once.
  [[nodiscard]] std::optional<Made> take();
  /// That it took; when it is done.
  [[nodiscard]] double seconds() const { return seconds_; }
  [[nodiscard]] bool isDone() const;
  /// Since it began.
  [[nodiscard]] double secondsSoFar() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
  }

 private:
  void run();
  [[nodiscard]] Made layOut();

  Order order_;
  solver::Transport& transport_;
  std::function<void()> wake_;
  Task task_;
  mutable std::mutex mutex_;
  std::optional<Made> made_;
  double seconds_ = 0.0;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::thread thread_;
};

}  // namespace radiosity::engine
