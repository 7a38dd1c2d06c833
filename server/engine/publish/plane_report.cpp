#include "server/engine/publish/plane_report.h"

#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <utility>

#include "common/task.h"
#include "server/engine/publish/stated_error.h"
#include "server/scene/import/import_planes.h"
#include "server/scene/values/daylight.h"
#include "server/solver/math/sampling.h"
#include "server/solver/planes/plane_figures.h"
#include "server/solver/planes/plane_rays.h"
#include "server/solver/planes/sky_solve.h"

namespace radiosity::engine {
namespace {

/// Standard error of points that is measured to, as part of the mean.
constexpr double kWantedError = 0.01;
/// Of the overcast sky for daylight factors: any would do, since they are ratios. Its ground reflects as that of
/// daylight does where nothing is said.
constexpr double kOutsideLux = 10'000.0, kGround = 0.2;
constexpr double kPercent = 100.0;

/// Unit boxes from the scene, beyond which rays are none.
constexpr double kFar = 1e9;

bool isAskedFor(const scene::MeasuringPlane& plane, const std::string& which) {
  return which.empty() || plane.name == which || std::to_string(plane.node) == which;
}

solver::PlaneGrid gridOf(const scene::MeasuringPlane& plane, const scene::PatchScene& patches) {
  return {(plane.corner - patches.centre) / patches.scale,
          plane.across / patches.scale,
          plane.down / patches.scale,
          plane.normal,
          plane.columns,
          plane.rows};
}

std::optional<PlaneVerdict> toVerdict(const std::optional<solver::Verdict>& verdict) {
  if (!verdict) return std::nullopt;
  return *verdict == solver::Verdict::kPasses  ? PlaneVerdict::kPasses
         : *verdict == solver::Verdict::kFails ? PlaneVerdict::kFails
                                               : PlaneVerdict::kUndecided;
}

PlaneFigures toFigures(solver::PlaneResult result) {
  const auto& f = result.figures;
  return {f.mean,
          f.mean_error,
          f.minimum,
          f.minimum_error,
          f.maximum,
          f.maximum_error,
          f.median,
          f.uniformity,
          f.uniformity_error,
          f.solve_error,
          std::move(result.light),
          std::move(result.error)};
}

solver::PlaneResult resultOf(const solver::PlaceLight& light, const scene::MeasuringPlane& plane,
                             const PlaneParts& parts, double systematic, const solver::PlaneGoal& goal, double unit) {
  solver::PlaneRays rays(light, gridOf(plane, *parts.patches),
                         solver::mixKeys(solver::mixKeys(parts.seed, 0x504C414EULL), plane.node));
  rays.measure(kWantedError);
  return solver::planeFigures(rays, systematic, goal, unit);
}

MeasuredPlane placed(const scene::MeasuringPlane& plane) {
  MeasuredPlane made;
  made.node = plane.node;
  made.name = shortName(plane.name);
  made.columns = plane.columns;
  made.rows = plane.rows;
  made.place = {plane.pointAt(0, 0), plane.across / static_cast<double>(plane.columns),
                plane.down / static_cast<double>(plane.rows)};
  made.normal = plane.normal;
  made.wanted_lux = plane.target.lux;
  made.wanted_uniformity = plane.target.uniformity;
  return made;
}

void measureIlluminance(const PlaneParts& parts, std::vector<MeasuredPlane>& measured) {
  const solver::PlaceLight light(
      {*parts.patches, nullptr, nullptr, parts.materials, parts.sources, parts.irradiance, parts.difference});
  for (std::size_t p = 0; p < parts.planes.size(); ++p) {
    const auto& plane = parts.planes[p];
    auto result = resultOf(light, plane, parts, parts.systematic, {plane.target.lux, plane.target.uniformity}, 1.0);
    measured[p].lux_verdict = toVerdict(result.verdict.lux);
    measured[p].uniformity_verdict = toVerdict(result.verdict.uniformity);
    measured[p].verdict = toVerdict(result.verdict.all);
    measured[p].illuminance = toFigures(std::move(result));
  }
}

void measureDaylight(const PlaneParts& parts, std::vector<MeasuredPlane>& measured) {
  auto materials = parts.materials;
  materials.emission.fill(glm::vec3(0.0F));
  solver::LightSources sources;
  sources.sky.picture = scene::SharedSkyPicture(std::make_shared<const scene::SkyPicture>(scene::daylightImage(
      scene::cieShape(scene::kCieOvercast), {0.0, 1.0, 0.0}, kOutsideLux, kGround * kOutsideLux / std::numbers::pi)));
  const std::vector<glm::vec3> dark(parts.patches->nodeCount(), glm::vec3(0.0F));
  solver::PlaceLight light({*parts.patches, nullptr, nullptr, materials, sources, dark});
  const auto solution = solver::solveUnderSky(light, *parts.patches, parts.seed);
  light.setIrradiance(solution.irradiance, solution.difference);
  const double unit = kPercent / solver::horizontalIlluminance(light);
  for (std::size_t p = 0; p < parts.planes.size(); ++p)
    measured[p].daylight_factor = toFigures(resultOf(light, parts.planes[p], parts, 0.0, {}, unit));
}

}  // namespace

Result<PlaneParts> readPlanes(const LitScene& lit, const MeasureRequest& request) {
  PlaneParts parts;
  const auto planes = scene::readPlanes(lit.document());
  if (!planes) return tl::unexpected<Error>(planes.error());
  for (const auto& plane : *planes)
    if (isAskedFor(plane, request.plane)) parts.planes.push_back(plane);
  if (parts.planes.empty() && !request.plane.empty())
    return fail(ErrorCode::kNotFound, "there is no measuring plane of this name, or on the node of this number",
                "plane");
  if (parts.planes.empty()) return parts;
  for (const auto& plane : parts.planes)
    if (!(glm::distance(plane.corner, lit.patches().centre) <= kFar * lit.patches().scale))
      return fail(ErrorCode::kInvalidScene, "lies a thousand million times as far away as the scene is large",
                  scene::place(lit.document().name, "/nodes/" + std::to_string(plane.node) + "/extras/radiosityPlane"));
  parts.patches = lit.sharedPatches();
  parts.materials = lit.materials();
  parts.sources = lit.sources();
  parts.seed = lit.settings().seed;
  parts.irradiance = lit.ownLight().mean;
  parts.systematic = systematicPart(lit, parts.irradiance);
  parts.difference = lit.solver().halfIrradiance(0);
  const auto second = lit.solver().halfIrradiance(1);
  for (std::size_t n = 0; n < second.size(); ++n) parts.difference[n] -= second[n];
  return parts;
}

std::vector<MeasuredPlane> measurePlanes(const PlaneParts& parts, const MeasureRequest& request) {
  std::vector<MeasuredPlane> measured;
  for (const auto& plane : parts.planes) measured.push_back(placed(plane));
  if (measured.empty()) return measured;
  measureIlluminance(parts, measured);
  if (request.daylight_factor) measureDaylight(parts, measured);
  return measured;
}

}  // namespace radiosity::engine
