#include "tests/oracle/sky.h"

#include <stb_image.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

namespace radiosity::oracle {
namespace {

using std::numbers::pi;

glm::dvec3 aboutY(const glm::dvec3& d, double angle) {
  return {std::cos(angle) * d.x + std::sin(angle) * d.z, d.y, std::cos(angle) * d.z - std::sin(angle) * d.x};
}

}  // namespace

std::size_t SkyMap::texelAt(const glm::dvec3& direction) const {
  const auto d = aboutY(direction, -turn_rad);
  const double across = 0.5 + std::atan2(d.z, d.x) / (2.0 * pi), down = std::acos(std::clamp(d.y, -1.0, 1.0)) / pi;
  const auto x = std::min(width - 1, static_cast<std::size_t>(across * static_cast<double>(width)));
  const auto y = std::min(height - 1, static_cast<std::size_t>(down * static_cast<double>(height)));
  return y * width + x;
}

double SkyMap::solidAngle(std::size_t row) const {
  const double step = pi / static_cast<double>(height), top = static_cast<double>(row) * step;
  return 2.0 * pi / static_cast<double>(width) * (std::cos(top) - std::cos(top + step));
}

glm::dvec3 SkyMap::radiance(const glm::dvec3& direction) const { return nits[texelAt(direction)]; }

void SkyMap::prepare() {
  double sum = 0.0;
  cumulative_.clear();
  for (std::size_t i = 0; i < nits.size(); ++i)
    cumulative_.push_back(sum += (nits[i].x + nits[i].y + nits[i].z) * solidAngle(i / width));
}

double SkyMap::density(const glm::dvec3& direction) const {
  const auto i = texelAt(direction);
  return cumulative_.back() > 0.0 ? (nits[i].x + nits[i].y + nits[i].z) / cumulative_.back() : 0.0;
}

glm::dvec3 SkyMap::draw(double u, double v) const {
  const double target = u * cumulative_.back();
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end() - 1, target);
  const auto i = static_cast<std::size_t>(found - cumulative_.begin());
  const double low = i > 0 ? cumulative_[i - 1] : 0.0;
  const double within = std::clamp((target - low) / std::max(1e-300, cumulative_[i] - low), 0.0, 1.0);
  const double azimuth = (2.0 * (static_cast<double>(i % width) + within) / static_cast<double>(width) - 1.0) * pi;
  const double step = pi / static_cast<double>(height), top = static_cast<double>(i / width) * step;
  const double y = std::cos(top) + v * (std::cos(top + step) - std::cos(top)),
               ring = std::sqrt(std::max(0.0, 1.0 - y * y));
  return aboutY({ring * std::cos(azimuth), y, ring * std::sin(azimuth)}, turn_rad);
}

SkyMap readSkyMap(std::span<const char> bytes, double strength, double turn_rad) {
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<float, void (*)(void*)> pixels(
      stbi_loadf_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()), static_cast<int>(bytes.size()), &width,
                             &height, &channels, 3),
      stbi_image_free);
  if (!pixels ||
      stbi_is_hdr_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()), static_cast<int>(bytes.size())) == 0)
    throw std::runtime_error("the picture of the sky is no HDR file");
  SkyMap map;
  map.width = static_cast<std::size_t>(width);
  map.height = static_cast<std::size_t>(height);
  map.turn_rad = turn_rad;
  for (std::size_t i = 0; i < map.width * map.height; ++i)
    map.nits.push_back(strength * glm::dvec3(pixels.get()[3 * i], pixels.get()[3 * i + 1], pixels.get()[3 * i + 2]));
  return map;
}

}  // namespace radiosity::oracle
