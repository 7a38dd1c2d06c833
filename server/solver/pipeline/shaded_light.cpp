#include "server/solver/pipeline/shaded_light.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "common/parallel.h"
#include "server/solver/math/halves.h"

namespace radiosity::solver {
namespace {

/// A node shines from so many of its leaves.
constexpr std::uint32_t kNodeLeaves = 16;
/// A crowd from so many of its lamps, and a sky from so many directions.
constexpr std::uint32_t kCrowdLamps = 64;
/// What leaves lack is known so badly that a larger factor would be one of noise.
constexpr float kMostFactor = 4.0F;

ShadingEmitter emitterOf(const LightPolygon& light) {
  ShadingEmitter emitter;
  emitter.corners = std::span(light.corners).first(light.corner_count);
  for (const auto& corner : emitter.corners) emitter.at += glm::dvec3(corner);
  emitter.at /= static_cast<double>(light.corner_count);
  return emitter;
}

ShadingEmitter emitterOf(const PunctualLights::Source& source) {
  using Kind = PunctualLights::Source::Kind;
  ShadingEmitter emitter;
  if (source.kind == Kind::kLamp && source.shape.kind == LampShape::Kind::kSky) {
    emitter.kind = ShadingEmitter::Kind::kDirections;
    for (std::uint32_t k = 0; k < kCrowdLamps; ++k) {
      const glm::dvec2 at((k % 8 + 0.5) / 8.0, (k / 8 + 0.5) / 8.0);
      const glm::dvec3 towards(lampRay(source.lamp(), {at.x, at.y, 0.0, 0.0}).origin);
      emitter.patches.push_back({towards, -towards, 1.0});
    }
    return emitter;
  }
  if (source.kind == Kind::kLamp && source.shape.isFlat()) {
    emitter.kind = ShadingEmitter::Kind::kPatches;
    for (std::uint32_t k = 0; k < kNodeLeaves; ++k) {
      const glm::dvec2 at((k % 4 + 0.5) / 4.0, (k / 4 + 0.5) / 4.0);
      emitter.patches.push_back({source.shape.pointOn(at), glm::dvec3(source.shape.axis), 1.0});
    }
    return emitter;
  }
  const bool is_lamp = source.kind == Kind::kLamp && !source.shape.isFar();
  const bool is_point = is_lamp || source.kind == Kind::kPoint || source.kind == Kind::kSpot;
  emitter.kind = is_point                    ? ShadingEmitter::Kind::kPoint
                 : source.kind == Kind::kSky ? ShadingEmitter::Kind::kSky
                                             : ShadingEmitter::Kind::kDirection;
  emitter.at = glm::dvec3(is_point ? source.position : source.direction);
  return emitter;
}

/// Some of its lamps, evenly by what they send. Of one without lamps, which is dark, nothing is asked.
ShadingEmitter emitterOf(const Crowd& crowd) {
  ShadingEmitter emitter;
  emitter.kind = ShadingEmitter::Kind::kPatches;
  for (std::uint32_t k = 0; crowd.lamps && k < kCrowdLamps; ++k) {
    double u = (k + 0.5) / kCrowdLamps;
    const auto& lamp = crowd.lamps->lights()[crowd.lamps->byFlux(u)];
    emitter.patches.push_back({glm::dvec3(lamp.ball()), glm::dvec3(lamp.normal), crowd.area / kCrowdLamps});
  }
  return emitter;
}

}  // namespace

void ShadedLight::shadeFor(std::shared_ptr<const scene::ShadingNormals> normals) {
  shading_ = LeafShading(patches_, sides_, std::move(normals));
  values_ = zeros();
}

ShadedLight::Values ShadedLight::zeros() const {
  Values values;
  for (auto& half : values) half.assign(shading_.size(), glm::vec3(0.0F));
  return values;
}

/// Of the leaves that it has area on, some, evenly.
ShadingEmitter ShadedLight::emitterOf(const NodePlace& node) const {
  ShadingEmitter emitter;
  emitter.kind = ShadingEmitter::Kind::kPatches;
  const Side& side = sides_[node.side];
  const auto rect = leafRect(side, node);
  const auto& surface = patches_.surfaces[side.surface];
  const auto width = rect.x1 - rect.x0, all = width * (rect.y1 - rect.y0), count = std::min(all, kNodeLeaves);
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto at = static_cast<std::uint32_t>((2 * std::uint64_t{k} + 1) * all / (2 * std::uint64_t{count}));
    const auto leaf = (rect.y0 + at / width) * side.width + rect.x0 + at % width;
    const auto& point = patches_.leaves[surface.first_leaf + leaf];
    const auto area = static_cast<double>(patches_.node_area[side.first_node + leaf]);
    if (point.triangle == scene::kNone || area <= 0.0) continue;
    const auto place = shading_.place(side, {point.texel, point.triangle});
    emitter.patches.push_back({place.position, place.geometric, area});
  }
  return emitter;
}

ShadingEmitter ShadedLight::emitterOf(const Shooter& shooter, const ShootersAndLights& from) const {
  if (shooter.light != scene::kNone) return solver::emitterOf(from.lights[shooter.light]);
  if (shooter.source != scene::kNone) return solver::emitterOf(from.sources[shooter.source]);
  if (shooter.crowd != scene::kNone) return solver::emitterOf(from.crowds[shooter.crowd]);
  return emitterOf(shooter.place);
}

