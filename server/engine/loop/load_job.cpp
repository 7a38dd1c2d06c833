#include "server/engine/loop/load_job.h"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/engine/lit/memory.h"
#include "server/scene/charts/build.h"

namespace radiosity::engine {
namespace {

/// Stated error from which on more shots make no visible difference on few texels.
constexpr double kFirstLightError = 0.03;
/// Parts of a load that are done after reading the document and after importing it, as measured on scenes of 20,000 to
/// 400,000 triangles.
constexpr double kRead = 0.05, kImported = 0.15;
/// And after its first light, where there is one.
constexpr double kFirstLight = 0.3;

}  // namespace

LoadJob::LoadJob(Request request, Options options, solver::Transport& transport, std::function<void()> wake,
                 std::unique_ptr<LoadJob> former)
    : request_(std::move(request)),
      options_(std::move(options)),
      transport_(transport),
      wake_(std::move(wake)),
      former_(std::move(former)),
      task_(std::make_shared<Task>(wake_)),
      when_gone_(request_.client.gone, [this] { cancel(); }) {
  if (former_) former_->task_->cancel();
  thread_ = std::thread([this] { run(); });
  (void)pthread_setname_np(thread_.native_handle(), "load");
}

void LoadJob::cancel() {
  task_->cancel();
  wake_();
}

LoadJob::~LoadJob() {
  task_->cancel();
  thread_.join();
}

LoadJob::Ready LoadJob::take() {
  const std::scoped_lock lock(mutex_);
  taken_.notify_one();
  return std::exchange(ready_, {});
}

void LoadJob::run() {
  former_.reset();
  make();
  request_.read = {};  // where it was called off before
  wake_();
}

void LoadJob::make() {
  std::optional<scene::Document> known;
  auto whole = unlessCancelled(*task_, [&]() -> Result<std::unique_ptr<LitScene>> {
    task_->beginStage(kRead);
    auto document = request_.read();
    request_.read = {};  // it holds the bytes
    if (!document) return tl::unexpected<Error>(document.error());
    if (request_.is_known && request_.is_known(*document)) {
      known = std::move(*document);
      return nullptr;
    }
    return makeWhole(std::move(*document));
  });
  if (task_->isCancelled()) return;  // nobody takes it, and it may be large
  const std::scoped_lock lock(mutex_);
  if (known && whole) {
    ready_.known = std::move(known);
  } else {
    ready_.whole = std::move(whole);
  }
}

Result<std::unique_ptr<LitScene>> LoadJob::makeWhole(scene::Document document) {
  beginStage(kImported);
  auto edited = scene::importEdited(std::move(document), nullptr, options_.limits);
  if (!edited) return tl::unexpected<Error>(edited.error());
  if (wantsFirstLight(edited->scene)) {
    beginStage(kFirstLight);
    showFirstLight(*edited);
  }
  beginStage(1.0);
  auto whole = LitScene::make(std::move(*edited), options_.settings, transport_);
  if (!whole) return whole;
  (*whole)->prepareSolve();  // all that the solve thread need not do
  (*whole)->prepareUpload();
  if (options_.keep_ahead) kept_ = options_.keep_ahead((*whole)->document());
  return whole;
}

bool LoadJob::wantsFirstLight(const scene::Scene& scene) const {
  if (options_.first_texels == 0) return false;
  scene::ChartOptions charts;
  charts.texel_budget = texelBudget(options_.settings);
  charts.texel_size_m = options_.settings.texel_size_m;
  const auto leaves = scene::expectedLeaves(scene, charts);
  return leaves > options_.first_light_above && leaves > options_.first_texels && leaves <= scene::kMaxLeaves;
}

/// Where it cannot be had all is made at once, or the reason is found why that cannot be either. All begins to be made
/// when the first light has been taken: it is of no use beside all.
void LoadJob::showFirstLight(const scene::EditedDocument& edited) {
  auto settings = options_.settings;
  settings.texels = options_.first_texels;
  settings.texel_size_m = 0.0;
  settings.target_error = std::max(kFirstLightError, settings.target_error);
  auto few = withinMemory([&] { return LitScene::make(edited, settings, transport_); });
  if (!few) return;
  std::unique_lock lock(mutex_);
  ready_.first_light = std::move(*few);
  wake_();
  constexpr auto kNap = std::chrono::milliseconds(20);
  while (!taken_.wait_for(lock, kNap, [this] { return ready_.first_light == nullptr; })) interruptionPoint();
}

}  // namespace radiosity::engine
