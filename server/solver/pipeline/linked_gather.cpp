// LinkedSolver where rays bring reflected light: whether they do, which of rays and samples of links comes next.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>
#include <utility>

#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

// What things take, in microseconds of one core, as measured in rooms of 38 to 57,000 triangles; only their ratios
// count. An image and what is gathered from it: by leaf, and by the root of the triangles, since most are left out. A
// ray: by level of the tree.
constexpr double kShotLeaf = 0.02, kShotTriangle = 13.0, kRayLevel = 0.05;
/// A solve begins with more than half as many rays: of fewer leaves smoothing has few to average over, and their noise
/// would be that of all light. They take no time worth the name.
constexpr std::size_t kFewestRays = 65'536;
/// An image of a lamp, beside one of a node.
constexpr double kLightShot = 2.0;
/// What shines so many times as bright as all does in the mean is worth links: rays find what is small too seldom. With
/// 4 a room of 402 polygons takes a fifth more time to 2 %, with 16 it is as good, and the Cornell box worse. Where
/// most of a scene is dark, so many times as bright as what lies in the middle of all reflected light: in one room the
/// former is 3.3 times that, and a lit living room in a dark shell takes half the time.
constexpr double kBright = 8.0, kBrightBesideUsual = 3.3;
/// The equation on leaves is solved to so much of the asked error, within these bounds: far below any sampling error,
/// and the level of light is right anyway. Rounding leaves 3e-8 over what is not reflected.
constexpr double kResidual = 0.05, kLeastResidual = 1e-4, kMostResidual = 1e-3;
/// A side has light over links that is worth the name: of the mean of all.
constexpr double kLit = 0.5;
/// A round ends where it is likely to bring the error to this part of the target: what it goes by is uncertain.
constexpr double kAim = 0.9;
/// And of its square this is left for rays and samples, whatever else there is.
constexpr double kLeastRoom = 0.1;
/// Noise beside the light where it is, of the error aimed at: in a picture of 2 % as much shows as blotches, in dark
/// corners where all light is known well enough. Less than kUnseen never does.
constexpr double kBlotches = 3.0, kUnseen = 0.03;
/// A round for nothing else is worth it where there is so many times as much.
constexpr double kAlone = 1.5;
/// A round of samples alone that leaves more than this of the error was in vain.
constexpr double kSampleGain = 0.97;
/// The part of the room that either of rays and samples gets is found to one in so many.
constexpr int kParts = 32;
/// Where flat mirrors are all but this part of what lamps light of all that reflects, images of lamps in these tell
/// nearly all, and with less noise than paths from lamps. Where there is glass they tell nearly all as well: behind two
/// sides of a bulb of coloured glass paths were off by some hundredths of the light, for a reason that is not known
/// yet.
constexpr double kImagesTellAll = 0.02;
/// Of the room, what the noise of lamps in mirrors may take, and that of colours of lamps: that of images and colours
/// falls faster than that of rays, and that of paths as fast.
constexpr double kImages = 0.2;

}  // namespace

double LinkedSolver::shotCost() const {
  return kShotLeaf * static_cast<double>(system_.leafAreas().size()) +
         kShotTriangle * std::sqrt(static_cast<double>(patches_->triangles.size()));
}

double LinkedSolver::rayCost() const {
  return kRayLevel * std::log2(2.0 + static_cast<double>(patches_->triangles.size()));
}

bool LinkedSolver::mayGather(const scene::PatchScene& patches, const SolverSettings& settings) {
  std::size_t leaves = 0;
  for (const auto& side : makeSides(patches)) leaves += side.leaf_count;
  return LeafGather::leastBytes(leaves) <= settings.link_memory / 2;
}

/// Half of the light that is reflected comes from what is no brighter than this, about; all channels. In a building
/// whose rooms are lit and whose outside is dark that is far more than the mean.
double LinkedSolver::usualRadiosity() const {
  // 32 steps an octave, by the first bits of a float, from 2^-64 to 2^64.
  constexpr std::uint32_t kBits = 18, kFirst = (127 - 64) << 5U, kSteps = 128 << 5U;
  std::vector<double> flux(kSteps);
  double all = 0.0;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    // What lets light through is like a lamp: the inside of a paper shade is brighter than all else.
    if (sides_[s].gathered || sideShines(s) || system_.letsThrough(sides_[s])) continue;
    for (auto node = sides_[s].first_node; node < sides_[s].first_node + sides_[s].leaf_count; ++node) {
      const auto area = static_cast<double>(patches_->node_area[node]),
                 of_leaf = static_cast<double>(unshot_.rough(node));
      if (area <= 0.0 || of_leaf <= 0.0) continue;
      const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(of_leaf / area)) >> kBits;
      flux[std::clamp(bits, kFirst, kFirst + kSteps - 1) - kFirst] += of_leaf;
      all += of_leaf;
    }
  }
  std::uint32_t step = 0;
  for (double below = flux[0]; below < 0.5 * all && step + 1 < flux.size(); below += flux[step]) ++step;
  const auto middle = std::bit_cast<float>(((step + kFirst) << kBits) + (1U << (kBits - 1)));
  return all > 0.0 ? static_cast<double>(middle) : 0.0;
}

