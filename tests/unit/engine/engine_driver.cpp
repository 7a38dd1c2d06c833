#include "tests/unit/engine/engine_driver.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>

#include "tests/scenes/glb_writer.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::test {
namespace {

std::chrono::seconds patience() {
  const char* factor = std::getenv("RADIOSITY_TEST_PATIENCE");
  return std::chrono::seconds(60) * std::max(1, factor != nullptr ? std::atoi(factor) : 1);
}

struct PreparedOf final : solver::Transport::Prepared {
  explicit PreparedOf(const scene::PatchScene* of) : patches(of) {}
  const scene::PatchScene* patches;
};

class ScriptedTransport final : public solver::Transport {
 public:
  explicit ScriptedTransport(std::shared_ptr<TransportScript> script) : script_(std::move(script)) {}

  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override {
    if (script_->uploads_until_failure > 0 && --script_->uploads_until_failure == 0)
      return fail(ErrorCode::kUnavailable, "out of memory on the device");
    if (script_->uploads_to_fail > 0 && script_->uploads_to_fail-- > 0)
      return fail(ErrorCode::kUnavailable, "out of memory on the device");
    if (script_->uploads_to_run_out > 0 && script_->uploads_to_run_out-- > 0) throw std::bad_alloc();
    ++script_->uploads;
    patches_ = patches;
    return rays_.setScene(std::move(patches));
  }
  Result<solver::TransportCounters> run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) override {
    if (script_->run_fails) return fail(ErrorCode::kUnavailable, "the device was lost");
    if (script_->runs_until_failure > 0 && --script_->runs_until_failure == 0)
      return fail(ErrorCode::kUnavailable, "the driver reset the card");
    if (script_->runs_out_of_memory) throw std::bad_alloc();
    std::this_thread::sleep_for(std::chrono::milliseconds(script_->pause_ms));
    if (script_->puts_off) return fail(ErrorCode::kCancelled, "put off");
    return rays_.run(batch, into);
  }
  [[nodiscard]] Result<std::unique_ptr<Prepared>> prepareScene(const scene::PatchScene& patches) const override {
    ++script_->prepared;
    if (std::this_thread::get_id() == maker_) ++script_->prepared_here;
    return std::make_unique<PreparedOf>(&patches);
  }
  Result<void> beginScene(std::shared_ptr<const scene::PatchScene> patches,
                          std::unique_ptr<Prepared> prepared) override {
    if (prepared) {
      EXPECT_EQ(static_cast<PreparedOf&>(*prepared).patches, patches.get());
    }
    return setScene(std::move(patches));
  }
  [[nodiscard]] bool hasTakenScene() override { return script_->takes_scenes; }
  [[nodiscard]] Losses losses() const override {
    return {static_cast<std::uint64_t>(script_->losses.load()), "worker 7 hangs"};
  }
  [[nodiscard]] Renderers look() override {
    const auto missing = static_cast<std::size_t>(script_->idle_missing.load());
    return {2, missing, missing > 0 ? "worker 8 was killed by signal 9" : ""};
  }
  [[nodiscard]] Result<void> replaceMissing() override {
    ++script_->replacements;
    if (script_->replacements_to_fail > 0 && script_->replacements_to_fail-- > 0)
      return fail(ErrorCode::kUnavailable, "no processes can be started");
    script_->losses += script_->idle_missing.exchange(0);
    return {};
  }
  [[nodiscard]] std::string description() const override { return "rays"; }

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches_; }

 private:
  std::shared_ptr<const scene::PatchScene> patches_;
  std::shared_ptr<TransportScript> script_;
  std::thread::id maker_ = std::this_thread::get_id();
  RayTransport rays_{16};
};

}  // namespace

const std::chrono::seconds EngineTest::kPatience = patience();

void Recorder::onProgress(const engine::Status& status) {
  const std::scoped_lock lock(mutex_);
  progress_.push_back(status);
}

void Recorder::onScenePatched(std::uint64_t revision, const std::string& patch, const std::string& by) {
  const std::scoped_lock lock(mutex_);
  patched_.push_back({revision, patch, by});
}

void Recorder::onSceneLoaded(std::uint64_t revision) {
  const std::scoped_lock lock(mutex_);
  loaded_.push_back(revision);
}

void Recorder::onLightmaps(const std::shared_ptr<const engine::Lightmaps>& lightmaps) {
  const std::scoped_lock lock(mutex_);
  lightmaps_.push_back(lightmaps);
}

std::vector<engine::Status> Recorder::progress() const {
  const std::scoped_lock lock(mutex_);
  return progress_;
}

std::vector<Recorder::Patched> Recorder::patched() const {
  const std::scoped_lock lock(mutex_);
  return patched_;
}

std::vector<std::uint64_t> Recorder::loaded() const {
  const std::scoped_lock lock(mutex_);
  return loaded_;
}

std::vector<std::shared_ptr<const engine::Lightmaps>> Recorder::lightmaps() const {
  const std::scoped_lock lock(mutex_);
  return lightmaps_;
}

void Recorder::onNotice(const engine::Notice& notice) {
  const std::scoped_lock lock(mutex_);
  notices_.push_back(notice);
}

std::vector<engine::Notice> Recorder::notices() const {
  const std::scoped_lock lock(mutex_);
  return notices_;
}

