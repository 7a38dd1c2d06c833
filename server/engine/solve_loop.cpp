#include "server/engine/solve_loop.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <exception>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

#include "common/log.h"
#include "server/engine/exports.h"
#include "server/engine/framing.h"
#include "server/engine/lit_scene.h"
#include "server/engine/publisher.h"
#include "server/engine/status_report.h"
#include "server/gpu/view_renderer.h"

namespace radiosity::engine {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t kMaxQueue = 1024;
constexpr auto kPublishInterval = std::chrono::milliseconds(50);
constexpr auto kProgressInterval = std::chrono::milliseconds(100);

class SolveLoop final : public Engine {
 public:
  explicit SolveLoop(EngineOptions options) : options_(std::move(options)), settings_(options_.settings) {}
  ~SolveLoop() override;
  SolveLoop(const SolveLoop&) = delete;
  SolveLoop& operator=(const SolveLoop&) = delete;

  [[nodiscard]] Result<void> start();

  void loadBytes(std::string name, SharedBytes bytes, Callback<LoadOutcome> done) override;
  void loadFile(std::string path, Callback<LoadOutcome> done) override;
  void patch(PatchRequest request, Callback<PatchOutcome> done) override;
  void configure(SolveSettings settings, Callback<SolveSettings> done) override;
  void pause(Callback<SolveState> done) override;
  void resume(Callback<SolveState> done) override;
  void restart(Callback<SolveState> done) override;
  [[nodiscard]] Status status() const override;
  [[nodiscard]] std::shared_ptr<const Lightmaps> lightmaps() const override;
  void sceneText(Callback<SceneText> done) override;
  void sceneGlb(Callback<SharedBytes> done) override;
  void unlitGlb(Callback<SharedBytes> done) override;
  void lightmapExr(std::uint32_t page, Callback<SharedBytes> done) override;
  void snapshot(SnapshotRequest request, Callback<SharedBytes> done) override;
  void addListener(std::weak_ptr<Listener> listener) override;

 private:
  /// Runs `work` on the solve thread and hands its Result to `done`; answers kBusy at once when the queue is full.
  template <typename T, typename Work>
  void ask(Callback<T> done, Work work);
  template <typename T, typename Work>
  void askLit(Callback<T> done, Work work);

  void threadMain(std::promise<Result<void>>& started);
  bool takeCommands();
  void solveSlice();
  void endSolve(SolveState state);
  [[nodiscard]] Result<LoadOutcome> install(Result<scene::Document> document);
  [[nodiscard]] Result<PatchOutcome> applyRequest(const PatchRequest& request);
  [[nodiscard]] Result<SharedBytes> renderSnapshot(const SnapshotRequest& request);
  [[nodiscard]] Result<SharedBytes> makeUnlit();
  [[nodiscard]] Result<SharedBytes> makeExr(std::uint32_t page);
  [[nodiscard]] Result<void> recharge(const SolveSettings& settings);
  void beginSolve();
  void publishLightmaps(bool final);
  void updateStatus(bool announce);
  template <typename Call>
  void tellListeners(Call call);

  EngineOptions options_;

