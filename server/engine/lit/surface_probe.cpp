#include "server/engine/lit/surface_probe.h"

namespace radiosity::engine {
namespace {

/// Of the error that is asked for, what a measured one may be off by.
constexpr double kWantedPart = 0.12;

}  // namespace

void SurfaceProbe::begin(const solver::SolvedScene& solved, std::uint64_t seed,
                         std::span<const scene::LightmapPage> pages, double target) {
  auto measuring = std::make_unique<solver::SurfaceError>(solved, seed);
  std::vector<glm::vec3> found;
  for (const auto& at : measuring->lookups())
    found.push_back(scene::lookUp(solved.patches, pages, at.surface, at.side, at.texel));
  measuring->take(std::move(found));
  measuring->setWantedDeviation(kWantedPart * target);
  measuring_ = std::move(measuring);  // not before it is whole: memory may run out on the way
}

void SurfaceProbe::advance(double seconds, bool is_late) {
  if (is_late) measuring_->hurry();
  if (!measuring_->advance(seconds)) return;
  stated_ = measuring_->stated();
  measured_ = measuring_->measured();
  measuring_.reset();
}

}  // namespace radiosity::engine
