#include "tests/accuracy/compare.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tests/accuracy/closed_form.h"
#include "tests/oracle/random.h"

namespace radiosity::accuracy {
namespace {

/// Below this visible share a texel is filled from its neighbours, so its own mean says nothing about the solver.
constexpr double kLeastVisible = 0.25;
constexpr double kWholeTexel = 0.999;
/// Dividing reflected light by less than this would amplify rounding.
constexpr double kLeastReflectance = 0.01;

std::vector<Texel> chooseTexels(const LitScene& lit, const ReferenceOptions& options) {
  auto texels = findTexels(lit);
  std::erase_if(texels, [](const Texel& texel) { return texel.coverage < kWholeTexel; });
  if (options.texels == 0 || texels.size() <= options.texels) return texels;
  oracle::Random random(options.seed);
  for (std::size_t i = 0; i < options.texels; ++i) {
    const auto left = static_cast<double>(texels.size() - i);
    std::swap(texels[i], texels[i + static_cast<std::size_t>(random.uniform() * left)]);
  }
  texels.resize(options.texels);
  return texels;
}

struct SurfacePoint {
  Reference::Point where;
  oracle::Footprint footprint;
};

/// Points spread evenly over the area of all lit triangles.
std::vector<SurfacePoint> choosePoints(const LitScene& lit, const ReferenceOptions& options) {
  std::vector<double> cumulative;
  double sum = 0.0;
  for (const auto& triangle : lit.scene.triangles) {
    cumulative.push_back(sum += triangle.lightmap_page >= 0 ? oracle::area(triangle) : 0.0);
  }
  oracle::Random random(options.seed + 1);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < options.points && sum > 0.0; ++i) {
    const double target = (static_cast<double>(i) + random.uniform()) / static_cast<double>(options.points) * sum;
    const auto found = std::upper_bound(cumulative.begin(), cumulative.end() - 1, target);
    const auto index = static_cast<std::uint32_t>(found - cumulative.begin());
    const auto& triangle = lit.scene.triangles[index];
    const double root = std::sqrt(random.uniform());
    const double v = random.uniform();
    const auto mix = [&](const auto& c) { return c[0] * (1.0 - root) + c[1] * (root * (1.0 - v)) + c[2] * (root * v); };
    SurfacePoint point{{triangle.lightmap_page, mix(triangle.lightmap_uv), {}}, {}};
    point.footprint = oracle::Footprint::at(mix(triangle.corners), triangle.normal);
    point.footprint.pieces[0].triangle = index;
    if (triangle.double_sided) {
      auto back = point.footprint.pieces[0];
      back.normal = -back.normal;
      point.footprint.pieces.push_back(back);
    }
    points.push_back(std::move(point));
  }
  return points;
}

template <typename Item>
std::vector<oracle::Irradiance> trace(const oracle::PathTracer& tracer, const std::vector<Item>& items,
                                      std::uint32_t samples, std::uint64_t seed) {
  std::vector<oracle::Footprint> footprints;
  footprints.reserve(items.size());
  for (const auto& item : items) footprints.push_back(item.footprint);
  return tracer.irradiance(footprints, {.samples = samples, .seed = seed});
}

/// Puts the exact value in place of every mean. What is buried or covered was found by tracing a few paths.
void makeExact(const glm::dvec3& irradiance, Reference& reference) {
  for (auto& texel : reference.texels) texel.irradiance = {irradiance, {}, texel.irradiance.visible_fraction};
  for (auto& point : reference.points) point.irradiance = {irradiance, {}, point.irradiance.visible_fraction};
  reference.exact = true;
}

}  // namespace

Reference makeReference(const LitScene& lit, const ReferenceOptions& wanted) {
  constexpr std::uint32_t kFewSamples = 64;
  auto options = wanted;
  const auto exact = options.closed_form ? cavityIrradiance(lit.scene) : std::nullopt;
  if (exact) options.texel_samples = options.point_samples = kFewSamples;
  const auto start = std::chrono::steady_clock::now();
  const oracle::PathTracer tracer(lit.scene);
  Reference reference;
  const auto texels = chooseTexels(lit, options);
  const auto texel_means = trace(tracer, texels, options.texel_samples, options.seed + 2);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    const auto& texel = texels[i];
    if (texel_means[i].visible_fraction < kLeastVisible) continue;
    const double area = texel.footprint.area() * texel_means[i].visible_fraction;
    const bool plain = texel_means[i].visible_fraction > kWholeTexel && !texel.two_sided &&
                       texel.least_reflectance >= kLeastReflectance;
    reference.texels.push_back({texel.page, texel.x, texel.y, area, plain, texel_means[i]});
  }
  const auto points = choosePoints(lit, options);
  const auto point_values = trace(tracer, points, options.point_samples, options.seed + 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!(point_values[i].visible_fraction > 0.0)) continue;
    reference.points.push_back({points[i].where.page, points[i].where.uv, point_values[i]});
  }
  if (exact) makeExact(*exact, reference);
  reference.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return reference;
}

oracle::ErrorMetrics measureTexels(const std::vector<Page>& pages, const Reference& reference, TexelChoice choice) {
  std::vector<oracle::Comparison> texels;
  for (const auto& texel : reference.texels) {
    if (choice == TexelChoice::kPlain && !texel.plain) continue;
    if (choice == TexelChoice::kDecided && !texel.decided()) continue;
    texels.push_back({pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y), texel.irradiance.mean_lux,
                      texel.irradiance.standard_error, texel.area});
  }
  return oracle::measureError(texels);
}

Accuracy measure(const LitScene& lit, const Reference& reference) {
  std::vector<oracle::Comparison> points;
  for (const auto& point : reference.points) {
    points.push_back({lit.pages.at(static_cast<std::size_t>(point.page)).bilinear(point.uv), point.irradiance.mean_lux,
                      point.irradiance.standard_error, 1.0});
  }
  return {measureTexels(lit.pages, reference, TexelChoice::kAll), oracle::measureError(points)};
}

double undecidedArea(const Reference& reference) {
  double undecided = 0.0, all = 0.0;
  for (const auto& texel : reference.texels) {
    all += texel.area;
    if (!texel.decided()) undecided += texel.area;
  }
  return all > 0.0 ? undecided / all : 0.0;
}

nlohmann::json toJson(const oracle::ErrorMetrics& metrics) {
  return {{"relative_rms", metrics.solverRms()},
          {"relative_rms_with_noise", metrics.relative_rms},
          {"reference_noise", metrics.reference_noise},
          {"relative_rms_low", metrics.solverRange()[0]},
          {"relative_rms_high", metrics.solverRange()[1]},
          {"mean", metrics.mean},
          {"median", metrics.median},
          {"p99", metrics.p99},
          {"bias", metrics.bias},
          {"count", metrics.count}};
}

}  // namespace radiosity::accuracy