  // solve thread only
  SolveSettings settings_;
  std::unique_ptr<solver::Transport> transport_;
  std::unique_ptr<gpu::ViewRenderer> view_;
  std::unique_ptr<LitScene> lit_;
  Publisher publisher_;
  SolveState state_ = SolveState::kEmpty;
  std::string failure_;
  std::uint64_t revision_ = 0;
  double seconds_ = 0.0;
  bool unpublished_ = false;
  Clock::time_point last_publish_{}, last_progress_{};

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> commands_;
  bool stop_ = false;
  Status status_;
  std::shared_ptr<const Lightmaps> lightmaps_;
  std::vector<std::weak_ptr<Listener>> listeners_;
  std::thread thread_;
};

SolveLoop::~SolveLoop() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

Result<void> SolveLoop::start() {
  std::promise<Result<void>> started;
  auto outcome = started.get_future();
  thread_ = std::thread([this, &started] { threadMain(started); });
  return outcome.get();
}

template <typename T, typename Work>
void SolveLoop::ask(Callback<T> done, Work work) {
  {
    const std::scoped_lock lock(mutex_);
    if (!stop_ && commands_.size() < kMaxQueue) {
      commands_.push_back([done = std::move(done), work = std::move(work)]() mutable { done(work()); });
      wake_.notify_all();
      return;
    }
  }
  done(fail(ErrorCode::kBusy, "too many requests are waiting for the solver, try again"));
}

template <typename T, typename Work>
void SolveLoop::askLit(Callback<T> done, Work work) {
  ask<T>(std::move(done), [this, work = std::move(work)]() mutable -> Result<T> {
    if (!lit_) return fail(ErrorCode::kNotFound, "no scene is loaded");
    return work();
  });
}

void SolveLoop::threadMain(std::promise<Result<void>>& started) {
  auto transport = options_.make_transport();
  if (!transport) {
    started.set_value(tl::unexpected<Error>(transport.error()));
    return;
  }
  transport_ = std::move(*transport);
  updateStatus(false);
  started.set_value({});
  while (takeCommands()) {
    if (state_ == SolveState::kSolving) solveSlice();
  }
  lit_.reset();
  view_.reset();
  transport_.reset();
}

/// Waits for work, then does all commands that are due. False: the engine is being destroyed.
bool SolveLoop::takeCommands() {
  std::deque<std::function<void()>> due;
  {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [this] { return stop_ || !commands_.empty() || state_ == SolveState::kSolving; });
    if (stop_) return false;
    due.swap(commands_);
  }
  for (auto& command : due) command();
  return true;
}

void SolveLoop::solveSlice() {
  const auto begin = Clock::now();
  const auto outcome = lit_->solver().step();
  seconds_ += std::chrono::duration<double>(Clock::now() - begin).count();
  if (!outcome) {
    failure_ = outcome.error().text();
    log::error("solve stopped: {}", failure_);
    endSolve(SolveState::kFailed);
    return;
  }
  unpublished_ = true;
  if (*outcome == solver::StepOutcome::kConverged) {
    endSolve(SolveState::kConverged);
  } else if (settings_.time_limit_s && seconds_ >= *settings_.time_limit_s) {
    endSolve(SolveState::kTimeLimit);
  } else {
    const auto now = Clock::now();
    if (now - last_publish_ >= kPublishInterval) publishLightmaps(false);
    if (now - last_progress_ >= kProgressInterval) updateStatus(true);
  }
}

void SolveLoop::endSolve(SolveState state) {
  state_ = state;
  updateStatus(false);
  publishLightmaps(true);
  updateStatus(true);
}

void SolveLoop::beginSolve() {
  seconds_ = 0.0;
  failure_.clear();
  state_ = SolveState::kSolving;
  unpublished_ = true;
  updateStatus(true);
}

Result<LoadOutcome> SolveLoop::install(Result<scene::Document> document) {
  if (!document) return tl::unexpected<Error>(document.error());
  const SolveState before = std::exchange(state_, SolveState::kLoading);
  updateStatus(true);
  auto made = LitScene::make(std::move(*document), settings_, *transport_);
  if (!made) {
    state_ = before;
    if (lit_) {  // the old scene goes on; the transport may already hold the new one
      auto again = LitScene::make(lit_->document(), settings_, *transport_);
      if (again) lit_ = std::move(*again);
    }
    updateStatus(true);
    return tl::unexpected<Error>(made.error());
  }
  lit_ = std::move(*made);
  ++revision_;
  publisher_.reset();
  for (const auto& warning : lit_->warnings()) log::warn("{}", warning);
  beginSolve();
  tellListeners([this](Listener& listener) { listener.onSceneLoaded(revision_); });
  publishLightmaps(false);
  return LoadOutcome{revision_, lit_->warnings()};
}

void SolveLoop::loadBytes(std::string name, SharedBytes bytes, Callback<LoadOutcome> done) {
  ask<LoadOutcome>(std::move(done), [this, name = std::move(name), bytes = std::move(bytes)] {
    return install(scene::parseDocument(name, *bytes));
  });
}

