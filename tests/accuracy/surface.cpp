#include "tests/accuracy/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tests/oracle/random.h"
#include "tests/oracle/shading.h"
#include "tests/oracle/surface_finder.h"

namespace radiosity::accuracy {
namespace {

constexpr double kDark = 0.01, kLit = 0.05;  // of the mean

double grey(const glm::dvec3& rgb) { return (rgb.x + rgb.y + rgb.z) / 3.0; }

bool isFinite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Piece of no area at a random place of the triangle.
oracle::Footprint::Piece placeOn(const oracle::Triangle& triangle, bool back, oracle::Random& random) {
  const double root = std::sqrt(random.uniform()), v = random.uniform();
  const auto mix = [&](const std::array<glm::dvec3, 3>& c) {
    return c[0] * (1.0 - root) + c[1] * (root * (1.0 - v)) + c[2] * (root * v);
  };
  const double sign = back ? -1.0 : 1.0;
  const auto position = mix(triangle.corners), shading = sign * mix(triangle.shading);
  return {{position, position, position}, sign * triangle.normal, oracle::kNoTriangle, {shading, shading, shading}};
}

/// As a shader that draws the triangle does it; nothing where the file has no texels.
class Lookup {
 public:
  explicit Lookup(const LitScene& lit) : lit_(lit), finder_(lit.scene) {}

  [[nodiscard]] std::optional<glm::dvec3> at(const SurfacePoint& point) const {
    const auto hit = finder_.find(point.position, point.normal);
    if (!hit) return std::nullopt;
    const auto& triangle = lit_.scene.triangles[hit->triangle];
    // A back is drawn where the file says so, with what there is for the front.
    if (triangle.lightmap_page < 0 || (hit->back && !triangle.double_sided)) return std::nullopt;
    const auto& uv = triangle.lightmap_uv;
    const auto place = uv[0] * (1.0 - hit->u - hit->v) + uv[1] * hit->u + uv[2] * hit->v;
    return lit_.pages.at(static_cast<std::size_t>(triangle.lightmap_page)).bilinear(place);
  }

 private:
  const LitScene& lit_;
  oracle::SurfaceFinder finder_;
};

/// Sums over points until the figures are made of them.
struct Sums {
  double square = 0.0, noise = 0.0, value = 0.0, truth = 0.0;
  std::vector<double> relative;

  void add(double found, const oracle::Irradiance& irradiance) {
    const double expected = grey(irradiance.mean_lux);
    square += (found - expected) * (found - expected);
    noise += std::pow(grey(irradiance.standard_error), 2.0);
    value += found;
    truth += expected;
    if (expected > 0.0) relative.push_back(std::abs(found - expected) / expected);
  }

  void finish(SurfaceError& error) {
    if (relative.empty()) return;
    const auto count = static_cast<double>(error.compared);
    std::sort(relative.begin(), relative.end());
    const auto quantile = [&](std::size_t percent) { return relative[relative.size() * percent / 100]; };
    error.rms_with_noise = std::sqrt(square / count) / (truth / count);
    error.reference_noise = std::sqrt(noise / count) / (truth / count);
    error.median = quantile(50);
    error.p95 = quantile(95);
    error.p99 = quantile(99);
    error.mean_ratio = value / truth;
  }
};

}  // namespace

oracle::Footprint turnedOver(oracle::Footprint footprint) {
  for (auto& piece : footprint.pieces) {
    piece.normal = -piece.normal;
    for (auto& corner : piece.shading) corner = -corner;
  }
  return footprint;
}

oracle::Irradiance shownThrough(const oracle::Shading& shading, const oracle::Triangle& triangle,
                                const glm::dvec3& position, const oracle::Irradiance& own,
                                const oracle::Irradiance& beyond) {
  const auto [u, v] = oracle::Shading::weights(triangle, position);
  const auto base = shading.baseReflectance(triangle, u, v);
  const auto of_own = shading.reflectance(triangle, u, v) / base;
  const auto of_beyond = shading.transmittance(triangle, u, v) / base;
  auto shown = own;
  shown.mean_lux = of_own * own.mean_lux + of_beyond * beyond.mean_lux;
  const auto a = of_own * own.standard_error, b = of_beyond * beyond.standard_error;
  shown.standard_error = glm::sqrt(a * a + b * b);
  return shown;
}

std::vector<SurfacePoint> makePoints(const oracle::TriangleScene& scene, std::size_t count, std::uint32_t samples,
                                     std::uint64_t seed) {
  std::vector<double> cumulative;
  double sum = 0.0;
  for (const auto& triangle : scene.triangles) cumulative.push_back(sum += oracle::area(triangle));
  oracle::Random random(seed);
  std::vector<oracle::Footprint> footprints, beyond;
  std::vector<std::size_t> on;  // by point: its triangle
  for (std::size_t i = 0; i < count && sum > 0.0; ++i) {
    const double target = (static_cast<double>(i) + random.uniform()) / static_cast<double>(count) * sum;
    const auto found = std::upper_bound(cumulative.begin(), cumulative.end() - 1, target);
    const auto& triangle = scene.triangles[static_cast<std::size_t>(found - cumulative.begin())];
    footprints.push_back({{placeOn(triangle, oracle::hasTwoSides(triangle) && i % 2 == 1, random)}});
    on.push_back(static_cast<std::size_t>(&triangle - scene.triangles.data()));
    beyond.emplace_back();
    if (triangle.diffuse_transmission > 0.0) beyond.back() = turnedOver(footprints.back());
  }
  const oracle::PathTracer tracer(scene);
  const auto traced = tracer.irradiance(footprints, {.samples = samples, .seed = seed + 1, .leave_out_buried = false});
  const auto behind = tracer.irradiance(beyond, {.samples = samples, .seed = seed + 2, .leave_out_buried = false});
  const oracle::Shading shading(scene);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < footprints.size(); ++i) {
    const auto& piece = footprints[i].pieces.front();
    points.push_back({piece.corners[0], piece.normal, traced[i]});
    if (!beyond[i].pieces.empty())
      points.back().irradiance = shownThrough(shading, scene.triangles[on[i]], piece.corners[0], traced[i], behind[i]);
  }
  return points;
}

