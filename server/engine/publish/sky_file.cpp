#include "server/engine/publish/sky_file.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>

#include "common/task.h"

namespace radiosity::engine {
namespace {

constexpr std::size_t kWidth = 1024, kHeight = 512;
constexpr double kPi = std::numbers::pi;

/// Ward's shared exponent: eight bits of each channel, to a 256th of the largest.
void append(Bytes& to, const glm::vec3& nits) {
  const float largest = std::max({nits.x, nits.y, nits.z});
  int exponent = 0;
  const bool is_dark = !(largest > 1e-32F);
  if (!is_dark) (void)std::frexp(largest, &exponent);
  const float scale = is_dark ? 0.0F : std::ldexp(256.0F, -exponent);
  for (int c = 0; c < 3; ++c) to.push_back(static_cast<std::uint8_t>(std::min(255.0F, nits[c] * scale)));
  to.push_back(static_cast<std::uint8_t>(is_dark ? 0 : exponent + 128));
}

/// Of a sun over a texel, as if all of it lay there where it is smaller.
glm::vec3 sunAt(const scene::SkySun& sun, const glm::dvec3& direction, double solid_angle) {
  const double angle = std::max(0.5 * sun.diameter_rad, 0.75 * kPi / static_cast<double>(kHeight));
  if (glm::dot(direction, sun.direction) < std::cos(angle)) return glm::vec3(0.0F);
  const double disc = 2.0 * kPi * (1.0 - std::cos(angle));
  return sun.illuminance / static_cast<float>(std::max(disc, solid_angle));
}

}  // namespace

Bytes hdrOfSky(const scene::Sky& sky) {
  const std::string head =
      "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(kHeight) + " +X " + std::to_string(kWidth) + "\n";
  Bytes bytes(head.begin(), head.end());
  bytes.reserve(bytes.size() + 4 * kWidth * kHeight);
  const double c = std::cos(sky.turn_rad), s = std::sin(sky.turn_rad);
  for (std::size_t y = 0; y < kHeight; ++y) {
    interruptionPoint();
    const double polar = (static_cast<double>(y) + 0.5) / static_cast<double>(kHeight) * kPi;
    const double solid_angle = 2.0 * kPi * kPi * std::sin(polar) / static_cast<double>(kWidth * kHeight);
    for (std::size_t x = 0; x < kWidth; ++x) {
      const double azimuth = (2.0 * (static_cast<double>(x) + 0.5) / static_cast<double>(kWidth) - 1.0) * kPi;
      const glm::dvec3 d(std::sin(polar) * std::cos(azimuth), std::cos(polar), std::sin(polar) * std::sin(azimuth));
      auto nits = d.y > 0.0 ? sky.upper : sky.lower;
      if (sky.picture) nits += sky.strength * sky.picture->radiance({c * d.x - s * d.z, d.y, s * d.x + c * d.z});
      if (sky.sun) nits += sunAt(*sky.sun, d, solid_angle);
      append(bytes, nits);
    }
  }
  return bytes;
}

}  // namespace radiosity::engine