void SolveLoop::loadFile(std::string path, Callback<LoadOutcome> done) {
  ask<LoadOutcome>(std::move(done), [this, path = std::move(path)] { return install(scene::loadDocument(path)); });
}

Result<PatchOutcome> SolveLoop::applyRequest(const PatchRequest& request) {
  if (request.base_revision && *request.base_revision != revision_) {
    return fail(ErrorCode::kStaleRevision, "the scene is at revision " + std::to_string(revision_) + ", not " +
                                               std::to_string(*request.base_revision));
  }
  const auto patch = nlohmann::json::parse(request.patch, nullptr, false);
  if (patch.is_discarded()) return fail(ErrorCode::kBadInput, "the patch is not JSON");
  auto next = scene::applyPatch(lit_->document(), patch);
  if (!next) return tl::unexpected<Error>(next.error());
  const auto change = lit_->changeTo(*next);
  PatchOutcome outcome;
  outcome.revision = revision_;
  if (request.dry_run) {
    const auto imported = scene::importScene(*next);
    if (!imported) return tl::unexpected<Error>(imported.error());
    return outcome;
  }
  if (change == LitScene::Change::kGeometry) {
    auto made = LitScene::make(std::move(*next), settings_, *transport_);
    if (!made) {
      if (const auto back = transport_->setScene(std::make_shared<scene::PatchScene>(lit_->patches())); !back) {
        failure_ = back.error().text();
        endSolve(SolveState::kFailed);
      }
      return tl::unexpected<Error>(made.error());
    }
    outcome.affected_surfaces = (*made)->patches().surfaces.size();
    outcome.affected_shots = lit_->solver().shots();
    lit_ = std::move(*made);
    publisher_.reset();
  } else {
    const auto affected = lit_->reshade(std::move(*next), change);
    if (!affected) return tl::unexpected<Error>(affected.error());
    outcome.affected_surfaces = *affected;
  }
  outcome.revision = ++revision_;
  tellListeners([&](Listener& listener) { listener.onScenePatched(revision_, request.patch, request.by); });
  if (outcome.affected_surfaces > 0 && state_ != SolveState::kPaused) beginSolve();
  publishLightmaps(false);
  return outcome;
}

void SolveLoop::patch(PatchRequest request, Callback<PatchOutcome> done) {
  askLit<PatchOutcome>(std::move(done), [this, request = std::move(request)] { return applyRequest(request); });
}

Result<void> SolveLoop::recharge(const SolveSettings& settings) {
  auto made = LitScene::make(lit_->document(), settings, *transport_);
  if (!made) return tl::unexpected<Error>(made.error());
  lit_ = std::move(*made);
  publisher_.reset();
  beginSolve();
  tellListeners([this](Listener& listener) { listener.onSceneLoaded(revision_); });
  return {};
}

void SolveLoop::configure(SolveSettings settings, Callback<SolveSettings> done) {
  ask<SolveSettings>(std::move(done), [this, settings]() -> Result<SolveSettings> {
    const SolveSettings before = std::exchange(settings_, settings);
    if (!lit_) {
      updateStatus(true);
      return settings_;
    }
    if (before.texels != settings.texels || before.texel_size_m != settings.texel_size_m) {
      if (const auto made = recharge(settings); !made) {
        settings_ = before;
        return tl::unexpected<Error>(made.error());
      }
    } else if (before.seed != settings.seed || before.paper_mode != settings.paper_mode) {
      lit_->restart(settings);
      beginSolve();
    } else {
      lit_->retarget(settings);
      const bool stopped = state_ == SolveState::kConverged || state_ == SolveState::kTimeLimit;
      if (stopped && settings.target_error < lit_->solver().error().total) state_ = SolveState::kSolving;
    }
    updateStatus(true);
    return settings_;
  });
}

