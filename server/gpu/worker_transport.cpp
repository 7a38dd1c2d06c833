// A transport that hands chunks of a batch to worker processes.
//
// A worker adds up whatever it does for a batch in its own accumulators in shared memory; they are merged once, when
// the whole batch is done. If a worker dies, its accumulators are thrown away and every chunk it had for this batch,
// done or not, goes back into the queue: nothing is lost and nothing counted twice.
#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <deque>
#include <thread>

#include "common/check.h"
#include "common/log.h"
#include "server/gpu/batch_chunks.h"
#include "server/gpu/gpu_transport.h"
#include "server/gpu/paper_ids.h"
#include "server/gpu/worker_process.h"

namespace radiosity::gpu {
namespace {

/// Chunks a worker holds at a time: one to work on, one so that it need not wait for the next.
constexpr std::size_t kChunksAhead = 2;
/// Deaths of workers in one call after which it gives up.
constexpr int kMaxDeaths = 5;

void add(solver::TransportCounters& into, const solver::TransportCounters& from) {
  into.scatter_shots += from.scatter_shots;
  into.gather_shots += from.gather_shots;
  into.gather_points += from.gather_points;
  into.point_images += from.point_images;
  into.parallel_images += from.parallel_images;
  into.pixels += from.pixels;
  into.links += from.links;
  into.triangles_drawn += from.triangles_drawn;
  into.triangles_culled += from.triangles_culled;
  into.render_seconds += from.render_seconds;
  into.accumulate_seconds += from.accumulate_seconds;
  into.gather_seconds += from.gather_seconds;
}

/// A process and what it has of the current batch.
struct Slot {
  std::optional<WorkerProcess> process;  ///< none: died, to be replaced
  std::deque<std::size_t> held;          ///< chunks sent, not yet reported
  std::vector<std::size_t> done;         ///< chunks reported, still only in its accumulators
  solver::TransportCounters counters;
};

class WorkerTransport final : public solver::Transport {
 public:
  WorkerTransport(std::string executable, std::vector<Slot> slots)
      : executable_(std::move(executable)), slots_(std::move(slots)), renderer_(slots_.front().process->renderer()) {}

  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override {
    auto packed = packScene(*patches);
    if (!packed) return tl::unexpected(packed.error());
    packed_ = std::move(*packed);
    nodes_ = patches->nodeCount();
    triangles_ = patches->triangles.size();
    const auto paper = PaperIds::fits(*patches);
    paper_fits_ = paper.has_value();
    if (!paper) paper_error_ = paper.error();
    has_scene_ = true;
    deaths_ = 0;
    // All upload at the same time.
    std::vector<std::optional<Error>> failed(slots_.size());
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (!slots_[i].process) continue;
      if (auto sent = slots_[i].process->sendScene(packed_, nodes_); !sent) failed[i] = sent.error();
    }
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (slots_[i].process && !failed[i]) {
        if (auto taken = slots_[i].process->awaitScene(); !taken) failed[i] = taken.error();
      }
      if (failed[i]) bury(slots_[i], *failed[i]);
    }
    return replaceDead();
  }

