#include "tests/accuracy/compare.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tests/accuracy/closed_form.h"
#include "tests/oracle/random.h"
#include "tests/oracle/shading.h"

namespace radiosity::accuracy {
namespace {

/// Below this visible share a texel is filled from its neighbours, so its own mean says nothing about the solver.
constexpr double kLeastVisible = 0.25;
constexpr double kWholeTexel = 0.999;
/// Dividing reflected light by less than this would amplify rounding.
constexpr double kLeastReflectance = 0.01;

/// Whole ones, drawn at random; `cut_area`: the share of all texels' area that lies in others.
std::vector<Texel> chooseTexels(const LitScene& lit, const ReferenceOptions& options, double& cut_area) {
  auto texels = findTexels(lit);
  double all = 0.0, cut = 0.0;
  for (const auto& texel : texels) {
    const double area = texel.footprint.area();
    all += area;
    if (texel.coverage < kWholeTexel) cut += area;
  }
  cut_area = all > 0.0 ? cut / all : 0.0;
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

/// Irradiance of texels, as lightmaps show it. A texel is translucent if all of it is.
std::vector<oracle::Irradiance> meansOf(const oracle::TriangleScene& scene, const std::vector<Texel>& texels,
                                        const ReferenceOptions& options) {
  const auto isTranslucent = [&](const oracle::Footprint& footprint) {
    return std::ranges::all_of(footprint.pieces, [&](const auto& piece) {
      return piece.triangle < scene.triangles.size() && scene.triangles[piece.triangle].diffuse_transmission > 0.0;
    });
  };
  std::vector<oracle::Footprint> footprints, beyond;
  for (const auto& texel : texels) {
    footprints.push_back(texel.footprint);
    beyond.push_back(isTranslucent(texel.footprint) ? turnedOver(texel.footprint) : oracle::Footprint());
  }
  const oracle::PathTracer tracer(scene);
  auto means = tracer.irradiance(footprints, {.samples = options.texel_samples, .seed = options.seed + 2});
  const auto behind = tracer.irradiance(beyond, {.samples = options.texel_samples, .seed = options.seed + 3});
  const oracle::Shading shading(scene);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    if (beyond[i].pieces.empty()) continue;
    const auto& piece = footprints[i].pieces.front();
    const auto middle = (piece.corners[0] + piece.corners[1] + piece.corners[2]) / 3.0;
    means[i] = shownThrough(shading, scene.triangles[piece.triangle], middle, means[i], behind[i]);
  }
  return means;
}

void addTexels(const LitScene& lit, const ReferenceOptions& options, Reference& reference) {
  const auto texels = chooseTexels(lit, options, reference.cut_area);
  const auto means = meansOf(lit.traced(), texels, options);
  double hidden = 0.0, all = 0.0;
  for (std::size_t i = 0; i < texels.size(); ++i) {
    const auto& texel = texels[i];
    const double whole = texel.footprint.area(), area = whole * means[i].visible_fraction;
    all += whole;
    if (means[i].visible_fraction < kLeastVisible) {
      hidden += whole;
      continue;
    }
    const bool plain =
        means[i].visible_fraction > kWholeTexel && !texel.two_sided && texel.least_reflectance >= kLeastReflectance;
    reference.texels.push_back({texel.page, texel.x, texel.y, texel.back, area, plain, means[i]});
  }
  reference.hidden_area = all > 0.0 ? (1.0 - reference.cut_area) * hidden / all : 0.0;
}

/// Puts the exact value in place of every mean. What is buried or covered was found by tracing a few paths.
void makeExact(const glm::dvec3& irradiance, Reference& reference) {
  const auto set = [&](oracle::Irradiance& mean) {
    mean.mean_lux = irradiance;
    mean.standard_error = glm::dvec3(0.0);
  };
  for (auto& texel : reference.texels) set(texel.irradiance);
  for (auto& point : reference.points) set(point.irradiance);
  reference.exact = true;
}

}  // namespace

Reference makePart(const LitScene& lit, const ReferenceOptions& wanted, ReferencePart part) {
  constexpr std::uint32_t kFewSamples = 64;
  auto options = wanted;
  const auto exact = options.closed_form ? cavityIrradiance(lit.traced()) : std::nullopt;
  if (exact) options.texel_samples = options.point_samples = kFewSamples;
  const auto start = std::chrono::steady_clock::now();
  Reference reference;
  if (part == ReferencePart::kTexels) {
    addTexels(lit, options, reference);
  } else {
    reference.points = makePoints(lit.traced(), options.points, options.point_samples, options.seed + 1);
  }
  if (exact) makeExact(*exact, reference);
  reference.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return reference;
}

Reference join(Reference texels, Reference points) {
  texels.points = std::move(points.points);
  texels.seconds += points.seconds;
  return texels;
}

Reference makeReference(const LitScene& lit, const ReferenceOptions& options) {
  return join(makePart(lit, options, ReferencePart::kTexels), makePart(lit, options, ReferencePart::kPoints));
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
  const auto surface = compareSurface(lit, reference.points);
  return {surface.error, measureTexels(lit.pages, reference, TexelChoice::kAll), surface.total};
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
