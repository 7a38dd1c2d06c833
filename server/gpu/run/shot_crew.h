// Carries out shots in one OpenGL context: what the in-process transport and every worker process have inside. Where a
// card draws, many hands look at its images side by side: one would leave it idle most of the time. Where the processor
// draws, workers are processes with one hand each. The same bits for any number of hands. One thread, which owns the
// context.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "server/gpu/run/shot_runner.h"

namespace radiosity::gpu {

class ShotCrew {
 public:
  /// A context of this thread, and one hand. `drawing`: what suits the context, but for tests.
  [[nodiscard]] static Result<std::unique_ptr<ShotCrew>> create(std::optional<Drawing> drawing = std::nullopt);

  /// From the next scene on, at least 1; fewer in scenes so large that so many would take more than 1 GiB.
  void setHands(std::size_t hands) { wanted_ = hands; }
  [[nodiscard]] std::size_t hands() const { return hands_.size(); }
  /// From the next scene on; kAuto at first.
  void setSight(Sight sight) { sight_ = sight; }
  /// What is decided on, where kAuto was asked for.
  [[nodiscard]] Sight sight() const { return sightFor(sight_, context().software()); }
  /// After an error there is no scene.
  [[nodiscard]] Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches);
  /// As ShotRunner's. What a hand, or `take`, throws is thrown here, when all hands have stopped.
  [[nodiscard]] Result<solver::TransportCounters> run(const ShotSpan& shots, const FluxSink& sink);
  [[nodiscard]] Result<solver::TransportCounters> measure(const ShotSpan& shots,
                                                          const solver::Transport::TakeLinks& take);
  /// As ShotRunner's, of one hand: many take other shots each time.
  [[nodiscard]] bool keepsPlace() const { return hands_.size() == 1 && hands_.front()->runner.keepsPlace(); }
  [[nodiscard]] const EglContext& context() const { return *renderers_->context; }

 private:
  struct Hand {
    Hand(const ImageSource& images, WeightCache& weights) : runner(images, weights) {}
    ShotRunner runner;
    FluxStore store;
  };
  /// Consecutive shots of one kind, and the number of the first among all that are measured.
  struct Part {
    ShotSpan shots;
    std::size_t first = 0;
  };
  using Work = std::function<Result<solver::TransportCounters>(Hand&, const Part&)>;

  explicit ShotCrew(std::unique_ptr<Renderers> renderers) : renderers_(std::move(renderers)) {}
  [[nodiscard]] std::vector<Part> partsOf(const ShotSpan& shots) const;
  [[nodiscard]] Result<solver::TransportCounters> share(const std::vector<Part>& parts, const Work& work);
  void clearStores();

  std::unique_ptr<Renderers> renderers_;
  WeightCache weights_;
  RenderDesk desk_;
  std::vector<std::unique_ptr<Hand>> hands_;  ///< none: there is no scene
  std::size_t wanted_ = 1;
  Sight sight_ = Sight::kAuto;
};

}  // namespace radiosity::gpu
