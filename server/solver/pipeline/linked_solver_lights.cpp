// LinkedSolver: its lights. They come, change and go by edits; those switched off keep their links.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// So many lights that were moved away or switched off keep their links.
constexpr std::ptrdiff_t kDarkSources = 8;
/// So many times that of a node are the images of a light without extent (a sky has most).
constexpr double kSourceCost = 60.0;

}  // namespace

/// Every light polygon that ever was is a shooter; its radiosity is what it emits now.
void LinkedSolver::takeLights() {
  for (auto& light : lights_) light.emission = glm::vec3(0.0F);
  const auto [lights, crowds] = divideLights(findLightPolygons(*patches_, sides_, system_.emission()),
                                             fewLights(system_.leafAreas().size(), settings_.link_memory), crowds_);
  for (const auto& light : lights) {
    const auto known = std::ranges::find(lights_, light.key, &LightPolygon::key);
    if (known != lights_.end()) {
      known->emission = light.emission;
      continue;
    }
    Shooter shooter;
    shooter.light = static_cast<std::uint32_t>(lights_.size());
    shooter.area = light.area;
    shooter.most_bytes = memory_.mostBytes(light);
    lights_.push_back(light);
    (void)system_.add(shooter);
  }
  takeCrowds(crowds);
  for (auto& shooter : system_.shooters()) {
    if (shooter.light != scene::kNone) shooter.sent.fill(lights_[shooter.light].emission);
    if (shooter.crowd != scene::kNone) shooter.sent.fill(crowds_[shooter.crowd].emission);
  }
}

/// Those that were there before keep their links, whatever their emission is now.
void LinkedSolver::takeCrowds(const std::vector<Crowd>& crowds) {
  for (auto& crowd : crowds_) crowd.emission = glm::vec3(0.0F);
  for (const auto& crowd : crowds) {
    const auto known =
        std::ranges::find_if(crowds_, [&](const Crowd& old) { return old.key == crowd.key && old.isDark(); });
    if (known == crowds_.end()) {
      addCrowd(crowd);
    } else {
      *known = crowd;
    }
  }
}

/// In the place of one that is dark, once there are some.
void LinkedSolver::addCrowd(const Crowd& crowd) {
  auto& shooters = system_.shooters();
  if (std::ranges::count_if(crowds_, &Crowd::isDark) >= kDarkSources) {
    const auto old = std::ranges::find_if(crowds_, &Crowd::isDark);
    const auto index = static_cast<std::uint32_t>(old - crowds_.begin());
    const auto shooter = std::ranges::find(shooters, index, &Shooter::crowd);
    const auto number = static_cast<std::uint32_t>(shooter - shooters.begin());
    system_.forget(number);
    std::erase(tinted_, number);
    shooter->area = crowd.area;
    *old = crowd;
    return;
  }
  Shooter shooter;
  shooter.crowd = static_cast<std::uint32_t>(crowds_.size());
  shooter.area = crowd.area;
  shooter.most_bytes = memory_.mostBytes();
  shooter.sample_cost = CrowdSample::cost(system_.leafAreas().size()) / shotCost();
  crowds_.push_back(crowd);
  (void)system_.add(shooter);
}

std::size_t LinkedSolver::lightBytes() const {
  std::size_t bytes = 0;
  for (const auto& shooter : system_.shooters()) bytes += shooter.isLight() ? 2 * shooter.most_bytes : 0;
  return bytes;
}

/// So is every light without extent, but for a sky that rays see.
void LinkedSolver::takeSources(const LightSources& sources) {
  for (auto& source : sources_) source.intensity = glm::dvec3(0.0);
  sky_.clear();
  for (const auto& source : punctual_.makeSources(*patches_, sources)) {
    if (source.kind == PunctualLights::Source::Kind::kSky) {
      sky_.push_back(source);
      continue;
    }
    const auto known =
        std::find_if(sources_.begin(), sources_.end(), [&](const auto& old) { return old.sameShape(source); });
    if (known != sources_.end()) {
      known->intensity = source.intensity;
      continue;
    }
    addSource(source);
  }
  for (auto& shooter : system_.shooters()) {
    if (shooter.source != scene::kNone) shooter.sent.fill(glm::vec3(sources_[shooter.source].intensity));
  }
  findImages();
}

