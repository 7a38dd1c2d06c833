// LeafGather and mirrors: what rays see in them, and what of the light of leaves arrives by way of them.
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_gather.h"

namespace radiosity::solver {
namespace {

constexpr std::array<float, 4> kWhite{1.0F, 1.0F, 1.0F, 0.0F};

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

/// What the mirror of a step reflects.
LeafGather::Light32 LeafGather::tintOf(const LeafSights::Step& step) const {
  const auto mirror = SpecularStep::of(step.by);
  const auto tint = light_.mirrors->reflectance(mirror.leaf, mirror.edge());
  return {tint.x, tint.y, tint.z, 0.0F};
}

/// What the leaf there has that only those see who see it in a mirror.
LeafGather::Light32 LeafGather::shotAt(std::size_t half, std::uint32_t end) const {
  if (end >= sights_.endCount()) {
    const auto& step = sights_.steps(half)[end - sights_.endCount()];
    if (SpecularStep::is(step.by) && SpecularStep::of(step.by).is_again) return {};
    end = LeafSights::leafOf(step);
  }
  return end < sights_.leafCount() ? halves_[half].shot[end] : Light32{};
}

/// By step of a mirror: what it reflects of what is met there, and of what the mirrors beyond reflect. `met(end)`: of
/// where the ray ends, or goes on.
template <typename Met>
std::vector<LeafGather::Light32> LeafGather::reflectedOf(std::size_t half, const Met& met) const {
  const auto ends = sights_.endCount();
  const auto steps = sights_.steps(half);
  std::vector<Light32> reflected(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto& step = steps[i];
    if (!SpecularStep::is(step.by)) continue;  // what a leaf reflects diffusely is its own light
    const Light32 here = met(step.next), beyond = step.next >= ends ? reflected[step.next - ends] : Light32{};
    const auto tint = tintOf(step);
    for (std::size_t c = 0; c < 3; ++c) reflected[i][c] = tint[c] * (here[c] + beyond[c]);
  }
  return reflected;
}

/// followSteps() where some steps are of mirrors.
void LeafGather::followMirrors(std::size_t half, const std::vector<Light>* source) {
  auto& radiosity = halves_[half].radiosity;
  const auto& passed = halves_[half].passed;
  auto to = radiosity.begin() + sights_.endCount();
  for (const auto& step : sights_.steps(half)) {
    auto& light = *to++;
    const auto& next = radiosity[step.next];
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
    const auto shot = source != nullptr ? shotAt(half, step.next) : Light32{};
    light = mirror.is_again ? Light32{} : radiosity[mirror.leaf];
    for (std::size_t c = 0; c < 3; ++c) light[c] += tint[c] * (next[c] + shot[c]);
  }
}

/// Whether light that comes to where a ray ends, or goes on, arrives there. What glass stops depends on the angle, and
/// no leaf knows that from its irradiance, so that it takes none: what it reflects is told by rays alone.
bool LeafGather::takesLight(std::size_t half, std::uint32_t end) const {
  if (end >= sights_.endCount()) {
    const auto& step = sights_.steps(half)[end - sights_.endCount()];
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
  half.shot.clear();
  half.at_glass.clear();
  if (!light_.mirrors) return;
  const auto leaves = sights_.leafCount(), ends = sights_.endCount();
  half.shot.resize(leaves);
  for (std::uint32_t v = 0; v < leaves; ++v) {
    const auto shot = light_.lamps[v] + light_.shot[h][v];
    half.shot[v] = {shot.x, shot.y, shot.z, 0.0F};
  }
  const auto arrives = reflectedOf(h, [&](std::uint32_t end) { return takesLight(h, end) ? kWhite : Light32{}; });
  half.mirrored.resize(leaves);
  if (light_.mirrors->hasGlass()) half.at_glass.resize(leaves);
  inLeavesOf(sights_, h, [&](std::uint32_t v, std::uint32_t end, float part) {
    const auto first = end >= ends ? LeafSights::leafOf(sights_.steps(h)[end - ends]) : end;
    if (first < leaves && light_.mirrors->isGlass(first)) half.at_glass[v] += part;
    if (end < ends) return;
    for (std::size_t c = 0; c < 3; ++c) half.mirrored[v][c] += part * arrives[end - ends][c];
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
  const auto reflected = reflectedOf(h, skyOf);
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
    const auto& radiosity = halves_[h].radiosity;
    const auto to_sky = reflectedOf(h, [&](std::uint32_t end) { return sights_.isSky(end) ? kWhite : Light32{}; });
    const auto unlit = reflectedOf(h, [&](std::uint32_t end) { return sights_.isAbsorbed(end) ? kWhite : Light32{}; });
    inLeavesOf(sights_, h, [&](std::uint32_t v, std::uint32_t end, float part) {
      if (end < ends || !SpecularStep::is(sights_.steps(h)[end - ends].by)) return;
      const auto by = LeafSights::leafOf(sights_.steps(h)[end - ends]);
      const auto shot = shotOf(h, v);
      for (std::size_t c = 0; c < 3; ++c) {
        const double share = 0.5 * areaOf(v) * static_cast<double>(part);
        const double sent = share * (static_cast<double>(radiosity[v][c]) + shot[c]);
        const auto leaves = static_cast<double>(to_sky[end - ends][c]),
                   dies = static_cast<double>(unlit[end - ends][c]);
        escaped_[c] += sent * leaves;
        absorbed_[c] += sent * dies;
        mirrored_flux_[c] += sent * (leaves + dies) + share * static_cast<double>(radiosity[end][c] - radiosity[by][c]);
      }
    });
  }
}

}  // namespace radiosity::solver