  Result<solver::TransportCounters> run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) override {
    if (!has_scene_) return fail(ErrorCode::kInternal, "setScene must come before run");
    const ShotSpan shots = spanOf(batch);
    if (auto good = checkShots(shots); !good) return tl::unexpected(good.error());
    if (batch.mode == solver::LinkMode::kPaperMipmap && !paper_fits_) return tl::unexpected(paper_error_);
    deaths_ = 0;
    chunks_ = cutBatch(batch, triangles_, slots_.size());
    queue_.clear();
    for (std::size_t i = 0; i < chunks_.size(); ++i) queue_.push_back(i);
    for (auto& slot : slots_) {
      slot.held.clear();
      slot.done.clear();
      slot.counters = {};
    }
    if (auto done = work(batch); !done) {
      // What the workers have of this batch is void; so are they.
      for (auto& slot : slots_) slot.process.reset();
      return tl::unexpected(done.error());
    }
    solver::TransportCounters counters;
    for (auto& slot : slots_) {
      if (!slot.process) continue;
      slot.process->sink().drainInto(into);
      add(counters, slot.counters);
    }
    return counters;
  }

  [[nodiscard]] std::string description() const override {
    return fmt::format("{}, {} worker{}", renderer_, slots_.size(), slots_.size() == 1 ? "" : "s");
  }

 private:
  [[nodiscard]] bool finished() const {
    return queue_.empty() && std::all_of(slots_.begin(), slots_.end(), [](const Slot& s) { return s.held.empty(); });
  }

  Result<void> work(const solver::ShotBatch& batch) {
    while (!finished()) {
      if (auto replaced = replaceDead(); !replaced) return replaced;
      for (auto& slot : slots_) feed(slot, batch);
      listen();
    }
    return {};
  }

  void feed(Slot& slot, const solver::ShotBatch& batch) {
    while (slot.process && slot.held.size() < kChunksAhead && !queue_.empty()) {
      // Towards the end nobody takes a second chunk that another could start on.
      if (!slot.held.empty() && queue_.size() < slots_.size()) break;
      const auto chunk = queue_.front();
      queue_.pop_front();
      slot.held.push_back(chunk);
      if (!sendMessage(slot.process->socket(), MessageKind::kChunk, packChunk(batch, chunks_[chunk], chunk))) {
        bury(slot, Error{ErrorCode::kUnavailable, "a worker process does not take work"});
      }
    }
  }

  /// Waits until some worker has something to say, and hears it.
  void listen() {
    std::vector<pollfd> polls;
    for (const auto& slot : slots_) {
      polls.push_back({slot.process && !slot.held.empty() ? slot.process->socket() : -1, POLLIN, 0});
    }
    const bool any = std::any_of(polls.begin(), polls.end(), [](const pollfd& p) { return p.fd >= 0; });
    if (!any) return;                                      // a death emptied the hands of all; go on
    if (poll(polls.data(), polls.size(), -1) < 0) return;  // interrupted: look again
    for (std::size_t i = 0; i < polls.size(); ++i) {
      if (polls[i].fd >= 0 && polls[i].revents != 0) hear(slots_[i]);
    }
  }

  void hear(Slot& slot) {
    const auto message = slot.process->receive(MessageKind::kChunkDone);
    if (!message) {
      bury(slot, message.error());
      return;
    }
    BodyReader from(message->body);
    const auto report = from.value<ChunkDoneBody>();
    if (!from.good() || slot.held.empty() || slot.held.front() != report.chunk) {
      bury(slot, Error{ErrorCode::kInternal, "a worker process reports work it was not given"});
      return;
    }
    slot.held.pop_front();
    slot.done.push_back(report.chunk);
    add(slot.counters, report.counters);
  }

  /// A worker is gone: its chunks go back into the queue, its accumulators with it into the grave.
  void bury(Slot& slot, const Error& why) {
    log::warn("{}; replacing it, {} chunks to be done again", why.text(), slot.held.size() + slot.done.size());
    last_death_ = why.text();
    ++deaths_;
    queue_.insert(queue_.end(), slot.held.begin(), slot.held.end());
    queue_.insert(queue_.end(), slot.done.begin(), slot.done.end());
    slot = Slot{};
  }

  Result<void> replaceDead() {
    for (auto& slot : slots_) {
      while (!slot.process) {
        if (deaths_ >= kMaxDeaths) {
          return fail(ErrorCode::kUnavailable,
                      fmt::format("gave up after {} worker processes died; the last: {}", deaths_, last_death_));
        }
        if (auto started = startOne(); started) {
          slot.process = std::move(*started);
        } else {
          ++deaths_;
          last_death_ = started.error().text();
        }
      }
    }
    return {};
  }

  Result<WorkerProcess> startOne() {
    auto process = WorkerProcess::start(executable_);
    if (!process) return process;
    if (auto ready = process->awaitReady(); !ready) return tl::unexpected(ready.error());
    if (!has_scene_) return process;
    if (auto sent = process->sendScene(packed_, nodes_); !sent) return tl::unexpected(sent.error());
    if (auto taken = process->awaitScene(); !taken) return tl::unexpected(taken.error());
    return process;
  }

  std::string executable_;
  std::vector<Slot> slots_;
  std::string renderer_;
  SharedMemory packed_;
  std::size_t nodes_ = 0, triangles_ = 0;
  bool has_scene_ = false;
  bool paper_fits_ = true;  ///< whether the scene can be lit in paper mode, and why not
  Error paper_error_;
  std::vector<Chunk> chunks_;
  std::deque<std::size_t> queue_;
  int deaths_ = 0;
  std::string last_death_;
};

}  // namespace

Result<std::unique_ptr<solver::Transport>> makeWorkerTransport(const WorkerOptions& options) {
  if (options.workers < 0 || options.workers > 256) {
    return fail(ErrorCode::kBadUsage,
                fmt::format("{} workers make no sense; use 0 (automatic) to 256", options.workers));
  }
  const auto cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const auto count = options.workers == 0 ? cores : options.workers;
  const std::string executable = options.executable.empty() ? "/proc/self/exe" : options.executable;
  std::vector<Slot> slots(static_cast<std::size_t>(count));
  for (auto& slot : slots) {  // all start at the same time
    auto process = WorkerProcess::start(executable);
    if (!process) return tl::unexpected(process.error());
    slot.process = std::move(*process);
  }
  for (auto& slot : slots) {
    if (auto ready = slot.process->awaitReady(); !ready) return tl::unexpected(ready.error());
  }
  // One context keeps a GPU busy; more only take its memory.
  if (options.workers == 0 && !slots.front().process->software()) slots.erase(slots.begin() + 1, slots.end());
  return std::make_unique<WorkerTransport>(executable, std::move(slots));
}

}  // namespace radiosity::gpu