/// By side: of nodes that are worth links, all channels. Where there is something to see through only lamps are: links
/// between sheets that all but touch are too uncertain.
std::vector<double> LinkedSolver::leastRadiosity() const {
  double area = 0.0, flux = 0.0;
  for (const auto& side : sides_) {
    const auto root = side.first_node + side.node_count - 1;
    area += static_cast<double>(patches_->node_area[root]);
    flux += static_cast<double>(unshot_.rough(root));
  }
  const double least = area > 0.0 ? std::max(kBright * flux / area, kBrightBesideUsual * usualRadiosity()) : 0.0;
  std::vector<double> of_side(sides_.size(), least);
  for (std::uint32_t s = 0; s < sides_.size() && !patches_->opacity.empty(); ++s) {
    const bool is_lamp = sideShines(s) || system_.letsThrough(sides_[s]);
    if (patches_->surfaces[sides_[s].surface].see_through || !is_lamp) of_side[s] = HUGE_VAL;
  }
  return of_side;
}

/// By itself, and not as a polygon.
bool LinkedSolver::sideShines(std::uint32_t s) const {
  const auto emission = system_.emission().side(s);
  if (sides_[s].gathered) return false;
  for (std::uint32_t leaf = 0; leaf < (emission.isUniform() ? 1 : sides_[s].leaf_count); ++leaf)
    if (emission[leaf] != glm::vec3(0.0F)) return true;
  return false;
}

/// By side: whether much of its light comes over links. What rays bring is not known yet; it is not far from the mean
/// of all light in most rooms.
std::vector<bool> LinkedSolver::lightOverLinks() const {
  std::vector<double> light(sides_.size(), 0.0), area(sides_.size(), 0.0);
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    for (std::uint32_t leaf = 0; leaf < sides_[s].leaf_count; ++leaf) {
      const auto value = sides_[s].first_value + leaf;
      const double of_leaf = static_cast<double>(patches_->node_area[sides_[s].first_node + leaf]);
      light[s] += of_leaf * static_cast<double>(channelSum(half_[0][value] + half_[1][value]));
      area[s] += of_leaf;
    }
  }
  const double flux = std::reduce(light.begin(), light.end()), all = std::reduce(area.begin(), area.end());
  std::vector<bool> has_light;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) has_light.push_back(light[s] * all > kLit * flux * area[s]);
  return has_light;
}

std::shared_ptr<const LeafRays> LinkedSolver::leafRays() {
  if (!leaf_rays_) leaf_rays_ = std::make_shared<const LeafRays>(*patches_, sides_);
  return leaf_rays_;
}

void LinkedSolver::startRays() {
  gather_ = std::make_unique<LeafGather>(*patches_, sides_, settings_.seed, settings_.link_memory / 2, leafRays(),
                                         system_.leafAreas());
  gather_->shadeFor(&shaded_.shading());
  gather_->reflectBy(mirrors_);
  findImages();
}

/// Of lamps that shine. Those of a crowd are too many.
void LinkedSolver::findImages() {
  in_mirrors_ = {};
  if (!gather_ || !mirrors_) return;
  std::vector<LightPolygon> lamps;
  std::vector<PunctualLights::Source> sources;
  const auto& areas = system_.leafAreas();
  least_imaged_ = LampImages::leastEmission(lights_, std::reduce(areas.begin(), areas.end(), 0.0));
  std::ranges::copy_if(lights_, std::back_inserter(lamps),
                       [&](const LightPolygon& lamp) { return channelSum(lamp.emission) > least_imaged_; });
  std::ranges::copy_if(sources_, std::back_inserter(sources),
                       [](const PunctualLights::Source& source) { return source.intensity != glm::dvec3(0.0); });
  const bool is_crowded = std::ranges::any_of(crowds_, [](const Crowd& crowd) { return !crowd.isDark(); });
  const auto find = [&](std::span<const LightPolygon> of_lamps, std::span<const PunctualLights::Source> of_sources) {
    if (gather_->mirroredLamps().hasNoRoomForImages()) return ImagedLight::Lamps{};
    return ImagedLight::Lamps{LampImages::find(*patches_, sides_, leaf_rays_, mirrors_, of_lamps, of_sources),
                              LampImages::lightOf(of_lamps, of_sources)};
  };
  if (!is_crowded) {
    const auto& known = gather_->mirroredLamps();
    in_mirrors_.images = find(lamps, {});
    const bool may_follow = !known.hasNoRoomForCaustics() && !mirrors_->hasGlass();
    auto paths = !may_follow ? nullptr : CausticPaths::find(sides_, leaf_rays_, mirrors_, lamps);
    if (paths && paths->partOutside(in_mirrors_.images.images.get()) > kImagesTellAll) {
      in_mirrors_.images = {};
      in_mirrors_.caustics = {std::move(paths), LampImages::lightOf(lamps, {})};
    }
  }
  in_mirrors_.sources = find({}, sources);
}

