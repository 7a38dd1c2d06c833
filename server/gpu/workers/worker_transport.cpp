// A transport that hands chunks of a batch to worker processes.
//
// A worker adds up whatever it does for a batch in its own accumulators in shared memory; they are merged once, when
// the whole batch is done. If a worker dies, or is killed because it hangs, its accumulators are thrown away and every
// chunk it had for this batch, done or not, goes back into the queue: nothing is lost and nothing counted twice.
#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <optional>
#include <thread>
#include <utility>

#include "common/log.h"
#include "server/gpu/draw/paper_ids.h"
#include "server/gpu/run/sight_trial.h"
#include "server/gpu/workers/batch_chunks.h"
#include "server/gpu/workers/gpu_transport.h"
#include "server/gpu/workers/prepared_scene.h"
#include "server/gpu/workers/worker_process.h"
#include "server/gpu/workers/worker_slot.h"
#include "server/gpu/workers/worker_start.h"

namespace radiosity::gpu {
namespace {

/// Chunks a worker holds at a time: one to work on, one so that it need not wait for the next.
constexpr std::size_t kChunksAhead = 2;
/// Deaths of workers in one call after which it gives up.
constexpr int kMaxDeaths = 5;
/// WorkerOptions::patience, for each pixel.
constexpr double kSlowPixelSeconds = 2e-6;
/// Of the time that a late worker is given again it must have used this part: one that is stopped, or waits for ever,
/// uses nothing.
constexpr int kLeastUse = 5000;
/// And it is given time so often at most: what waits for a card that hangs may look now and then whether it still does.
constexpr int kMostExtensions = 30;
/// A batch that may be put off has so long, twice as long after each that brought nothing, and is then asked about
/// every so often.
constexpr std::chrono::milliseconds kUndisturbed{100}, kBetweenLooks{10};
constexpr std::chrono::steady_clock::duration kMostUndisturbed = std::chrono::minutes(2);
/// A worker takes in a scene at ten times this rate at least.
constexpr double kSlowSceneBytesPerSecond = 5e6;

using Clock = std::chrono::steady_clock;

Clock::duration seconds(double value) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(value));
}

class WorkerTransport final : public solver::Transport {
 public:
  WorkerTransport(WorkerOptions options, std::vector<WorkerProcess> workers, FileDescriptor wake)
      : options_(std::move(options)),
        slots_(workers.size()),
        renderer_(workers.front().renderer()),
        hands_(options_.hands > 0 ? options_.hands : handsFor(workers.front().software(), workers.size())),
        sight_(sightFor(options_.sight, workers.front().software())),
        wake_(std::move(wake)) {
    for (std::size_t i = 0; i < workers.size(); ++i) slots_[i].process = std::move(workers[i]);
  }
  ~WorkerTransport() override { killAll(); }
  WorkerTransport(const WorkerTransport&) = delete;
  WorkerTransport& operator=(const WorkerTransport&) = delete;

  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override {
    if (auto begun = beginScene(std::move(patches), nullptr); !begun) return begun;
    return finishScene();
  }

  [[nodiscard]] Result<std::unique_ptr<Prepared>> prepareScene(const scene::PatchScene& patches) const override {
    return PreparedScene::make(patches);
  }

  /// All upload at the same time.
  Result<void> beginScene(std::shared_ptr<const scene::PatchScene> patches,
                          std::unique_ptr<Prepared> prepared) override {
    awaitScenes();  // of one that was not finished
    if (!prepared) {
      auto made = prepareScene(*patches);
      if (!made) return tl::unexpected(made.error());
      prepared = std::move(*made);
    }
    auto& scene = static_cast<PreparedScene&>(*prepared);
    packed_ = std::move(scene.packed);
    paper_fits_ = std::move(scene.paper_fits);
    nodes_ = patches->nodeCount();
    triangles_ = patches->triangles.size();
    patches_ = patches;
    has_scene_ = true;
    deaths_ = 0;
    for (auto& slot : slots_) {
      if (!slot.process) continue;
      auto sent = slot.process->sendScene(packed_, sceneBody(), scenePatience());
      slot.takes_scene = sent.has_value();
      if (!sent) lose(slot, sent.error());
    }
    return {};
  }