double SurfaceError::rms() const {
  return std::sqrt(std::max(0.0, rms_with_noise * rms_with_noise - reference_noise * reference_noise));
}

double SurfaceError::share(std::size_t count) const {
  return points == 0 ? 0.0 : static_cast<double>(count) / static_cast<double>(points);
}

SurfaceComparison compareSurface(const LitScene& lit, std::span<const SurfacePoint> points) {
  const Lookup lookup(lit);
  double mean = 0.0;
  for (const auto& point : points) mean += grey(point.irradiance.mean_lux) / static_cast<double>(points.size());
  SurfaceError error;
  error.points = points.size();
  Sums sums;
  std::vector<oracle::Comparison> seen;
  for (const auto& point : points) {
    if (point.cutOut() || point.buried()) {
      ++(point.cutOut() ? error.cut_out : error.buried);
      continue;
    }
    const auto found = lookup.at(point);
    const bool dark = grey(point.irradiance.mean_lux) < kDark * mean;
    if (!found || !isFinite(*found)) {
      ++(found ? error.not_finite : error.missed);
      error.missed_lit += found || dark ? 0U : 1U;
      continue;
    }
    seen.push_back({*found, point.irradiance.mean_lux, point.irradiance.standard_error, 1.0});
    if (dark) {
      const bool leak = grey(*found) > kLit * mean;
      ++error.dark;
      error.leaks += leak ? 1U : 0U;
      error.open_leaks += leak && point.irradiance.open_fraction > kDark ? 1U : 0U;
      continue;
    }
    ++error.compared;
    sums.add(grey(*found), point.irradiance);
  }
  sums.finish(error);
  return {error, oracle::measureError(seen)};
}

nlohmann::json toJson(const SurfaceError& error) {
  return {{"relative_rms", error.rms()},
          {"relative_rms_with_noise", error.rms_with_noise},
          {"reference_noise", error.reference_noise},
          {"median", error.median},
          {"p95", error.p95},
          {"p99", error.p99},
          {"mean_ratio", error.mean_ratio},
          {"points", error.points},
          {"compared", error.compared},
          {"dark", error.dark},
          {"leaks", error.leaks},
          {"open_leaks", error.open_leaks},
          {"buried", error.buried},
          {"cut_out", error.cut_out},
          {"missed", error.missed},
          {"missed_lit", error.missed_lit},
          {"not_finite", error.not_finite}};
}

std::string leftOutText(const SurfaceError& error) {
  std::string text;
  const auto add = [&](const char* name, std::size_t count) {
    if (count == 0) return;
    char part[64];
    std::snprintf(part, sizeof part, "%s%s %.1f %%", text.empty() ? "" : ", ", name, 100.0 * error.share(count));
    text += part;
  };
  add("dark in truth", error.dark);
  add("buried in solids", error.buried);
  add("cut out", error.cut_out);
  add("without texels", error.missed);
  add("of these lit in truth", error.missed_lit);
  add("not a number", error.not_finite);
  return text;
}

}  // namespace radiosity::accuracy