void Recorder::forget() {
  const std::scoped_lock lock(mutex_);
  notices_.clear();
  progress_.clear();
  patched_.clear();
  loaded_.clear();
  lightmaps_.clear();
}

engine::EngineOptions rayOptions(std::shared_ptr<TransportScript> script) {
  engine::EngineOptions options;
  options.settings.target_error = kEasy;
  options.settings.texels = 150;
  options.recovery_wait = std::chrono::milliseconds(2);
  options.solved_soon = {};  // what is shown between is looked at
  options.make_transport = [script = std::move(script)]() -> Result<std::unique_ptr<solver::Transport>> {
    return std::make_unique<ScriptedTransport>(script);
  };
  return options;
}

void EngineTest::startOn(const std::string& folder, engine::EngineOptions options) {
  auto store = state::Store::open(folder);
  ASSERT_TRUE(store) << store.error().text();
  options.store = std::move(*store);
  auto made = engine::makeEngine(std::move(options));
  ASSERT_TRUE(made) << made.error().text();
  engine_ = std::move(*made);
}

void EngineTest::SetUp() {
  auto made = engine::makeEngine(rayOptions(script_));
  ASSERT_TRUE(made) << made.error().text();
  engine_ = std::move(*made);
  engine_->addListener(recorder_);
  watching_ = engine_->watch(engine::Quantity::kIrradiance);
}

Result<engine::LoadOutcome> EngineTest::load(const test_scenes::TestScene& scene) {
  const auto bytes = std::make_shared<const Bytes>(test_scenes::encodeGlb(scene));
  return call<engine::LoadOutcome>(
      [&](auto done) { engine_->loadBytes(scene.name + ".glb", bytes, "ann", std::move(done)); });
}

Result<engine::PatchOutcome> EngineTest::patch(engine::PatchRequest request) {
  return call<engine::PatchOutcome>([&](auto done) { engine_->patch(std::move(request), std::move(done)); });
}

Result<engine::PatchOutcome> EngineTest::step(engine::StepRequest request) {
  return call<engine::PatchOutcome>([&](auto done) { engine_->step(std::move(request), std::move(done)); });
}

engine::HistoryReport EngineTest::history() {
  return call<engine::HistoryReport>([&](auto done) { engine_->history(std::move(done)); }).value();
}

Result<engine::SolveSettings> EngineTest::configure(const std::function<void(engine::SolveSettings&)>& change) {
  const auto changed = [&](engine::SolveSettings settings) {
    change(settings);
    return settings;
  };
  return call<engine::SolveSettings>([&](auto done) { engine_->configure(changed, std::move(done)); });
}

Result<engine::SolveState> EngineTest::pause() {
  return call<State>([&](auto done) { engine_->pause(std::move(done)); });
}

Result<engine::SolveState> EngineTest::resume() {
  return call<State>([&](auto done) { engine_->resume(std::move(done)); });
}

Result<engine::SolveState> EngineTest::restart() {
  return call<State>([&](auto done) { engine_->restart(std::move(done)); });
}

std::string EngineTest::sceneText() {
  const auto text = call<engine::Engine::SceneText>([&](auto done) { engine_->sceneText(std::move(done)); });
  return text ? text->gltf : text.error().text();
}

Bytes EngineTest::light() {
  Bytes all;
  for (std::uint32_t page = 0;; ++page) {
    const auto exr = call<SharedBytes>(
        [&](auto done) { engine_->lightmapExr(page, engine::Quantity::kIrradiance, {}, std::move(done)); });
    if (!exr) break;  // no such page
    all.insert(all.end(), (*exr)->begin(), (*exr)->end());
  }
  EXPECT_FALSE(all.empty());
  return all;
}

testing::AssertionResult EngineTest::reaches(State state) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (std::chrono::steady_clock::now() < deadline) {
    const auto now = status();
    if (now.state == state) {
      (void)sceneText();  // the final lightmaps are published after the state
      return testing::AssertionSuccess();
    }
    if (now.state != State::kSolving && now.state != State::kLoading && now.state != State::kEmpty) {
      return testing::AssertionFailure() << "state " << static_cast<int>(now.state) << ", error " << now.error.texels
                                         << " " << now.failure;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return testing::AssertionFailure() << "still in state " << static_cast<int>(status().state);
}

void EngineTest::solve(const test_scenes::TestScene& scene) {
  const auto loaded = load(scene);
  ASSERT_TRUE(loaded) << loaded.error().text();
  ASSERT_TRUE(reaches(State::kConverged));
}

std::string emissionPatch(int index, double nits) {
  const std::string material = "/materials/" + std::to_string(index);
  return R"([{"op":"replace","path":")" + material + R"(/emissiveFactor","value":[1,1,1]},)" +
         R"({"op":"add","path":")" + material + R"(/extensions","value":{"KHR_materials_emissive_strength":)" +
         R"({"emissiveStrength":)" + std::to_string(nits) + "}}}]";
}

double meanIrradiance(const engine::Lightmaps& lightmaps) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& page : lightmaps.pages) {
    for (const auto& texel : page->mips.front().pixels) sum += static_cast<double>(texel.x + texel.y + texel.z) / 3.0;
    count += page->mips.front().pixels.size();
  }
  return sum / static_cast<double>(std::max<std::size_t>(count, 1));
}

}  // namespace radiosity::test
