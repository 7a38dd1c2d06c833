#include "server/solver/surface/bright_leaves.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

/// So many times as bright as the mean is bright: as of the sky, whose bright parts are lamps.
constexpr double kBright = 8.0;
/// Weaker ones, together, rays may find by chance.
constexpr double kLeastPart = 0.02;

}  // namespace

std::optional<BrightLeaves> BrightLeaves::find(const scene::PatchScene& patches, const LeafRays& rays,
                                               std::span<const glm::vec3> radiosity, const SpecularLeaves* mirrors) {
  double area = 0.0, flux = 0.0, bright_flux = 0.0;
  const auto fluxOf = [&](std::uint32_t value) {
    return rays.areaOf(value) * static_cast<double>(channelSum(radiosity[value]));
  };
  for (std::uint32_t value = 0; value < radiosity.size(); ++value) {
    area += rays.areaOf(value);
    flux += fluxOf(value);
  }
  if (!(flux > 0.0)) return std::nullopt;
  BrightLeaves bright;
  for (std::uint32_t value = 0; value < radiosity.size(); ++value) {
    if (static_cast<double>(channelSum(radiosity[value])) * area <= kBright * flux || rays.areaOf(value) <= 0.0)
      continue;
    if (mirrors != nullptr && mirrors->has(value)) continue;  // which show other places
    // Places on these are drawn where rays pass, too.
    if (patches.surfaces[rays.sideOf(value).surface].see_through) continue;
    if (rays.isCut(value)) continue;  // of which spots are drawn, and rays find all that is left
    bright.values_.push_back(value);
    bright.up_to_.push_back(bright_flux += fluxOf(value));
  }
  if (!(bright_flux > kLeastPart * flux) || !std::isfinite(bright_flux)) return std::nullopt;
  bright.density_.resize(radiosity.size());
  for (const auto value : bright.values_)
    bright.density_[value] = static_cast<float>(static_cast<double>(channelSum(radiosity[value])) / bright_flux);
  for (auto& up_to : bright.up_to_) up_to /= bright_flux;
  return bright;
}

LeafRays::Place BrightLeaves::draw(const LeafRays& rays, double u, const glm::dvec2& at) const {
  const auto drawn = static_cast<std::size_t>(std::ranges::upper_bound(up_to_, u) - up_to_.begin());
  return rays.placeOn(values_[std::min(drawn, values_.size() - 1)], at);
}

double SampleCounts::weight(double cosine, double shading, double leaves, double distance, double density) const {
  const double by_rays = cosine / std::numbers::pi;
  const double by_looks = looks > 0 && leaves > 0.0 ? density * distance * distance / leaves : 0.0;
  return std::max(0.0, shading) / std::numbers::pi / (rays * by_rays + looks * by_looks);
}

}  // namespace radiosity::solver