/// What enters the scene's box from it, whether it meets anything or not.
std::array<double, 3> LinkedSolver::skyFlux() const {
  std::array<double, 3> flux{};
  for (const auto& source : sky_) {
    for (std::size_t c = 0; c < 3; ++c) flux[c] += source.flux_per_intensity * source.intensity[static_cast<int>(c)];
  }
  return flux;
}

/// In the place of one that is dark, once there are some: a lamp that is dragged about leaves no trail.
void LinkedSolver::addSource(const PunctualLights::Source& source) {
  const auto dark = [&](const PunctualLights::Source& s) { return s.intensity == glm::dvec3(0.0); };
  if (std::count_if(sources_.begin(), sources_.end(), dark) >= kDarkSources) {
    const auto old = std::find_if(sources_.begin(), sources_.end(), dark);
    for (std::uint32_t n = 0; n < system_.shooters().size(); ++n) {
      auto& shooter = system_.shooters()[n];
      if (shooter.source != static_cast<std::uint32_t>(old - sources_.begin())) continue;
      system_.forget(n);
      std::erase(tinted_, n);
      shooter.area = source.flux_per_intensity;
    }
    *old = source;
    return;
  }
  Shooter shooter;
  shooter.source = static_cast<std::uint32_t>(sources_.size());
  shooter.area = source.flux_per_intensity;
  shooter.sample_cost = kSourceCost;
  shooter.most_bytes = memory_.mostBytes();
  sources_.push_back(source);
  (void)system_.add(shooter);
}

/// Whether a light has links of whose colour nothing is known: it came, or the solver was restored, since light was
/// last solved for.
bool LinkedSolver::lacksTint() const {
  if (!tints_.isNeeded()) return false;
  const auto& shooters = system_.shooters();
  for (std::uint32_t n = 0; n < shooters.size(); ++n)
    if (shooters[n].isLight() && shooters[n].power() > 0.0 && !std::ranges::binary_search(tinted_, n)) return true;
  return false;
}

/// Unknown while links of a light are still to be measured, or measured again, or coloured.
std::vector<glm::vec3> LinkedSolver::directIrradiance() const {
  const auto& shooters = system_.shooters();
  if (!repair_.knowsLights()) return {};
  if (std::ranges::any_of(shooters, [](const Shooter& shooter) { return shooter.owes(); })) return {};
  if (lacksTint()) return {};
  std::array<std::vector<glm::vec3>, 2> halves;
  inBothHalves([&](std::size_t half) { system_.irradiance(half, halves[half], LinkSystem::From::kLights); });
  DirectSmoothing smoothing;
  const auto factors = smoothDirect(smoothing, halves);
  std::vector<glm::vec3> irradiance(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto v = side.first_value + leaf;
      irradiance[side.first_node + leaf] = 0.5F * (halves[0][v] + halves[1][v]);
    }
  }
  shaded_.addDirectTo(shootersAndLights(), factors, irradiance);
  return irradiance;
}

/// Nobody can do without light: where there is no room for its links, the weakest shooters lose theirs.
std::vector<Measurement> LinkedSolver::planLights() {
  auto wanted = planner_.firstLight(system_);
  lights_fit_ = true;
  std::array<std::uint32_t, 2> last{scene::kNone, scene::kNone};  // by half; all samples of a light come together
  std::array<bool, 2> fits{};
  std::erase_if(wanted, [&](const Measurement& want) {
    if (last[want.half] != want.shooter) {
      last[want.half] = want.shooter;
      const auto take = [&] { return memory_.takeSample(system_.shooters()[want.shooter], want.half); };
      while (!(fits[want.half] = take()) && forgetWeakest()) continue;
    }
    lights_fit_ = lights_fit_ && fits[want.half];
    return !fits[want.half];
  });
  return wanted;
}

/// Rays bring its light from then on. False: none has links.
bool LinkedSolver::forgetWeakest() {
  std::uint32_t weakest = scene::kNone;
  const auto& shooters = system_.shooters();
  for (std::uint32_t n = 0; n < shooters.size(); ++n) {
    if (shooters[n].isLight() || shooters[n].column[0].bytes() + shooters[n].column[1].bytes() == 0) continue;
    if (weakest == scene::kNone || shooters[n].power() < shooters[weakest].power()) weakest = n;
  }
  if (weakest == scene::kNone) return false;
  memory_.giveBack(shooters[weakest].column[0].bytes() + shooters[weakest].column[1].bytes());
  system_.forget(weakest);
  return true;
}

}  // namespace radiosity::solver