/// Adds what light over links, as it was last solved for, is more for the shading normals. By side, so that the sums do
/// not depend on who makes them.
void ShadedLight::addLinks(const ShootersAndLights& from, LinkSystem::From which, Values& values) const {
  struct Sender {
    const Shooter* shooter;
    ShadingEmitter emitter;
    std::array<glm::vec3, 2> sent;
  };
  std::vector<Sender> senders;
  for (const auto& shooter : from.system.shooters()) {
    if (which == LinkSystem::From::kLights && !shooter.isLight()) continue;
    const auto sentBy = [&](std::size_t half) {
      return static_cast<float>(shooter.carried(half)) * shooter.sent[half];
    };
    const std::array<glm::vec3, 2> sent{sentBy(0), sentBy(1)};
    if (sent[0] != glm::vec3(0.0F) || sent[1] != glm::vec3(0.0F))
      senders.push_back({&shooter, emitterOf(shooter, from), sent});
  }
  const auto shadeSide = [&](std::size_t part) {
    const auto& shaded = shading_.sides()[part];
    const Side& side = sides_[shaded.side];
    std::array<std::vector<float>, 2> link{std::vector<float>(side.leaf_count), std::vector<float>(side.leaf_count)};
    for (const auto& [shooter, emitter, sent] : senders) {
      std::array<bool, 2> has{};
      for (std::size_t half = 0; half < 2; ++half) {
        has[half] = sent[half] != glm::vec3(0.0F) && shooter->column[half].decode(side.first_value, link[half]);
        if (!has[half]) std::ranges::fill(link[half], 0.0F);
      }
      for (std::uint32_t leaf = 0; leaf < side.leaf_count && (has[0] || has[1]); ++leaf) {
        const auto number = shaded.first + leaf;
        if (shading_.normal(number) == glm::vec3(0.0F) || (link[0][leaf] <= 0.0F && link[1][leaf] <= 0.0F)) continue;
        std::array<ShadedPlace, LeafShading::kMostPlaces> places;
        const auto count = shading_.places(side, leaf, places);
        const auto more = static_cast<float>(shadedPart(emitter, std::span(places).first(count)) - 1.0);
        for (std::size_t half = 0; half < 2; ++half) {
          const auto& tint = shooter->tint[half];
          const auto arrives = more * link[half][leaf] * sent[half];
          values[half][number] += tint ? tint->at(side.first_value + leaf) * arrives : arrives;
        }
      }
    }
  };
  inTurns(shading_.sides().size(), shadeSide);
}

ShadedLight::Values ShadedLight::factors(const DirectSmoothing::Halves& raw,
                                         const DirectSmoothing::Halves& smooth) const {
  Values factors;
  for (std::size_t half = 0; half < 2; ++half) {
    factors[half].assign(shading_.size(), glm::vec3(1.0F));
    for (const auto& shaded : shading_.sides()) {
      const Side& side = sides_[shaded.side];
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
        const auto &before = raw[half][side.first_value + leaf], &after = smooth[half][side.first_value + leaf];
        for (int c = 0; c < 3; ++c)
          if (before[c] > 0.0F)
            factors[half][shaded.first + leaf][c] = std::clamp(after[c] / before[c], 0.0F, kMostFactor);
      }
    }
  }
  return factors;
}

void ShadedLight::scale(const Values& factors, Values& values) {
  for (std::size_t half = 0; half < 2; ++half)
    for (std::size_t number = 0; number < factors[half].size(); ++number) values[half][number] *= factors[half][number];
}

void ShadedLight::update(const ShootersAndLights& from, const LeafGather* gather) {
  if (shading_.empty()) return;
  values_ = zeros();
  addLinks(from, LinkSystem::From::kAll, values_);
  scale(std::exchange(next_factors_, {}), values_);
  if (gather == nullptr) return;
  for (const auto& shaded : shading_.sides()) {
    const Side& side = sides_[shaded.side];
    for (std::size_t half = 0; half < 2; ++half) {
      const auto gathered = gather->irradiance(half), parts = gather->shadedParts(half);
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
        values_[half][shaded.first + leaf] += (parts[shaded.first + leaf] - 1.0F) * gathered[side.first_value + leaf];
    }
  }
}

void ShadedLight::addDirectTo(const ShootersAndLights& from, const Values& factors,
                              std::vector<glm::vec3>& nodes) const {
  if (shading_.empty()) return;
  auto direct = zeros();
  addLinks(from, LinkSystem::From::kLights, direct);
  scale(factors, direct);
  add(direct, kBothHalves, nodes);
}

glm::vec3 ShadedLight::correction(std::uint32_t value, const glm::vec3& light, const glm::vec3& lacks) const {
  const auto number = shading_.empty() ? scene::kNone : shading_.numberOf(value);
  if (number == scene::kNone) return lacks;
  const glm::vec3 more = 0.5F * (values_[0][number] + values_[1][number]);
  glm::vec3 factor(1.0F);
  for (int c = 0; c < 3; ++c) {
    if (light[c] > 0.0F) factor[c] = std::clamp(1.0F + more[c] / light[c], 0.0F, kMostFactor);
  }
  return factor * lacks;
}

void ShadedLight::add(const Values& values, std::uint32_t half, std::vector<glm::vec3>& nodes) const {
  for (const auto& shaded : shading_.sides()) {
    const Side& side = sides_[shaded.side];
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto number = shaded.first + leaf;
      if (shading_.normal(number) == glm::vec3(0.0F)) continue;
      const auto more = half == kBothHalves ? 0.5F * (values[0][number] + values[1][number]) : values[half][number];
      auto& node = nodes[side.first_node + leaf];
      node = glm::max(node + more, 0.0F);
    }
  }
}

}  // namespace radiosity::solver