std::vector<glm::vec3> LinkedSolver::ofLeaves(const scene::SideColours& colours) const {
  std::vector<glm::vec3> values;
  values.reserve(system_.leafAreas().size());
  for (const auto& side : sides_) {
    const auto of_side = colours.side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) values.push_back(of_side[leaf]);
  }
  return values;
}

/// Emission of what is no light polygon.
std::vector<glm::vec3> LinkedSolver::shiningOfLeaves() const {
  auto emission = ofLeaves(system_.emission());
  for (const auto& side : sides_) {
    if (side.gathered) std::fill_n(emission.begin() + side.first_value, side.leaf_count, glm::vec3(0.0F));
  }
  return emission;
}

/// Emission of what is.
std::vector<glm::vec3> LinkedSolver::lampsOfLeaves() const {
  auto emission = ofLeaves(system_.emission());
  for (const auto& side : sides_) {
    if (!side.gathered) std::fill_n(emission.begin() + side.first_value, side.leaf_count, glm::vec3(0.0F));
  }
  return emission;
}

/// Of these, of the lamps that are looked for in mirrors.
std::vector<glm::vec3> LinkedSolver::imagedLamps() const {
  if (!in_mirrors_.images.images && !in_mirrors_.caustics.paths) return {};
  auto emission = lampsOfLeaves();
  for (auto& lamp : emission)
    if (channelSum(lamp) <= least_imaged_) lamp = glm::vec3(0.0F);
  return emission;
}

LeftLight LinkedSolver::leftLight() const {
  LeftLight light;
  light.residual = std::clamp(kResidual * settings_.target_error, kLeastResidual, kMostResidual);
  light.emission = shiningOfLeaves();
  light.reflectance = ofLeaves(system_.reflectance());
  light.mirrors = mirrors_;
  if (mirrors_) light.lamps = lampsOfLeaves();
  light.imaged_lamps = imagedLamps();
  light.in_mirrors = in_mirrors_;
  const auto spread = spreadLight();
  for (std::size_t value = 0; value < spread.size(); ++value) light.emission[value] += spread[value];
  light.passing.assign(system_.passing().begin(), system_.passing().end());
  light.irradiance = over_links_;
  SkyLight sky(sky_);
  light.sky = sky.hemispheres;
  light.sky_cells = std::move(sky.cells);
  for (auto& shot : light.shot) shot.assign(light.emission.size(), glm::vec3(0.0F));
  for (const auto& shooter : system_.shooters()) {
    if (shooter.isLight()) continue;
    const Side& side = sides_[shooter.place.side];
    const auto rect = leafRect(side, shooter.place);
    for (std::size_t half = 0; half < 2; ++half) {
      const glm::vec3 sent = static_cast<float>(shooter.carried(half)) * shooter.sent[half];
      for (auto y = rect.y0; y < rect.y1; ++y) {
        for (auto x = rect.x0; x < rect.x1; ++x) light.shot[half][side.first_value + y * side.width + x] += sent;
      }
    }
  }
  return light;
}

void LinkedSolver::inheritRays(const LinkedSolver& former, std::span<const std::uint32_t> value_before) {
  startRays();
  gather_->inherit(*former.gather_, value_before, *repair_.shadows().now);
  gather_->start();
}

/// What samples of links took so far.
double LinkedSolver::samplesCost() const {
  const auto& planner = settings_.planner;
  const double coarse = 1.0 * planner.coarse_light_samples * kLightPoints, fine = planner.lightCost(~0U);
  double points = 0.0;
  for (const auto& shooter : system_.shooters()) {
    for (const auto& column : shooter.column) {
      if (shooter.crowd != scene::kNone) {
        points += shooter.sample_cost * column.points();
        continue;
      }
      const double first = shooter.isLight() ? std::min(column.points(), coarse) : column.points();
      points += (shooter.isLight() ? kLightShot : 1.0) * (first + fine * (column.points() - first));
    }
  }
  return points * shotCost();
}

