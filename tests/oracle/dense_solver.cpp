#include "tests/oracle/dense_solver.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::oracle {
namespace {

/// Whether any of the polygon lies in front of the plane of `of`, beyond rounding.
bool reachesInFrontOf(const Corners& polygon, const Corners& of, const glm::dvec3& normal) {
  return std::any_of(polygon.begin(), polygon.end(), [&](const glm::dvec3& corner) {
    return glm::dot(normal, corner - of[0]) > 1e-9 * glm::length(corner - of[0]);
  });
}

/// Occluders that are not wholly behind (or in the plane of) either of a pair, nor outside the pair's common bounds.
std::vector<Corners> between(std::span<const DensePatch> patches, std::size_t i, std::size_t j,
                             std::span<const Corners> occluders) {
  const auto ni = unitNormal(patches[i].corners);
  const auto nj = unitNormal(patches[j].corners);
  glm::dvec3 low(patches[i].corners[0]);
  glm::dvec3 high(low);
  for (const auto& corners : {patches[i].corners, patches[j].corners}) {
    for (const auto& corner : corners) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  std::vector<Corners> result;
  for (const auto& corners : occluders) {
    if (!reachesInFrontOf(corners, patches[i].corners, ni) || !reachesInFrontOf(corners, patches[j].corners, nj)) {
      continue;
    }
    bool apart = false;
    for (int axis = 0; axis < 3 && !apart; ++axis) {
      const auto [least, most] = std::minmax_element(
          corners.begin(), corners.end(), [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
      apart = (*least)[axis] > high[axis] || (*most)[axis] < low[axis];
    }
    if (!apart) result.push_back(corners);
  }
  return result;
}

}  // namespace

FormFactorMatrix formFactors(std::span<const DensePatch> patches, std::span<const Corners> occluders,
                             const IntegrationOptions& options) {
  const auto n = patches.size();
  FormFactorMatrix factors(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      if (!reachesInFrontOf(patches[j].corners, patches[i].corners, unitNormal(patches[i].corners)) ||
          !reachesInFrontOf(patches[i].corners, patches[j].corners, unitNormal(patches[j].corners))) {
        continue;
      }
      const auto blocking = between(patches, i, j, occluders);
      const double area_i = area(patches[i].corners);
      const double area_j = area(patches[j].corners);
      // integrating over the smaller one keeps the integrand smooth
      const double exchange = area_i <= area_j
                                  ? area_i * formFactor(patches[i].corners, patches[j].corners, blocking, options)
                                  : area_j * formFactor(patches[j].corners, patches[i].corners, blocking, options);
      factors[i * n + j] = exchange / area_i;
      factors[j * n + i] = exchange / area_j;
    }
  }
  return factors;
}

DenseSolution solveDense(std::span<const DensePatch> patches, const FormFactorMatrix& factors) {
  const auto n = patches.size();
  DenseSolution solution;
  solution.irradiance_lux.assign(n, glm::dvec3(0.0));
  for (const auto& patch : patches) solution.radiosity_lux.push_back(patch.emission_lux);
  for (int sweep = 0; sweep < 100'000; ++sweep) {
    double largest_change = 0.0;
    double largest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      glm::dvec3 h(0.0);
      for (std::size_t j = 0; j < n; ++j) h += factors[i * n + j] * solution.radiosity_lux[j];
      const auto b = patches[i].emission_lux + patches[i].reflectance * h;
      const auto change = glm::abs(b - solution.radiosity_lux[i]);
      largest_change = std::max({largest_change, change.x, change.y, change.z});
      largest = std::max({largest, b.x, b.y, b.z});
      solution.irradiance_lux[i] = h;
      solution.radiosity_lux[i] = b;
    }
    if (largest_change <= 1e-14 * largest) break;
  }
  return solution;
}

std::vector<DensePatch> makePatches(const test_scenes::TestScene& scene, double max_edge_m) {
  std::vector<DensePatch> patches;
  const auto pieces = [max_edge_m](double length) {
    return std::max(1, static_cast<int>(std::ceil(length / max_edge_m - 1e-9)));
  };
  for (const auto& object : scene.objects) {
    for (const auto& polygon : object.polygons) {
      const auto& material = scene.materials[polygon.material];
      const auto& c = polygon.corners;
      const auto add = [&](Corners corners) {
        patches.push_back({std::move(corners), material.reflectance, std::numbers::pi * material.emission_nits});
      };
      if (c.size() != 4) {
        add(c);
        continue;
      }
      const int nu = pieces(std::max(glm::length(c[1] - c[0]), glm::length(c[2] - c[3])));
      const int nv = pieces(std::max(glm::length(c[3] - c[0]), glm::length(c[2] - c[1])));
      const auto at = [&](int iu, int iv) {
        const double u = static_cast<double>(iu) / nu;
        const double v = static_cast<double>(iv) / nv;
        return c[0] * ((1 - u) * (1 - v)) + c[1] * (u * (1 - v)) + c[2] * (u * v) + c[3] * ((1 - u) * v);
      };
      for (int iv = 0; iv < nv; ++iv) {
        for (int iu = 0; iu < nu; ++iu) add({at(iu, iv), at(iu + 1, iv), at(iu + 1, iv + 1), at(iu, iv + 1)});
      }
    }
  }
  return patches;
}

std::vector<Corners> allPolygons(const test_scenes::TestScene& scene) {
  std::vector<Corners> polygons;
  for (const auto& object : scene.objects) {
    for (const auto& polygon : object.polygons) polygons.push_back(polygon.corners);
  }
  return polygons;
}

}  // namespace radiosity::oracle
