// Carries out shots in one OpenGL context: what the in-process transport and every worker process have inside. Where a
// card draws, many hands look at its images side by side: one would leave it idle most of the time. Where the processor
// draws, workers are processes with one hand each. The same bits for any number of hands. One thread, which owns the
// context.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/gpu/shot_runner.h"

namespace radiosity::gpu {

class ShotCrew {
 public:
  /// A context of this thread, and one hand.
  [[nodiscard]] static Result<std::unique_ptr<ShotCrew>> create();

  /// Takes effect with the next scene. At least 1.
  void setHands(std::size_t hands) { wanted_ = hands; }
  [[nodiscard]] Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches);
  /// As ShotRunner's; links come in the order of the shots, in this thread.
  [[nodiscard]] Result<solver::TransportCounters> run(const ShotSpan& shots, const FluxSink& sink);
  [[nodiscard]] Result<solver::TransportCounters> measure(const ShotSpan& shots,
                                                          const solver::Transport::TakeLinks& take);
  [[nodiscard]] const EglContext& context() const { return *renderers_->context; }

 private:
  struct Hand {
    explicit Hand(const ImageSource& images) : runner(images) {}
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

  std::unique_ptr<Renderers> renderers_;
  RenderDesk desk_;
  std::vector<std::unique_ptr<Hand>> hands_;
  std::size_t wanted_ = 1;
};

}  // namespace radiosity::gpu
