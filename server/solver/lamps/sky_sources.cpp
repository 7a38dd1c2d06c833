#include "server/solver/lamps/sky_sources.h"

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "server/scene/values/sky_table.h"

namespace radiosity::solver {
namespace {

using Source = PunctualLights::Source;

using std::numbers::pi;
/// So many directions of a lamp, drawn evenly, tell how large the scene is to it.
constexpr int kSilhouettes = 32;

glm::dvec3 turned(const glm::dvec3& direction, double turn) {
  return {std::cos(turn) * direction.x + std::sin(turn) * direction.z, direction.y,
          std::cos(turn) * direction.z - std::sin(turn) * direction.x};
}

Source lampOf(const scene::SkyLamp& lamp, const scene::Sky& sky, const std::array<glm::vec3, 2>& box) {
  Source source;
  source.kind = Source::Kind::kLamp;
  source.shape.kind = LampShape::Kind::kSky;
  source.shape.across = glm::vec3(turned({1.0, 0.0, 0.0}, sky.turn_rad));
  source.web = lamp.table;
  source.web_key = lamp.key;
  source.intensity = static_cast<double>(sky.strength) * lamp.light;
  double sum = 0.0;
  for (int i = 0; i < kSilhouettes * kSilhouettes; ++i) {
    const glm::dvec2 at((i % kSilhouettes + 0.5) / kSilhouettes, (i / kSilhouettes + 0.5) / kSilhouettes);
    sum += boxSilhouette(box, glm::vec3(turned(scene::skyDirection(*lamp.table, at), sky.turn_rad)));
  }
  source.flux_per_intensity = sum / (kSilhouettes * kSilhouettes);
  return source;
}

/// Its intensity is what radiance, the same from everywhere, would bring as much light into the box.
Source cellsOf(const scene::Sky& sky, const std::array<glm::vec3, 2>& box) {
  std::vector<glm::dvec3> radiance;
  radiance.reserve(SkyCells::kCount);
  glm::dvec3 flux(0.0);
  double even = 0.0;
  for (std::uint32_t cell = 0; cell < SkyCells::kCount; ++cell) {
    const auto at = SkyCells::extentOf(cell);
    // The picture turns from +Z towards +X, against azimuths.
    radiance.push_back(static_cast<double>(sky.strength) *
                       sky.picture->restOver(at.azimuth + sky.turn_rad, at.width, at.height, at.extent));
    const double enters = at.solidAngle() * boxSilhouette(box, glm::vec3(SkyCells::directionOf(cell)));
    flux += enters * radiance.back();
    even += enters;
  }
  Source source;
  source.kind = Source::Kind::kSky;
  source.flux_per_intensity = even;
  if (!(even > 0.0)) return source;
  source.intensity = flux / even;
  std::vector<float> table;
  table.reserve(3 * radiance.size());
  for (const auto& of_cell : radiance)
    for (int c = 0; c < 3; ++c)
      table.push_back(source.intensity[c] > 0.0 ? static_cast<float>(of_cell[c] / source.intensity[c]) : 0.0F);
  source.web_key = scene::keyOfFloats(table);
  source.web = std::make_shared<const std::vector<float>>(std::move(table));
  return source;
}

}  // namespace

std::vector<Source> pictureSources(const scene::Sky& sky, const std::array<glm::vec3, 2>& box, bool rays_see_sky) {
  std::vector<Source> sources;
  if (!sky.picture || !(sky.strength > 0.0F)) return sources;
  if (rays_see_sky) sources.push_back(cellsOf(sky, box));
  for (const auto& lamp : rays_see_sky ? sky.picture->bright() : sky.picture->whole())
    sources.push_back(lampOf(lamp, sky, box));
  return sources;
}

SkyLight::SkyLight(std::span<const Source> sources) {
  for (const auto& source : sources) {
    if (source.kind != Source::Kind::kSky) continue;
    const auto light = pi * source.intensity;
    if (!source.isPicture()) {
      hemispheres[source.direction.y > 0.0F ? 0 : 1] += light;
      continue;
    }
    cells.resize(SkyCells::kCount, glm::vec3(0.0F));
    for (std::size_t cell = 0; cell < cells.size(); ++cell) {
      const auto* radiance = source.web->data() + 3 * cell;
      cells[cell] += glm::vec3(light) * glm::vec3(radiance[0], radiance[1], radiance[2]);
    }
  }
}

}  // namespace radiosity::solver
