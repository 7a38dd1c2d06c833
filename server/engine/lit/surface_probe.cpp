#include "server/engine/lit/surface_probe.h"

namespace radiosity::engine {

void SurfaceProbe::begin(const solver::SolvedScene& solved, std::uint64_t seed,
                         std::span<const scene::LightmapPage> pages) {
  measuring_ = std::make_unique<solver::SurfaceError>(solver::PlaceLight(solved), seed);
  std::vector<glm::vec3> found;
  for (const auto& at : measuring_->lookups())
    found.push_back(scene::lookUp(solved.patches, pages, at.surface, at.side, at.texel));
  measuring_->take(std::move(found));
}

void SurfaceProbe::advance(double seconds) {
  if (!measuring_->advance(seconds)) return;
  stated_ = measuring_->stated();
  measured_ = measuring_->measured();
  measuring_.reset();
}

}  // namespace radiosity::engine
