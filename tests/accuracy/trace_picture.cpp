// trace_picture SCENE.glb OUT: the radiance that a camera sees, by path tracing. OUT gets 32-bit floats, little-endian:
// R, G, B of each pixel in nits, rows from the top; one ray goes through the middle of each pixel.
#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/oracle/path_tracer.h"
#include "tests/oracle/ray_scene.h"
#include "tests/oracle/shading.h"
#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {
namespace {

struct Options {
  std::string scene, output;
  std::vector<double> eye{0.0, 0.0, 0.0}, at{0.0, 0.0, -1.0};
  double yfov_rad = 0.8;
  int width = 320, height = 240;
  std::uint32_t paths = 64;
  std::uint64_t seed = 1;
};

struct Seen {
  std::uint32_t triangle = 0;
  double u = 0.0, v = 0.0;  ///< weights of its second and third corner
  bool back = false;
};

/// What the rays of a picture meet first.
class FirstHits {
 public:
  explicit FirstHits(const TriangleScene& scene) : triangles_(scene.triangles), rays_(scene.triangles) {}

  /// Engines do not draw backs of single-sided triangles: the ray passes.
  [[nodiscard]] std::optional<Seen> along(const glm::dvec3& from, const glm::dvec3& direction) const {
    const auto is_back = [&](std::uint32_t triangle) {
      return glm::dot(direction, triangles_[triangle].normal) >= 0.0;
    };
    const auto met = rays_.first(
        rays_.toUnit(from), direction, std::numeric_limits<double>::infinity(),
        [&](const RayScene::Met& one) { return !is_back(one.triangle) || triangles_[one.triangle].double_sided; });
    if (!met) return std::nullopt;
    return Seen{met->triangle, met->u, met->v, is_back(met->triangle)};
  }

 private:
  const std::vector<Triangle>& triangles_;
  RayScene rays_;
};

/// Directions through the middles of the pixels; +Y is up.
std::vector<glm::dvec3> directions(const Options& options, const glm::dvec3& eye, const glm::dvec3& at) {
  const auto forward = glm::normalize(at - eye);
  const auto right = glm::normalize(glm::cross(forward, glm::dvec3(0.0, 1.0, 0.0)));
  const auto up = glm::cross(right, forward);
  const double half = std::tan(options.yfov_rad / 2.0), pixel = 2.0 * half / options.height;
  std::vector<glm::dvec3> all;
  for (int y = 0; y < options.height; ++y)
    for (int x = 0; x < options.width; ++x)
      all.push_back(glm::normalize(forward + right * ((x + 0.5 - options.width / 2.0) * pixel) +
                                   up * ((options.height / 2.0 - y - 0.5) * pixel)));
  return all;
}

std::vector<float> trace(const TriangleScene& scene, const Options& options) {
  for (const auto& triangle : scene.triangles)
    if (triangle.see_through) throw std::runtime_error("cameras here do not look through anything");
  const glm::dvec3 eye(options.eye[0], options.eye[1], options.eye[2]);
  const auto rays = directions(options, eye, {options.at[0], options.at[1], options.at[2]});
  const FirstHits hits(scene);
  const Shading shading(scene);
  std::vector<glm::dvec3> emitted(rays.size()), reflectance(rays.size(), glm::dvec3(0.0));
  std::vector<Footprint> footprints(rays.size());  // without pieces where nothing reflects
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto seen = hits.along(eye, rays[i]);
    if (!seen) {
      emitted[i] = (rays[i].y > 0.0 ? scene.sky_upper : scene.sky_lower) * std::numbers::pi;
      continue;
    }
    const auto& triangle = scene.triangles[seen->triangle];
    // Of two-sided lamps both sides shine; the backs of others are not seen.
    emitted[i] = shading.emission(triangle, seen->u, seen->v);
    reflectance[i] = shading.reflectance(triangle, seen->u, seen->v);
    const auto& c = triangle.corners;
    const auto place = c[0] * (1.0 - seen->u - seen->v) + c[1] * seen->u + c[2] * seen->v;
    const double side = seen->back ? -1.0 : 1.0;
    footprints[i] = Footprint::at(place, side * triangle.normal);
    const auto& n = triangle.shading;
    const auto normal = n[0] * (1.0 - seen->u - seen->v) + n[1] * seen->u + n[2] * seen->v;
    for (auto& piece : footprints[i].pieces) piece.shading.fill(side * normal);
  }
  const PathOptions how{.samples = options.paths, .seed = options.seed, .threads = 0, .leave_out_buried = false};
  const auto light = PathTracer(scene).irradiance(footprints, how);
  std::vector<float> pixels;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto radiance = (emitted[i] + reflectance[i] * light[i].mean_lux) / std::numbers::pi;
    for (int c = 0; c < 3; ++c) pixels.push_back(static_cast<float>(radiance[c]));
  }
  return pixels;
}

void write(const std::vector<float>& pixels, const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(pixels.data()), static_cast<std::streamsize>(pixels.size() * sizeof(float)));
  if (!out.flush()) throw std::runtime_error(file + " cannot be written");
}

}  // namespace
}  // namespace radiosity::oracle

int main(int argc, char** argv) {
  radiosity::oracle::Options options;
  CLI::App app{"The radiance that a camera sees, by path tracing: R, G, B of each pixel as 32-bit floats, nits"};
  app.add_option("SCENE", options.scene, "the scene: .glb")->required();
  app.add_option("OUT", options.output, "the file to write")->required();
  app.add_option("--eye", options.eye, "where the camera is: X Y Z")->expected(3);
  app.add_option("--at", options.at, "a point that it looks at: X Y Z")->expected(3);
  app.add_option("--yfov", options.yfov_rad, "its vertical field of view, rad")->capture_default_str();
  app.add_option("--width", options.width, "pixels")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--height", options.height, "pixels")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--paths", options.paths, "paths for each pixel, a multiple of 8")->capture_default_str();
  app.add_option("--seed", options.seed, "the same seed gives the same bits")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    const auto scene = radiosity::oracle::readGlb(options.scene);
    for (const auto& warning : scene.warnings) std::fprintf(stderr, "trace_picture: %s\n", warning.c_str());
    radiosity::oracle::write(radiosity::oracle::trace(scene, options), options.output);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "trace_picture: %s\n", error.what());
    return 1;
  }
  return 0;
}