void SolveLoop::pause(Callback<SolveState> done) {
  ask<SolveState>(std::move(done), [this]() -> Result<SolveState> {
    if (state_ == SolveState::kSolving) state_ = SolveState::kPaused;
    updateStatus(true);
    return state_;
  });
}

void SolveLoop::resume(Callback<SolveState> done) {
  ask<SolveState>(std::move(done), [this]() -> Result<SolveState> {
    if (state_ == SolveState::kPaused) state_ = SolveState::kSolving;
    updateStatus(true);
    return state_;
  });
}

void SolveLoop::restart(Callback<SolveState> done) {
  askLit<SolveState>(std::move(done), [this]() -> Result<SolveState> {
    lit_->restart(settings_);
    beginSolve();
    return state_;
  });
}

void SolveLoop::publishLightmaps(bool final) {
  bool wanted = false;
  {
    const std::scoped_lock lock(mutex_);
    std::erase_if(listeners_, [](const auto& listener) { return listener.expired(); });
    wanted = !listeners_.empty();
  }
  if (!lit_ || !wanted || (!unpublished_ && !final)) return;
  updateStatus(false);
  auto published = publisher_.publish(lit_->pages(), status(), final && state_ == SolveState::kConverged);
  {
    const std::scoped_lock lock(mutex_);
    lightmaps_ = published;
    status_.tile_version = published->tile_version;
  }
  unpublished_ = false;
  last_publish_ = Clock::now();
  tellListeners([&](Listener& listener) { listener.onLightmaps(published); });
}

void SolveLoop::updateStatus(bool announce) {
  Status status = lit_ ? reportStatus(*lit_, seconds_) : Status{};
  status.state = state_;
  status.revision = revision_;
  status.tile_version = publisher_.version();
  status.seconds = seconds_;
  status.settings = settings_;
  status.failure = failure_;
  status.gl_renderer = transport_->description();
  {
    const std::scoped_lock lock(mutex_);
    status_ = status;
  }
  if (!announce) return;
  last_progress_ = Clock::now();
  tellListeners([&](Listener& listener) { listener.onProgress(status); });
}

template <typename Call>
void SolveLoop::tellListeners(Call call) {
  std::vector<std::shared_ptr<Listener>> alive;
  {
    const std::scoped_lock lock(mutex_);
    for (const auto& listener : listeners_) {
      if (auto strong = listener.lock()) alive.push_back(std::move(strong));
    }
  }
  for (const auto& listener : alive) call(*listener);
}

Status SolveLoop::status() const {
  const std::scoped_lock lock(mutex_);
  return status_;
}

std::shared_ptr<const Lightmaps> SolveLoop::lightmaps() const {
  const std::scoped_lock lock(mutex_);
  return lightmaps_;
}

void SolveLoop::sceneText(Callback<SceneText> done) {
  askLit<SceneText>(std::move(done), [this]() -> Result<SceneText> {
    return SceneText{revision_, lit_->document().gltf.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
  });
}

void SolveLoop::sceneGlb(Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this]() -> Result<SharedBytes> {
    const auto lit = scene::withLightmapUvs(lit_->document(), lit_->scene(), lit_->patches());
    if (!lit) return tl::unexpected<Error>(lit.error());
    return std::make_shared<const Bytes>(scene::writeGlb(*lit));
  });
}

Result<SharedBytes> SolveLoop::makeUnlit() {
  // One exposure for all pages, from the radiance that the eye would see.
  std::vector<Image> display;
  for (const auto& page : lit_->pages()) display.push_back(page.irradiance);
  for (auto& image : display) {
    for (auto& pixel : image.pixels) pixel *= static_cast<float>(1.0 / 3.14159265358979);
  }
  Image all;
  for (const auto& image : display) all.pixels.insert(all.pixels.end(), image.pixels.begin(), image.pixels.end());
  const float exposure = autoExposure(all);
  for (auto& image : display) image = toneMap(image, exposure);
  auto bytes = scene::writeUnlitGlb(lit_->document(), lit_->scene(), lit_->patches(), display);
  if (!bytes) return tl::unexpected<Error>(bytes.error());
  return std::make_shared<const Bytes>(std::move(*bytes));
}

