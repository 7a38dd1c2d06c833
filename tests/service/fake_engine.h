// An engine without a solver, for tests of the network: scenes are opaque, lightmaps are a pattern, progress is made
// when the test says so. Thread-safe; callbacks come on the calling thread, as an engine may do.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/engine/engine.h"

namespace radiosity::testing {

struct FakeLayout {
  int pages = 1, width = 160, height = 96, mips = 3;
};

class FakeEngine : public engine::Engine {
 public:
  using Layout = FakeLayout;
  explicit FakeEngine(Layout layout = {});

  // ---- what a test does to it ----
  /// All tiles change; the brightest texel is `brightest` lux. Returns the tile version. Whole numbers are idPattern().
  std::uint64_t publish(float brightest = 100.0F, engine::Quantity quantity = engine::Quantity::kIrradiance);
  /// Only this tile of mip 0 changes.
  std::uint64_t publishTile(std::uint32_t page, std::uint32_t tile);
  void changeLayout(Layout layout);
  void progress(double error, engine::SolveState state = engine::SolveState::kSolving);
  /// What is measured at the surface; nothing: it is under way. Told with the next progress().
  void surface(std::optional<double> total);
  /// Callbacks are kept until release().
  void holdAnswers();
  void release();
  void setSceneText(std::string gltf);
  /// What scene.glb is from now on.
  void setGlb(SharedBytes glb);
  [[nodiscard]] std::uint64_t patchesSeen() const;
  void notice(const engine::Notice& notice);
  void loseRenderer(bool lost);
  void loseIdle(std::uint64_t missing, std::uint64_t renderers, std::string why);
  void loseState(std::string why);
  std::atomic<double> busy_seconds{0.0};
  /// Once: `meanwhile` happens after status() was taken, and before whoever asked for it has it.
  void overtakeStatus(std::function<void()> meanwhile);
  /// Who has asked for loads, pictures and files, in order.
  [[nodiscard]] std::vector<engine::Client> clients() const;
  [[nodiscard]] bool calledOff() const { return called_off_; }
  [[nodiscard]] std::string lastLoad() const;  ///< "name: 123 bytes by WHO" or "file PATH by WHO"

  // ---- engine::Engine ----
  void loadBytes(std::string name, SharedBytes bytes, engine::Client client,
                 Callback<engine::LoadOutcome> done) override;
  void loadFile(std::string path, engine::Client client, Callback<engine::LoadOutcome> done) override;
  void patch(engine::PatchRequest request, Callback<engine::PatchOutcome> done) override;
  void step(engine::StepRequest request, Callback<engine::PatchOutcome> done) override;
  void history(Callback<engine::HistoryReport> done) override;
  void configure(ChangeSettings change, Callback<engine::SolveSettings> done) override;
  void pause(Callback<engine::SolveState> done) override;
  void resume(Callback<engine::SolveState> done) override;
  void restart(Callback<engine::SolveState> done) override;
  [[nodiscard]] engine::Status status() const override;
  [[nodiscard]] engine::SolveHistory solveHistory() const override;
  [[nodiscard]] double busySeconds() const override { return busy_seconds; }
  using engine::Engine::lightmaps;
  [[nodiscard]] std::shared_ptr<void> watch(engine::Quantity quantity) override;
  [[nodiscard]] std::shared_ptr<const engine::Lightmaps> lightmaps(engine::Quantity quantity) const override;
  void sceneText(Callback<SceneText> done) override;
  void sceneGlb(std::optional<std::uint64_t> layout, engine::Client client, Callback<SharedBytes> done) override;
  void unlitGlb(engine::Client client, Callback<SharedBytes> done) override;
  void lightmapExr(std::uint32_t page, engine::Quantity quantity, engine::Client client,
                   Callback<SharedBytes> done) override;
  void snapshot(engine::SnapshotRequest request, engine::Client client, Callback<engine::Snapshot> done) override;
  void texel(engine::TexelRequest request, Callback<engine::Texel> done) override;
  /// There is one, of light 2.
  void lightWeb(std::size_t light, engine::Client client, Callback<engine::ShownWeb> done) override;
  void measure(engine::MeasureRequest request, engine::Client client, Callback<engine::MeasureReport> done) override;
  void probes(engine::ProbeRequest request, engine::Client client, Callback<engine::ProbeReport> done) override;
  void callOff() override { called_off_ = true; }
  void addListener(std::weak_ptr<engine::Listener> listener) override;

  /// The value that publish() put at a texel: for tests to compare what arrives.
  [[nodiscard]] static glm::vec3 pattern(int x, int y, std::uint64_t version, float brightest);
  [[nodiscard]] static std::uint32_t idPattern(int x, int y, std::uint64_t version);
  /// Who watches a quantity now.
  [[nodiscard]] int watchers(engine::Quantity quantity) const {
    return (*watchers_)[static_cast<std::size_t>(quantity)];
  }

 private:
  void answer(std::function<void()> call);
  void setState(engine::SolveState state, Callback<engine::SolveState> done);
  void loaded(std::string what, const engine::Client& client, Callback<engine::LoadOutcome> done);
  void ask(const engine::Client& client);
  [[nodiscard]] std::vector<std::shared_ptr<engine::Listener>> listeners() const;
  [[nodiscard]] std::shared_ptr<engine::PageSnapshot> emptyPage(engine::Quantity quantity) const;
  void announceLightmaps(engine::Quantity quantity);

  mutable std::mutex mutex_;
  Layout layout_;
  engine::Status status_;
  std::array<std::shared_ptr<const engine::Lightmaps>, engine::kQuantityCount> lightmaps_;
  using Watchers = std::array<std::atomic<int>, engine::kQuantityCount>;
  std::shared_ptr<Watchers> watchers_ = std::make_shared<Watchers>();
  std::uint64_t layout_number_ = 1, patches_ = 0;
  std::vector<engine::Client> clients_;
  std::atomic<bool> called_off_{false};
  std::string last_load_, scene_text_ = R"({"asset":{"version":"2.0"}})";
  std::vector<std::weak_ptr<engine::Listener>> listeners_;
  SharedBytes glb_ = std::make_shared<const Bytes>(Bytes{'g', 'l', 'T', 'F', ' ', 's', 'c', 'e', 'n', 'e'});
  bool holding_ = false;
  mutable std::function<void()> meanwhile_;
  std::vector<std::function<void()>> held_;
};

}  // namespace radiosity::testing
