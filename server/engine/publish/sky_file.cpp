#include "server/engine/publish/sky_file.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <optional>
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
  for (int c = 0; c < 3; ++c) to.push_back(static_cast<std::uint8_t>(std::min(255.0F, std::round(nits[c] * scale))));
  to.push_back(static_cast<std::uint8_t>(is_dark ? 0 : exponent + 128));
}

constexpr double kColumn = 2.0 * kPi / static_cast<double>(kWidth), kRow = kPi / static_cast<double>(kHeight);

/// Of the middle of a texel.
glm::dvec3 directionOf(std::size_t x, std::size_t y) {
  const double polar = (static_cast<double>(y) + 0.5) * kRow, azimuth = (static_cast<double>(x) + 0.5) * kColumn - kPi;
  return {std::sin(polar) * std::cos(azimuth), std::cos(polar), std::sin(polar) * std::sin(azimuth)};
}

/// The sun as the texels show it whose middles lie in it, or in a disc as wide as one and a half.
class DrawnSun {
 public:
  explicit DrawnSun(const scene::SkySun& sun)
      : direction_(sun.direction), least_(std::cos(std::max(0.5 * sun.diameter_rad, 0.75 * kRow))) {
    double arrives = 0.0;  // for a radiance of 1
    for (std::size_t y = 0; y < kHeight; ++y) {
      const double solid_angle =
          kColumn * (std::cos(static_cast<double>(y) * kRow) - std::cos(static_cast<double>(y + 1) * kRow));
      for (std::size_t x = 0; x < kWidth; ++x)
        if (const double cosine = glm::dot(directionOf(x, y), direction_); cosine >= least_)
          arrives += solid_angle * cosine;
    }
    if (arrives > 0.0) radiance_ = sun.illuminance / static_cast<float>(arrives);
  }
  [[nodiscard]] glm::vec3 at(const glm::dvec3& direction) const {
    return glm::dot(direction, direction_) >= least_ ? radiance_ : glm::vec3(0.0F);
  }

 private:
  glm::dvec3 direction_;
  double least_;
  glm::vec3 radiance_{0.0F};
};

}  // namespace

Bytes hdrOfSky(const scene::Sky& sky) {
  const std::string head =
      "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(kHeight) + " +X " + std::to_string(kWidth) + "\n";
  Bytes bytes(head.begin(), head.end());
  bytes.reserve(bytes.size() + 4 * kWidth * kHeight);
  const double c = std::cos(sky.turn_rad), s = std::sin(sky.turn_rad);
  std::optional<DrawnSun> sun;
  if (sky.sun) sun.emplace(*sky.sun);
  for (std::size_t y = 0; y < kHeight; ++y) {
    interruptionPoint();
    for (std::size_t x = 0; x < kWidth; ++x) {
      const auto d = directionOf(x, y);
      auto nits = d.y > 0.0 ? sky.upper : sky.lower;
      if (sky.picture) nits += sky.strength * sky.picture->radiance({c * d.x - s * d.z, d.y, s * d.x + c * d.z});
      if (sun) nits += sun->at(d);
      append(bytes, nits);
    }
  }
  return bytes;
}

}  // namespace radiosity::engine
