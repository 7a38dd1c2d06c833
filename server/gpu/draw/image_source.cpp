#include "server/gpu/draw/image_source.h"

#include <chrono>

namespace radiosity::gpu {

Result<std::unique_ptr<Renderers>> Renderers::create(std::optional<Drawing> drawing) {
  auto context = EglContext::create();
  if (!context) return tl::unexpected(context.error());
  auto hemicubes = HemicubeRenderer::create(**context, drawing);
  if (!hemicubes) return tl::unexpected(hemicubes.error());
  auto parallel = ParallelRenderer::create(**context, drawing);
  if (!parallel) return tl::unexpected(parallel.error());
  return std::unique_ptr<Renderers>(new Renderers{std::move(*context), std::move(*hemicubes), std::move(*parallel)});
}

Result<void> Renderers::setScene(std::shared_ptr<const scene::PatchScene> patches) {
  auto scene = GpuScene::upload(*context, std::move(patches));
  if (!scene) return tl::unexpected(scene.error());
  if (auto set = hemicubes.setScene(std::move(*scene)); !set) return set;
  if (auto set = parallel.setScene(hemicubes.scene()); !set) return set;
  return context->check();
}

void ImageSource::ask(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  if (desk_ != nullptr) {
    desk_->ask(work);
  } else {
    work();
  }
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::size_t ImageSource::hemicubeCapacity(std::uint32_t resolution) const {
  return renderers_->hemicubes.capacity(resolution);
}

std::size_t ImageSource::parallelCapacity(std::uint32_t resolution) const {
  return renderers_->parallel.capacity(resolution);
}

ParallelAxes ImageSource::axes(const solver::ParallelView& view, std::uint32_t resolution) const {
  return renderers_->parallel.axes(view, resolution);
}

std::span<const std::uint32_t> ImageSource::hemicubes(HemicubePass pass, std::uint32_t resolution,
                                                      std::span<const HemicubeView> views,
                                                      solver::TransportCounters& counters) {
  ask([&] { renderers_->hemicubes.render(pass, resolution, views, counters, pixels_); });
  return pixels_;
}

std::span<const std::uint32_t> ImageSource::parallel(std::uint32_t resolution,
                                                     std::span<const solver::ParallelView> views,
                                                     solver::TransportCounters& counters) {
  ask([&] { renderers_->parallel.render(renderers_->hemicubes.scene(), resolution, views, counters, pixels_); });
  return pixels_;
}

Result<void> ImageSource::preparePaper() {
  Result<void> done;
  ask([&] { done = renderers_->hemicubes.preparePaper(); });
  return done;
}

Result<void> ImageSource::check() {
  Result<void> done;
  ask([&] { done = renderers_->context->check(); });
  return done;
}

}  // namespace radiosity::gpu
