#include "server/gpu/picture/view_sky.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/task.h"
#include "server/gpu/picture/view_geometry.h"

namespace radiosity::gpu {

namespace {

/// Of its picture and its sun; `direction` of unit length.
glm::vec3 beyond(const scene::Sky& sky, const glm::dvec3& direction) {
  glm::vec3 radiance(0.0F);
  if (sky.picture) {
    const double c = std::cos(sky.turn_rad), s = std::sin(sky.turn_rad);  // turned back
    radiance += sky.strength * sky.picture->radiance(
                                   {c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z});
  }
  if (sky.sun) {
    const double sine = std::sin(0.5 * sky.sun->diameter_rad);
    if (sine > 0.0 && glm::dot(direction, sky.sun->direction) >= std::sqrt(1.0 - sine * sine))
      radiance += sky.sun->illuminance / static_cast<float>(std::numbers::pi * sine * sine);
  }
  return radiance;
}

}  // namespace

glm::vec3 skyRadiance(const scene::Sky& sky, const glm::dvec3& direction) {
  return (direction.y > 0.0 ? sky.upper : sky.lower) + beyond(sky, direction);
}

void addSky(ViewPicture& picture, const scene::Camera& camera, const scene::Sky& sky) {
  const int width = picture.image.width, height = picture.image.height;
  const auto half = halfView(camera, width, height);
  // How much the y of a ray through the picture changes from a pixel to the next on its right, and below.
  const double right = 2.0 * half.x * camera.world[0].y / width, down = -2.0 * half.y * camera.world[1].y / height;
  const double first = -camera.world[2].y - 0.5 * ((width - 1) * right + (height - 1) * down);
  // Pixels on the horizon show both parts: edges of surfaces are smooth, too.
  const double step = std::max(std::hypot(right, down), 1e-12);
  const bool has_more = sky.picture || sky.sun;
  for (int y = 0; y < height; ++y) {
    interruptionPoint();
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      if (picture.cover[i] >= 1.0F) continue;
      const double above = std::clamp(0.5 + (first + x * right + y * down) / step, 0.0, 1.0);
      auto radiance = glm::mix(sky.lower, sky.upper, static_cast<float>(above));
      if (has_more) {
        const double u = (2.0 * (x + 0.5) / width - 1.0) * half.x, v = (1.0 - 2.0 * (y + 0.5) / height) * half.y;
        radiance += beyond(sky, glm::normalize(u * glm::dvec3(camera.world[0]) + v * glm::dvec3(camera.world[1]) -
                                               glm::dvec3(camera.world[2])));
      }
      picture.image.pixels[i] += (1.0F - picture.cover[i]) * radiance;
    }
  }
}

}  // namespace radiosity::gpu
