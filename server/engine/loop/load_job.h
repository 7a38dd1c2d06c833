// One load: reads a document and makes of it what the solver needs, on a thread of its own, while the scene before is
// solved and edited. The solve thread owns the job and takes from it what is ready. A job that goes is called off, and
// its end is waited for.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/result.h"
#include "common/task.h"
#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"
#include "server/scene/document/document.h"

namespace radiosity::engine {

class LoadJob {
 public:
  struct Request {
    std::function<Result<scene::Document>()> read;
    Client client;
    Engine::Callback<LoadOutcome> done;
    /// Whether the document is the one whose solve goes on, so that nothing need be made of it; empty: it is not.
    std::function<bool(const scene::Document&)> is_known = {};
    bool goes_on_edited = false;  ///< also where that has been edited since
  };
  struct Options {
    SolveSettings settings;
    std::uint64_t first_light_above = 0, first_texels = 0;  ///< as EngineOptions; 0 texels: no first light is wanted
    scene::ImportLimits limits = {};
    /// Brings to the disk what need not wait until the load is told; what it returns is kept as long as the job. Empty:
    /// nothing outlives the process.
    std::function<std::shared_ptr<void>(const scene::Document&)> keep_ahead = {};
  };

  /// What has been made since the last take(). Every job that is not called off ends with either `known` or `whole`.
  struct Ready {
    std::unique_ptr<LitScene> first_light;
    std::optional<scene::Document> known;
    std::optional<Result<std::unique_ptr<LitScene>>> whole;
  };

  /// `wake`, which does not throw, is called from any thread when take() has more or the progress has changed.
  /// `former`: jobs that were called off, of which the thread waits for the end before it begins.
  LoadJob(Request request, Options options, solver::Transport& transport, std::function<void()> wake,
          std::unique_ptr<LoadJob> former);
  ~LoadJob();
  LoadJob(const LoadJob&) = delete;
  LoadJob& operator=(const LoadJob&) = delete;

  /// Any thread: the job is of no use any more, and ends at its next interruption point. take() has nothing from then
  /// on.
  void cancel();
  [[nodiscard]] Ready take();
  [[nodiscard]] const std::shared_ptr<Task>& task() const { return task_; }
  [[nodiscard]] Request& request() { return request_; }
  [[nodiscard]] const Request& request() const { return request_; }

 private:
  void run();
  void make();
  [[nodiscard]] Result<std::unique_ptr<LitScene>> makeWhole(scene::Document document);
  [[nodiscard]] bool wantsFirstLight(const scene::Scene& scene) const;
  void showFirstLight(const scene::EditedDocument& edited);

  Request request_;
  Options options_;
  solver::Transport& transport_;
  std::function<void()> wake_;
  std::unique_ptr<LoadJob> former_;  ///< the job's own thread lets it go
  std::shared_ptr<Task> task_;
  std::stop_callback<std::function<void()>> when_gone_;
  std::mutex mutex_;
  std::condition_variable taken_;  ///< ready_ was
  Ready ready_;
  std::shared_ptr<void> kept_;  ///< Options::keep_ahead()
  std::thread thread_;
};

}  // namespace radiosity::engine
