#include "server/solver/reflected/mirrored_lamps.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace radiosity::solver {

MirroredLamps::MirroredLamps(const std::vector<Side>& sides, const std::shared_ptr<const LeafRays>& rays,
                             std::uint64_t seed, std::size_t most_bytes)
    : images_(sides, rays, seed, most_bytes),
      sources_(sides, rays, seed, most_bytes),
      caustics_(rays, seed, most_bytes) {
  for (const auto& side : sides) leaf_count_ += side.leaf_count;
}

void MirroredLamps::begin(Lamps lamps, const LeafShading* shading) {
  images_.begin(std::move(lamps.images), shading);
  sources_.begin(std::move(lamps.sources), shading);
  caustics_.begin(std::move(lamps.caustics), shading, leaf_count_);
}

bool MirroredLamps::advance(double seconds) {
  const auto begin = std::chrono::steady_clock::now();
  const auto left = [&] {
    return seconds - std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  return images_.advance(left()) && sources_.advance(left()) && caustics_.advance(left());
}

bool MirroredLamps::isBehind() const { return images_.isBehind() || sources_.isBehind() || caustics_.isBehind(); }

std::uint64_t MirroredLamps::raysFor(const Lamps& lamps) const {
  return images_.looksFor(lamps.images) + sources_.looksFor(lamps.sources) +
         caustics_.raysFor(lamps.caustics, leaf_count_);
}

bool MirroredLamps::refine(double looks, double paths) {
  const bool more_images = images_.refine(looks), more_sources = sources_.refine(looks);
  return caustics_.refine(paths) || more_images || more_sources;
}

void MirroredLamps::addShadedTo(std::size_t half, std::vector<glm::vec3>& irradiance) const {
  images_.addShadedTo(half, irradiance);
  sources_.addShadedTo(half, irradiance);
  caustics_.addShadedTo(half, irradiance);
}

void MirroredLamps::setTimes(const Times& times) {
  images_.setTimes(times[0]);
  sources_.setTimes(times[1]);
  caustics_.setTimes(times[2]);
}

bool MirroredLamps::areTimes(const Times& times) {
  const auto within = [](std::uint32_t t, std::uint32_t most) { return t > 0 && t <= most; };
  return within(times[0], ImagedLight::kMostTimes) && within(times[1], ImagedLight::kMostTimes) &&
         within(times[2], CausticLight::kMostTimes);
}

}  // namespace radiosity::solver