/// What smoothing takes of light grows with the noise that there is to take, whosever that is.
LinkedSolver::Noise LinkedSolver::noise() const {
  const double norm = fieldNorm(), square = norm * norm, all = by_links_ * by_links_;
  if (!gather_ || square <= 0.0) return {0.0, all};
  const double rays = gather_->rayNoise() / square, smoothed = gather_->smoothedSquare() / square;
  const double links = std::max(0.0, all - smoothed - rays - (gather_->imageNoise() + tint_noise_) / square);
  const double share = rays + links > 0.0 ? smoothed / (rays + links) : 0.0;
  return {rays * (1.0 + share), links * (1.0 + share)};
}

/// The error of all light may be reached while what is dark has far more of its own than others have of theirs.
double LinkedSolver::blotch() const { return std::max(kBlotches * aim_, kUnseen); }

bool LinkedSolver::refineBlotches() {
  if (!gathers() || !hasRounds() || !gather_->refine(HUGE_VAL, {kAlone * blotch(), blotch()})) return false;
  phase_ = Phase::kImprove;
  sample_goal_ = 0.0;
  return true;
}

/// More rays, more samples of links, or both, so that the target is reached at the least cost.
StepOutcome LinkedSolver::chooseRays() {
  if (!hasRounds()) return exhausted(SolveLimit::kRounds);
  phase_ = Phase::kImprove;
  sample_goal_ = 0.0;
  if (!gathers()) {
    startRays();
    gather_->start(lightOverLinks(), kFewestRays);
    return StepOutcome::kRoundDone;
  }
  const double aim = kAim * targetOfLinks(), rest = error_.residual;
  const double room = std::max(aim * aim - rest * rest, kLeastRoom * aim * aim);
  // What is in doubt is no reason for the rest to be mottled.
  if (by_links_ * by_links_ <= room) return refineBlotches() ? StepOutcome::kRoundDone : exhausted(SolveLimit::kWithin);
  const double norm = fieldNorm(), square = std::max(norm * norm, 1e-300);
  const double of_images = gather_->imageNoise() / square, of_tints = tint_noise_ / square;
  if (gather_->refineImages(kImages * room * square)) return StepOutcome::kRoundDone;
  if (of_tints > kImages * room && tints_.refine(of_tints / (kImages * room))) return StepOutcome::kRoundDone;
  // What is left of that is not theirs to lower.
  const double room_beside = std::max(room - of_images - of_tints, kLeastRoom * room);
  auto [rays, links] = noise();
  const double rays_cost = static_cast<double>(gather_->rays()) * rayCost(), links_cost = samplesCost();
  // Samples alone lowered nothing: what halves of the rays differ by after some bounces was taken for the links'.
  const bool in_vain = rays > 0.0 && sampled_alone_ > 0.0 && by_links_ > kSampleGain * sampled_alone_;
  if (links_cost <= 0.0 || in_vain) rays += std::exchange(links, 0.0);  // under a sky there may be none
  double best = HUGE_VAL, part = 0.0;
  for (int i = 1; i < kParts; ++i) {
    const double for_rays = room_beside * i / kParts, for_links = room_beside - for_rays;
    // The square of the error of samples falls as their number.
    const double cost = rays_cost * LeafGather::timesFor(for_rays / std::max(rays, 1e-300)) +
                        links_cost * std::max(1.0, links / for_links);
    if (cost < best) best = cost, part = static_cast<double>(i) / kParts;
  }
  const double goal_of_rays = part * room_beside / std::max(rays, 1e-300) * gather_->rayNoise();
  const bool refined = rays > part * room_beside && gather_->refine(goal_of_rays, {blotch(), blotch()});
  const auto end = gather_->lacksMemory() ? SolveLimit::kLinkMemory : SolveLimit::kRays;
  if (!refined && rays > part * room_beside) {  // no more to be had: links get what they leave, or as good as they are
    const double goal = std::max(room_beside - rays, rays);
    if (links <= goal) return exhausted(end);
    sampled_alone_ = by_links_;
    sample_goal_ = std::sqrt(goal);
    return StepOutcome::kRoundDone;
  }
  if (links > (1.0 - part) * room_beside) sample_goal_ = std::sqrt((1.0 - part) * room_beside);
  if (!refined && sample_goal_ <= 0.0) return exhausted(end);
  sampled_alone_ = refined ? 0.0 : by_links_;
  return StepOutcome::kRoundDone;
}

}  // namespace radiosity::solver