void SolveLoop::unlitGlb(Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this] { return makeUnlit(); });
}

Result<SharedBytes> SolveLoop::makeExr(std::uint32_t page) {
  const auto pages = lit_->pages();
  if (page >= pages.size()) {
    return fail(ErrorCode::kNotFound, "there is no lightmap page " + std::to_string(page) + " (there are " +
                                          std::to_string(pages.size()) + ")");
  }
  auto bytes = encodeExr(pages[page].irradiance);
  if (!bytes) return tl::unexpected<Error>(bytes.error());
  return std::make_shared<const Bytes>(std::move(*bytes));
}

void SolveLoop::lightmapExr(std::uint32_t page, Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this, page] { return makeExr(page); });
}

Result<SharedBytes> SolveLoop::renderSnapshot(const SnapshotRequest& request) {
  static const std::map<std::string, gpu::ViewQuantity> kQuantities = {{"lit", gpu::ViewQuantity::kLit},
                                                                       {"irradiance", gpu::ViewQuantity::kIrradiance},
                                                                       {"radiosity", gpu::ViewQuantity::kRadiosity},
                                                                       {"error", gpu::ViewQuantity::kError},
                                                                       {"patchId", gpu::ViewQuantity::kPatchId},
                                                                       {"mipLevel", gpu::ViewQuantity::kMipLevel},
                                                                       {"normal", gpu::ViewQuantity::kNormal}};
  const auto quantity = kQuantities.find(request.quantity);
  if (quantity == kQuantities.end())
    return fail(ErrorCode::kBadUsage, "no quantity \"" + request.quantity + "\"", "quantity");
  gpu::ViewRequest view;
  auto camera = chooseCamera(*lit_, request.camera, static_cast<double>(request.width) / request.height);
  if (!camera) return tl::unexpected<Error>(camera.error());
  view.camera = *camera;
  view.width = request.width;
  view.height = request.height;
  view.quantity = quantity->second;
  if (!view_) {
    auto made = gpu::makeViewRenderer();
    if (!made) return tl::unexpected<Error>(made.error());
    view_ = std::move(*made);
  }
  std::vector<Image> pages;
  if (quantity->second == gpu::ViewQuantity::kError) {
    for (auto& page : lit_->errorPages()) pages.push_back(std::move(page.irradiance));
  } else {
    for (auto& page : lit_->pages()) pages.push_back(std::move(page.irradiance));
  }
  const auto image = view_->render(lit_->scene(), lit_->patches(), pages, view);
  if (!image) return tl::unexpected<Error>(image.error());
  const bool photometric = quantity->second == gpu::ViewQuantity::kLit ||
                           quantity->second == gpu::ViewQuantity::kIrradiance ||
                           quantity->second == gpu::ViewQuantity::kRadiosity;
  auto png = encodePng(photometric ? toneMap(*image, autoExposure(*image)) : *image);
  if (!png) return tl::unexpected<Error>(png.error());
  return std::make_shared<const Bytes>(std::move(*png));
}

void SolveLoop::snapshot(SnapshotRequest request, Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this, request = std::move(request)] { return renderSnapshot(request); });
}

void SolveLoop::addListener(std::weak_ptr<Listener> listener) {
  {
    const std::scoped_lock lock(mutex_);
    listeners_.push_back(std::move(listener));
  }
  // A first listener finds what was solved while nobody looked.
  ask<bool>([](const Result<bool>&) {},
            [this]() -> Result<bool> {
              if (lit_ && (!lightmaps() || unpublished_)) {
                unpublished_ = true;
                publishLightmaps(state_ == SolveState::kConverged);
              }
              return true;
            });
}

}  // namespace

Result<std::unique_ptr<Engine>> makeEngine(EngineOptions options) {
  auto loop = std::make_unique<SolveLoop>(std::move(options));
  if (const auto started = loop->start(); !started) return tl::unexpected<Error>(started.error());
  return loop;
}

}  // namespace radiosity::engine
