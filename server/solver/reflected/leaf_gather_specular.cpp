// LeafGather, mirrors and coloured glass: what rays see in and through them, and what of the light of leaves arrives by
// way of them.
#include <glm/geometric.hpp>
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_gather.h"

namespace radiosity::solver {
namespace {

constexpr std::array<float, 4> kWhite{1.0F, 1.0F, 1.0F, 0.0F};

void add(std::array<float, 4>& sum, const std::array<float, 4>& light) {
  for (std::size_t c = 0; c < 4; ++c) sum[c] += light[c];
}

/// Calls visit(leaf value, end, part of the leaf's rays) for each ray of a half.
template <typename Visit>
void inLeavesOf(const LeafSights& sights, std::size_t half, const Visit& visit) {
  for (std::uint32_t v = 0; v < sights.leafCount(); ++v) {
    const auto seen = sights.seen(half, v);
    const float part = 1.0F / static_cast<float>(seen.size());
    for (const auto end : seen) visit(v, end, part);
  }
}

}  // namespace

/// What the mirror of a step reflects, or its pane lets pass.
LeafGather::Light32 LeafGather::tintOf(const LeafSights::Step& step) const {
  const auto mirror = SpecularStep::of(step.by);
  const auto tint =
      PaneStep::is(step.by) ? sights_.tintOf(step) : light_.mirrors->reflectance(mirror.leaf, mirror.edge());
  return {tint.x, tint.y, tint.z, 0.0F};
}

/// What all panes let pass that a ray goes through from there on.
LeafGather::Light32 LeafGather::throughPanes(std::size_t half, std::uint32_t end) const {
  auto part = kWhite;
  for (; end >= sights_.endCount(); end = sights_.steps(half)[end - sights_.endCount()].next) {
    const auto& step = sights_.steps(half)[end - sights_.endCount()];
    if (!PaneStep::is(step.by)) break;
    const auto tint = tintOf(step);
    for (std::size_t c = 0; c < 3; ++c) part[c] *= tint[c];
  }
  return part;
}

/// What the leaf there has that only those see who see it in a mirror.
LeafGather::Light32 LeafGather::shotAt(std::size_t half, std::uint32_t end) const {
  const auto behind = sights_.behindPanes(half, end);
  if (behind >= sights_.endCount()) {
    const auto& step = sights_.steps(half)[behind - sights_.endCount()];
    if (SpecularStep::is(step.by) && SpecularStep::of(step.by).is_again) return {};
  }
  const auto leaf = sights_.firstEnd(half, behind);
  if (leaf >= sights_.leafCount()) return {};
  auto shot = halves_[half].shot[leaf];
  if (behind != end) {
    const auto part = throughPanes(half, end);
    for (std::size_t c = 0; c < 3; ++c) shot[c] *= part[c];
  }
  return shot;
}

/// By step of a mirror or pane: what it reflects, or lets pass, of what is met there, and of what those beyond do.
/// `met(end)`: of where the ray ends, or goes on. Of rays that come straight through panes kMirrors alone leaves out
/// what no mirror reflected.
template <typename Met>
std::vector<LeafGather::Light32> LeafGather::reflectedOf(std::size_t half, Ways ways, const Met& met) const {
  const auto ends = sights_.endCount();
  const auto steps = sights_.steps(half);
  std::vector<Light32> reflected(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto& step = steps[i];
    const bool is_pane = PaneStep::is(step.by);
    if (!is_pane && !SpecularStep::is(step.by)) continue;  // what a leaf reflects diffusely is its own light
    const Light32 beyond = step.next >= ends ? reflected[step.next - ends] : Light32{};
    Light32 here{};
    if (!is_pane && ways == Ways::kMirrors && step.next >= ends && PaneStep::is(steps[step.next - ends].by)) {
      here = met(sights_.behindPanes(half, step.next));
      const auto part = throughPanes(half, step.next);
      for (std::size_t c = 0; c < 3; ++c) here[c] *= part[c];
    } else if (!is_pane || ways == Ways::kAll) {
      here = met(step.next);
    }
    const auto tint = tintOf(step);
    for (std::size_t c = 0; c < 3; ++c) reflected[i][c] = tint[c] * (here[c] + beyond[c]);
  }
  return reflected;
}

/// What lamps send straight through panes comes over links, and is not to be counted twice.
template <typename Met>
LeafGather::Reflected LeafGather::reflectedBoth(std::size_t half, const Met& met) const {
  Reflected reflected{reflectedOf(half, Ways::kAll, met), {}};
  if (sights_.rays()->hasTints()) reflected.of_mirrors = reflectedOf(half, Ways::kMirrors, met);
  return reflected;
}

/// followSteps() where some steps are of mirrors, or of panes.
void LeafGather::followMirrors(std::size_t half, const std::vector<Light>* source) {
  auto& radiosity = halves_[half].radiosity;
  const auto& passed = halves_[half].passed;
  auto to = radiosity.begin() + sights_.endCount();
  for (const auto& step : sights_.steps(half)) {
    auto& light = *to++;
    const auto& next = radiosity[step.next];
    if (PaneStep::is(step.by)) {
      const auto tint = tintOf(step);
      for (std::size_t c = 0; c < 3; ++c) light[c] = tint[c] * next[c];
      continue;
    }
    if (!SpecularStep::is(step.by)) {
      const auto& reflectance = light_.reflectance[step.by];
      for (std::size_t c = 0; c < 3; ++c) {
        float own = source != nullptr ? static_cast<float>((*source)[step.by][c]) : 0.0F;
        if (!passed.empty()) own += passed[step.by][c];
        light[c] = reflectance[static_cast<int>(c)] * next[c] + own;
      }
      continue;
    }
    const auto mirror = SpecularStep::of(step.by);
    const auto tint = tintOf(step);
    light = mirror.is_again ? Light32{} : radiosity[mirror.leaf];
    Light32 met = next, not_here{};
    if (source != nullptr) {
      add(met, shotAt(half, step.next));
      add(met, imagedAt(half, step.next));
      not_here = imagedIn(half, step);
    }
    for (std::size_t c = 0; c < 3; ++c) light[c] += tint[c] * met[c] - not_here[c];
  }
}

/// Lamps that are seen in the mirror of a step are looked for otherwise.
bool LeafGather::isImaged(const LeafSights::Step& step) const {
  if (!SpecularStep::is(step.by)) return false;
  if (mirrored_lamps_.caustics() != nullptr) return true;
  const auto* images = mirrored_lamps_.images();
  if (images == nullptr) return false;
  const auto mirror = SpecularStep::of(step.by);
  return !mirror.is_again && images->isIn(mirror.leaf);
}

/// Of a step: light of a lamp that the ray found in a mirror and that leaves get without the ray.
LeafGather::Light32 LeafGather::imagedIn(std::size_t half, const LeafSights::Step& step) const {
  if (!isImaged(step)) return {};
  const auto behind = sights_.behindPanes(half, step.next);
  if (behind >= sights_.endCount()) {  // rays go on from lamps of metal, too
    const auto& next = sights_.steps(half)[behind - sights_.endCount()];
    if (SpecularStep::is(next.by) && SpecularStep::of(next.by).is_again) return {};
  }
  const auto end = sights_.firstEnd(half, behind);
  if (end >= sights_.leafCount()) return {};
  const auto tint = tintOf(step), part = throughPanes(half, step.next);
  const auto& lamp = light_.imaged_lamps[end];
  return {tint[0] * part[0] * lamp.x, tint[1] * part[1] * lamp.y, tint[2] * part[2] * lamp.z, 0.0F};
}

/// Of a ray that is drawn as a lamp's light leaves it: what of that arrives as of an image.
LeafGather::Light32 LeafGather::arrivesAsImage(std::size_t half, std::uint32_t lamp, std::uint32_t end) const {
  const auto first = sights_.behindPanes(half, end);
  if (first < sights_.endCount()) return {};
  const auto& step = sights_.steps(half)[first - sights_.endCount()];
  if (!isImaged(step) || !takesLight(half, sights_.behindPanes(half, step.next))) return {};
  const auto tint = tintOf(step), before = throughPanes(half, end), after = throughPanes(half, step.next);
  const auto& light = light_.imaged_lamps[lamp];
  Light32 arrives{light.x, light.y, light.z, 0.0F};
  for (std::size_t c = 0; c < 3; ++c) arrives[c] *= before[c] * tint[c] * after[c];
  return arrives;
}

/// What imagedIn() tells of where a ray ends, or goes on: who sees that in another mirror gets no image of it, while
/// paths from lamps arrive by any number of mirrors.
LeafGather::Light32 LeafGather::imagedAt(std::size_t half, std::uint32_t end) const {
  if (mirrored_lamps_.caustics() != nullptr) return {};
  const auto behind = sights_.behindPanes(half, end);
  if (behind < sights_.endCount()) return {};
  auto imaged = imagedIn(half, sights_.steps(half)[behind - sights_.endCount()]);
  const auto part = throughPanes(half, end);
  for (std::size_t c = 0; c < 3; ++c) imaged[c] *= part[c];
  return imaged;
}

/// Of such a ray, of which `arrives` tells what arrives by way of mirrors: the light of a lamp that leaves get without
/// rays.
LeafGather::Light32 LeafGather::arrivesOtherwise(std::size_t half, std::uint32_t lamp, std::uint32_t end,
                                                 const Reflected& arrives) const {
  if (mirrored_lamps_.caustics() == nullptr) return arrivesAsImage(half, lamp, end);
  const auto& light = light_.imaged_lamps[lamp];
  const auto& part = arrives.byMirrors()[end - sights_.endCount()];
  return {part[0] * light.x, part[1] * light.y, part[2] * light.z, 0.0F};
}

/// What arrives of lamps without rays, which is like light over links from then on.
void LeafGather::takeImages() {
  for (auto& half : halves_) half.imaged.clear();
  spread_ = imaged_flux_ = {};
  image_noise_ = {};
  if (!mirrored_lamps_.any()) return;
  for (auto& half : halves_) half.imaged.assign(sights_.leafCount(), glm::vec3(0.0F));
  inBothHalves([&](std::size_t h) { mirrored_lamps_.addSourcesTo(h, halves_[h].imaged); });
  spreadImages();
  inBothHalves([&](std::size_t h) { mirrored_lamps_.addImagesTo(h, halves_[h].imaged); });
  std::array<std::vector<glm::vec3>, 2> caustics;
  inBothHalves([&](std::size_t h) {
    if (mirrored_lamps_.caustics() != nullptr) {
      caustics[h].assign(sights_.leafCount(), glm::vec3(0.0F));
      mirrored_lamps_.addCausticsTo(h, caustics[h]);
    }
    auto& imaged = halves_[h].imaged;
    for (std::uint32_t v = 0; v < imaged.size(); ++v)
      if (light_.mirrors->isGlass(v)) imaged[v] = glm::vec3(0.0F);
  });
  image_noise_ = {noiseOf(halves_[0].imaged, halves_[1].imaged), noiseOf(caustics[0], caustics[1])};
  inBothHalves([&](std::size_t h) {
    auto& imaged = halves_[h].imaged;
    for (std::uint32_t v = 0; v < imaged.size(); ++v) {
      if (!caustics[h].empty()) imaged[v] += caustics[h][v];
      light_.irradiance[h][v] += imaged[v];
    }
  });
}

/// Square of the noise in the mean of two halves, by leaf value: sum over leaves and channels, times area.
double LeafGather::noiseOf(std::span<const glm::vec3> a, std::span<const glm::vec3> b) const {
  double noise = 0.0;
  for (std::uint32_t v = 0; v < a.size(); ++v) {
    const auto off = 0.5F * (a[v] - b[v]);
    noise += areaOf(v) * static_cast<double>(glm::dot(off, off));
  }
  return noise;
}

bool LeafGather::refineImages(double goal) {
  const auto times = [&](double noise) { return noise / std::max(0.5 * goal, 1e-300); };
  return imageNoise() > goal && mirrored_lamps_.refine(times(image_noise_[0]), times(image_noise_[1]));
}

/// Of lights that are no surfaces rays find nothing, and no image is seen in another mirror: that reflects them as if
/// it did so diffusely.
void LeafGather::spreadImages() {
  for (std::uint32_t v = 0; v < sights_.leafCount(); ++v) {
    const auto arrives = 0.5F * (halves_[0].imaged[v] + halves_[1].imaged[v]);
    for (std::size_t c = 0; c < 3; ++c)
      imaged_flux_[c] += areaOf(v) * static_cast<double>(arrives[static_cast<int>(c)]);
    if (!light_.mirrors->has(v) || light_.mirrors->isGlass(v)) continue;
    const auto light = light_.mirrors->meanReflectance(v) * arrives;
    light_.emission[v] += light;
    for (std::size_t c = 0; c < 3; ++c) spread_[c] += areaOf(v) * static_cast<double>(light[static_cast<int>(c)]);
  }
}

/// Adds it to what rays bring, and to what of that counts for shading normals.
void LeafGather::tellImages() {
  for (std::size_t h = 0; h < 2; ++h) {
    const auto& imaged = halves_[h].imaged;
    auto& parts = shaded_part_[h];
    std::vector<glm::vec3> shaded(parts.size(), glm::vec3(0.0F));
    mirrored_lamps_.addShadedTo(h, shaded);
    for (std::uint32_t v = 0; v < imaged.size(); ++v) {
      const auto of_rays = gathered_[h][v];
      gathered_[h][v] += imaged[v];
      const auto number = shaded.empty() ? scene::kNone : shading_->numberOf(v);
      if (number == scene::kNone || imaged[v] == glm::vec3(0.0F)) continue;
      for (int c = 0; c < 3; ++c) {
        if (gathered_[h][v][c] > 0.0F)
          parts[number][c] = (parts[number][c] * of_rays[c] + shaded[number][c]) / gathered_[h][v][c];
      }
    }
  }
}

/// Whether light that comes to where a ray ends, or goes on, arrives there. What glass stops depends on the angle, and
/// no leaf knows that from its irradiance, so that it takes none: what it reflects is told by rays alone.
bool LeafGather::takesLight(std::size_t half, std::uint32_t end) const {
  if (end >= sights_.endCount()) {
    const auto& step = sights_.steps(half)[end - sights_.endCount()];
    if (PaneStep::is(step.by)) return false;
    if (SpecularStep::is(step.by) && SpecularStep::of(step.by).is_again) return false;
    end = LeafSights::leafOf(step);
  }
  return end < sights_.leafCount() && !light_.mirrors->isGlass(end);
}

/// On how many leaves the light of each leaf arrives by way of mirrors, as rays are drawn as light leaves; what of it
/// is stopped by glass at once; and what comes from the sky that way.
void LeafGather::takeMirrors(std::size_t h) {
  auto& half = halves_[h];
  half.mirrored.clear();
  half.in_mirrors.clear();
  half.shot.clear();
  half.at_glass.clear();
  half.through_panes.clear();
  if (!light_.mirrors) return;
  const auto leaves = sights_.leafCount(), ends = sights_.endCount();
  half.shot.resize(leaves);
  for (std::uint32_t v = 0; v < leaves; ++v) {
    const auto shot = light_.lamps[v] + light_.shot[h][v];
    half.shot[v] = {shot.x, shot.y, shot.z, 0.0F};
  }
  const auto arrives = reflectedBoth(h, [&](std::uint32_t end) { return takesLight(h, end) ? kWhite : Light32{}; });
  half.mirrored.resize(leaves);
  half.in_mirrors.resize(leaves);
  if (light_.mirrors->hasGlass() || sights_.rays()->hasTints()) half.at_glass.resize(leaves);
  if (sights_.rays()->hasTints()) half.through_panes.resize(leaves);
  inLeavesOf(sights_, h, [&](std::uint32_t v, std::uint32_t end, float part) {
    const bool is_pane = end >= ends && PaneStep::is(sights_.steps(h)[end - ends].by);
    const auto first = sights_.firstEnd(h, end);
    if (is_pane || (first < leaves && light_.mirrors->isGlass(first))) half.at_glass[v] += part;
    if (is_pane) half.through_panes[v] += part;
    if (end < ends) return;
    const auto imaged = arrivesOtherwise(h, v, end, arrives);
    for (std::size_t c = 0; c < 3; ++c) {
      half.mirrored[v][c] += part * arrives.all[end - ends][c];
      half.in_mirrors[v][c] += part * (arrives.byMirrors()[end - ends][c] * half.shot[v][c] - imaged[c]);
    }
  });
  takeMirroredSky(h);
}

/// Beside what rays find of it that no mirror reflects.
void LeafGather::takeMirroredSky(std::size_t h) {
  auto& half = halves_[h];
  const auto ends = sights_.endCount();
  const auto skyOf = [&](std::uint32_t end) {
    Light32 sky{};
    for (std::size_t c = 0; c < 3 && sights_.isSky(end); ++c) sky[c] = static_cast<float>(half.source[end][c]);
    return sky;
  };
  const auto reflected = reflectedOf(h, Ways::kAll, skyOf);
  half.sky.assign(sights_.leafCount(), {});
  inLeavesOf(sights_, h, [&](std::uint32_t v, std::uint32_t end, float part) {
    const auto light = end >= ends ? reflected[end - ends] : skyOf(end);
    for (std::size_t c = 0; c < 3; ++c) half.sky[v][c] += part * light[c];
  });
}

/// Noise is what rays of both halves make of the same light.
void LeafGather::meanOfShot() {
  auto &a = halves_[0].shot, &b = halves_[1].shot;
  for (std::size_t v = 0; v < a.size(); ++v) {
    for (std::size_t c = 0; c < 3; ++c) a[v][c] = b[v][c] = 0.5F * (a[v][c] + b[v][c]);
  }
}

/// What mirrors reflect: what of it arrives on leaves, as those that see it in mirrors receive it, and what leaves the
/// scene or falls on unlit sides, as it is sent. While what leaves send, in the mean of the halves, is there still.
void LeafGather::weighMirrors() {
  mirrored_flux_ = {};
  if (!light_.mirrors) return;
  const auto ends = sights_.endCount();
  for (std::size_t h = 0; h < 2; ++h) {
    for (std::size_t v = 0; v < halves_[h].imaged.size(); ++v) {
      for (std::size_t c = 0; c < 3; ++c)
        mirrored_flux_[c] += 0.5 * areaOf(v) * static_cast<double>(halves_[h].imaged[v][static_cast<int>(c)]);
    }
    const auto& radiosity = halves_[h].radiosity;
    const auto to_sky = reflectedBoth(h, [&](std::uint32_t end) { return sights_.isSky(end) ? kWhite : Light32{}; });
    const auto unlit =
        reflectedBoth(h, [&](std::uint32_t end) { return sights_.isAbsorbed(end) ? kWhite : Light32{}; });
    inLeavesOf(sights_, h, [&](std::uint32_t v, std::uint32_t end, float part) {
      if (end < ends) return;
      const auto& step = sights_.steps(h)[end - ends];
      const bool is_pane = PaneStep::is(step.by);
      if (!is_pane && !SpecularStep::is(step.by)) return;
      const auto shot = shotOf(h, v);
      for (std::size_t c = 0; c < 3; ++c) {
        const double share = 0.5 * areaOf(v) * static_cast<double>(part);
        const double by_rays = share * static_cast<double>(radiosity[v][c]), over_links = share * shot[c];
        const auto sent = [&](const Reflected& of) {
          return by_rays * static_cast<double>(of.all[end - ends][c]) +
                 over_links * static_cast<double>(of.byMirrors()[end - ends][c]);
        };
        const double leaves = sent(to_sky), dies = sent(unlit);
        escaped_[c] += leaves;
        absorbed_[c] += dies;
        const float own = is_pane ? 0.0F : radiosity[LeafSights::leafOf(step)][c];
        mirrored_flux_[c] += leaves + dies + share * static_cast<double>(radiosity[end][c] - own);
      }
    });
  }
}

}  // namespace radiosity::solver