  [[nodiscard]] bool hasTakenScene() override {
    return std::ranges::none_of(slots_, [](const Slot& slot) {
      pollfd answer{slot.takes_scene ? slot.process->socket() : -1, POLLIN, 0};
      return slot.takes_scene && poll(&answer, 1, 0) == 0;
    });
  }

  Result<void> finishScene() override {
    awaitScenes();
    return replaceDead();
  }

  Result<solver::TransportCounters> run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) override {
    if (auto done = carryOut(batch); !done) return tl::unexpected(done.error());
    solver::TransportCounters counters;
    for (auto& slot : slots_) {
      if (!slot.process) continue;
      slot.process->sink().drainInto(into);
      counters += slot.counters;
    }
    return counters;
  }

  Result<solver::TransportCounters> measure(const solver::ShotBatch& batch, const TakeLinks& take) override {
    links_.assign(batch.gather.size() + batch.scatter.size(), std::nullopt);
    next_taken_ = 0;
    take_ = &take;
    const auto done = carryOut(batch);
    take_ = nullptr;
    if (!done) return tl::unexpected(done.error());
    solver::TransportCounters counters;
    for (const auto& slot : slots_) counters += slot.counters;
    return counters;
  }

  void setImpatience(std::function<bool()> is_wanted) override { is_wanted_ = std::move(is_wanted); }

  void interrupt() override {
    interrupted_ = true;
    (void)eventfd_write(wake_.get(), 1);  // never read: whoever waits now or later is woken
  }

  [[nodiscard]] Losses losses() const override { return {losses_, last_death_}; }

  [[nodiscard]] Renderers look() override {
    for (auto& slot : slots_) {
      if (const auto ended = slot.process ? slot.process->ending() : std::nullopt) bury(slot, *ended);
    }
    const auto missing = std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) { return !slot.process; });
    return {slots_.size(), static_cast<std::size_t>(missing), missing > 0 ? last_death_ : std::string()};
  }

  [[nodiscard]] Result<void> replaceMissing() override {
    deaths_ = 0;
    return replaceDead();
  }

  [[nodiscard]] std::string description() const override {
    auto text = fmt::format("{}, {} worker{}", renderer_, slots_.size(), slots_.size() == 1 ? "" : "s");
    if (hands_ > 1) text += fmt::format(" of {} threads", hands_);
    text += std::string(", ") + sightText(sight_);
    if (times_)
      text += fmt::format(" (tried: rays {:.1f} ms, images {:.1f} ms)", 1e3 * times_->rays, 1e3 * times_->images);
    return text;
  }

  /// Lets lights see in the way that is faster here. Before there is a scene; takes some tenths of a second. Where a
  /// renderer fails, all stays as it was.
  void trySights() {
    const auto kept = sight_;
    auto times = timeSights();
    forgetScene();
    if (times) {
      times_ = *times;
      sight_ = fasterSight(*times);
    } else {
      sight_ = kept;
      log::warn("cannot try how lights see faster, so that {}: {}", sightText(sight_), times.error().text());
    }
  }

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches_; }

 private:
  Result<SightTimes> timeSights() {
    const auto room = options_.make_trial_room();
    if (!room) return tl::unexpected(room.error());
    return timeBoth(*room, *this, [this](Sight sight) { sight_ = sight; });
  }

  void forgetScene() {
    has_scene_ = false;
    patches_.reset();
    packed_ = {};
    nodes_ = triangles_ = 0;
  }

  Result<void> carryOut(const solver::ShotBatch& batch) {
    if (!has_scene_) return fail(ErrorCode::kInternal, "setScene must come before run");
    if (std::ranges::any_of(slots_, &Slot::takes_scene))
      return fail(ErrorCode::kInternal, "finishScene must come after beginScene");
    const ShotSpan shots = spanOf(batch);
    if (auto good = checkShots(shots); !good) return good;
    if (batch.mode == solver::LinkMode::kPaperMipmap && !paper_fits_) return tl::unexpected(paper_fits_.error());
    deaths_ = 0;
    ++batch_;
    put_off_ = lacks_ = keeps_place_ = false;
    gather_shots_ = batch.gather.size();
    chunks_ = cutBatch(batch, {triangles_, nodes_}, {slots_.size(), hands_});
    queue_.clear();
    for (std::size_t i = 0; i < chunks_.size(); ++i) queue_.push_back(i);
    for (auto& slot : slots_) {
      slot.held.clear();
      slot.done.clear();
      slot.counters = {};
    }
    auto done = work(batch);
    if (!done) killAll();                         // what the workers have of this batch is void; so are they
    for (auto& slot : slots_) slot.done.clear();  // who dies from here on takes nothing of it into the grave
    // Whoever asks over and over must not keep a long shot from ever being done.
    const bool is_in_vain = lacks_ && !keeps_place_ && (take_ == nullptr || next_taken_ == 0);
    undisturbed_ = is_in_vain ? std::min(2 * undisturbed_, kMostUndisturbed) : Clock::duration(kUndisturbed);
    if (!done || !lacks_) return done;
    for (auto& slot : slots_) {
      if (slot.process) slot.process->sink().clear();
    }
    return fail(ErrorCode::kCancelled, "put off");
  }

  void awaitScenes() {
    for (auto& slot : slots_) {
      if (!std::exchange(slot.takes_scene, false)) continue;
      if (auto taken = slot.process->awaitScene(scenePatience()); !taken) lose(slot, taken.error());
    }
  }

  /// A worker that did not take a scene in.
  void lose(Slot& slot, const Error& why) {
    slot.takes_scene = false;
    if (!interrupted_) bury(slot, why);
  }

  [[nodiscard]] bool finished() const {
    return queue_.empty() && std::all_of(slots_.begin(), slots_.end(), [](const Slot& s) { return s.held.empty(); });
  }

  [[nodiscard]] Patience patienceUntil(Clock::time_point deadline) const { return {deadline, wake_.get()}; }
  [[nodiscard]] Patience scenePatience() const {
    const auto bytes = static_cast<double>(packed_.bytes().size() + fluxRegionBytes(nodes_));
    return patienceUntil(Clock::now() + kStartPatience + seconds(bytes / kSlowSceneBytesPerSecond));
  }

  /// All at the same time: a dying worker needs some milliseconds to give its memory back.
  void killAll() {
    for (const auto& slot : slots_) {
      if (slot.process) slot.process->kill();
    }
    for (auto& slot : slots_) slot.process.reset();
  }

  Result<void> work(const solver::ShotBatch& batch) {
    for (const auto undisturbed = Clock::now() + undisturbed_; !finished();) {
      if (interrupted_) return fail(ErrorCode::kUnavailable, "interrupted");
      if (auto replaced = replaceDead(); !replaced) return replaced;
      for (auto& slot : slots_) feed(slot, batch);
      const bool looks = batch.may_be_put_off && is_wanted_ && !put_off_;
      listen(looks ? std::optional(std::max(undisturbed, Clock::now() + kBetweenLooks)) : std::nullopt);
      if (looks && Clock::now() >= undisturbed && is_wanted_()) putOff();
    }
    return {};
  }

  /// What no worker has yet is dropped, and those that have something leave it where they are.
  void putOff() {
    put_off_ = true;
    dropQueue();
    for (auto& slot : slots_) {
      if (slot.process) slot.process->putOff(batch_);
    }
  }

  void dropQueue() {
    lacks_ |= !queue_.empty();
    queue_.clear();
  }

  void feed(Slot& slot, const solver::ShotBatch& batch) {
    while (slot.process && slot.held.size() < kChunksAhead && !queue_.empty()) {
      // Towards the end nobody takes a second chunk that another could start on.
      if (!slot.held.empty() && queue_.size() < slots_.size()) break;
      const auto chunk = queue_.front();
      queue_.pop_front();
      slot.held.push_back(chunk);
      if (slot.held.size() == 1) startClock(slot);
      const auto sent =
          slot.process->send(MessageKind::kChunk, packChunk(batch, chunks_[chunk], {batch_, chunk}, take_ != nullptr),
                             patienceUntil(slot.deadline));
      if (!sent && !interrupted_) bury(slot, sent.error());
      if (!sent) return;
    }
  }

  /// The worker starts on the chunk it has held longest.
  void startClock(Slot& slot) const {
    slot.patience = options_.patience + seconds(kSlowPixelSeconds * chunks_[slot.held.front()].cost);
    slot.deadline = Clock::now() + slot.patience;
    slot.used_before = slot.used_lately = slot.process->processorTime();
    slot.extensions = 0;
  }

  /// On a busy machine a worker may be late because it was hardly let run. It is given as long again, as long as it
  /// uses what it gets, and until it has had in processor time what a chunk may take.
  [[nodiscard]] bool givenMoreTime(Slot& slot) const {
    const Clock::duration used = slot.process->processorTime();
    const bool runs = used - slot.used_lately >= slot.patience / kLeastUse;
    const auto most = slot.patience * static_cast<int>(hands_);  // that all its threads together may use
    if (!runs || used - slot.used_before >= most) return false;
    if (!slot.process->software() && ++slot.extensions > kMostExtensions) return false;
    slot.used_lately = used;
    slot.deadline = Clock::now() + slot.patience;
    return true;
  }

  /// Waits until some worker has something to say and hears it, or until one is late and buries it, or for a wake-up,
  /// or until `longest`.
  void listen(std::optional<Clock::time_point> longest) {
    std::vector<pollfd> polls;
    auto deadline = Clock::time_point::max();
    for (const auto& slot : slots_) {
      const bool owes = slot.process && !slot.held.empty();
      polls.push_back({owes ? slot.process->socket() : -1, POLLIN, 0});
      if (owes) deadline = std::min(deadline, slot.deadline);
    }
    if (deadline == Clock::time_point::max()) return;  // a death emptied the hands of all; go on
    polls.push_back({wake_.get(), POLLIN, 0});
    const auto until = longest ? std::min(*longest, deadline) : deadline;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    constexpr std::int64_t kLongestMs = 60'000;  // then it looks again
    if (poll(polls.data(), polls.size(), static_cast<int>(std::clamp<std::int64_t>(left, 0, kLongestMs))) < 0) return;
    if (polls.back().revents != 0) return;
    const auto now = Clock::now();
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (polls[i].fd < 0) continue;
      if (polls[i].revents != 0) {
        hear(slots_[i]);
      } else if (now >= slots_[i].deadline && !givenMoreTime(slots_[i])) {
        bury(slots_[i],
             Error{ErrorCode::kUnavailable, fmt::format("worker process {} hangs", slots_[i].process->pid())});
      }
    }
  }

  void hear(Slot& slot) {
    const auto message = slot.process->receive(MessageKind::kChunkDone, patienceUntil(slot.deadline));
    if (!message) {
      if (!interrupted_) bury(slot, message.error());
      return;
    }
    BodyReader from(message->body);
    const auto report = from.value<ChunkDoneBody>();
    if (!from.good() || slot.held.empty() || slot.held.front() != report.chunk) {
      bury(slot, Error{ErrorCode::kInternal, "a worker process reports work it was not given"});
      return;
    }
    const bool is_put_off = put_off_ && report.put_off != 0;
    lacks_ |= is_put_off;
    const auto& chunk = chunks_[report.chunk];
    if (take_ != nullptr && !takeLinks(from, chunk, is_put_off ? std::min(report.shots, chunk.count) : chunk.count)) {
      bury(slot, Error{ErrorCode::kInternal, "a worker process reports links that make no sense"});
      return;
    }
    // Of links the first that is not there yet: those after it are thrown away.
    const auto first = chunk.first + (chunk.kind == ShotKind::kGather ? 0 : gather_shots_);
    const bool is_next = first <= next_taken_ && next_taken_ < first + chunk.count;
    keeps_place_ |= is_put_off && report.put_off == kKeepsPlace && is_next;
    slot.held.pop_front();
    slot.done.push_back(report.chunk);
    if (!slot.held.empty()) startClock(slot);
    slot.counters += report.counters;
  }

  /// Links are handed on in the order of the shots; what was handed on before its worker died and was measured again is
  /// the same, and dropped.
  [[nodiscard]] bool takeLinks(BodyReader& from, const Chunk& chunk, std::size_t count) {
    const auto first = chunk.first + (chunk.kind == ShotKind::kGather ? 0 : gather_shots_);
    for (auto i = first; i < first + count; ++i) {
      solver::LinkSample links;
      if (!unpackLinks(from, nodes_, links)) return false;
      if (i >= next_taken_) links_[i] = std::move(links);
    }
    for (; next_taken_ < links_.size() && links_[next_taken_]; ++next_taken_) {
      (*take_)(next_taken_, std::move(*links_[next_taken_]));
      links_[next_taken_].reset();
    }
    return true;
  }

  /// A worker is gone: its chunks go back into the queue, its accumulators with it into the grave.
  void bury(Slot& slot, const Error& why) {
    log::warn("{}; replacing it, {} chunks to be done again", why.text(), slot.held.size() + slot.done.size());
    last_death_ = why.text();
    ++deaths_;
    ++losses_;
    queue_.insert(queue_.end(), slot.held.begin(), slot.held.end());
    queue_.insert(queue_.end(), slot.done.begin(), slot.done.end());
    slot = Slot{};
    if (put_off_) dropQueue();
  }

  Result<void> replaceDead() {
    for (auto& slot : slots_) {
      while (!slot.process) {
        if (interrupted_) return fail(ErrorCode::kUnavailable, "interrupted");
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

  [[nodiscard]] SceneBody sceneBody() const { return {nodes_, hands_, static_cast<std::uint64_t>(sight_)}; }

  Result<WorkerProcess> startOne() {
    auto process = WorkerProcess::start(options_.executable);
    if (!process) return process;
    if (auto ready = process->awaitReady(patienceUntil(Clock::now() + kStartPatience)); !ready)
      return tl::unexpected(ready.error());
    if (!has_scene_) return process;
    if (auto sent = process->sendScene(packed_, sceneBody(), scenePatience()); !sent)
      return tl::unexpected(sent.error());
    if (auto taken = process->awaitScene(scenePatience()); !taken) return tl::unexpected(taken.error());
    return process;
  }

  WorkerOptions options_;
  std::vector<Slot> slots_;
  std::string renderer_;
  std::size_t hands_;                ///< of each worker
  Sight sight_;                      ///< of all workers, and of those that replace them
  std::optional<SightTimes> times_;  ///< where both were tried
  FileDescriptor wake_;
  std::atomic<bool> interrupted_{false};
  std::shared_ptr<const scene::PatchScene> patches_;
  SharedMemory packed_;
  std::size_t nodes_ = 0, triangles_ = 0;
  bool has_scene_ = false;
  Result<void> paper_fits_;
  std::vector<Chunk> chunks_;
  std::size_t gather_shots_ = 0;  ///< of the batch
  std::function<bool()> is_wanted_;
  std::uint64_t batch_ = 0;
  Clock::duration undisturbed_ = kUndisturbed;            ///< kUndisturbed, or longer
  bool put_off_ = false, lacks_ = false;                  ///< this batch; and some of it was not done
  bool keeps_place_ = false;                              ///< a worker is to go on in the middle of a shot
  const TakeLinks* take_ = nullptr;                       ///< where links are wanted
  std::vector<std::optional<solver::LinkSample>> links_;  ///< by shot, of those that others must go before
  std::size_t next_taken_ = 0;
  std::deque<std::size_t> queue_;
  int deaths_ = 0;            ///< in the present call
  std::uint64_t losses_ = 0;  ///< in all
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
  auto chosen = options;
  if (chosen.executable.empty()) chosen.executable = "/proc/self/exe";
  FileDescriptor wake(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (wake.get() < 0) return fail(ErrorCode::kUnavailable, "cannot make an event descriptor: too many are open");
  auto workers = startWorkers(chosen.executable, static_cast<std::size_t>(count), options.workers == 0);
  if (!workers) return tl::unexpected(workers.error());
  const bool tries = chosen.make_trial_room && wantsTrial(chosen.sight, workers->front().software());
  auto transport = std::make_unique<WorkerTransport>(std::move(chosen), std::move(*workers), std::move(wake));
  if (tries) transport->trySights();
  return transport;
}

}  // namespace radiosity::gpu
