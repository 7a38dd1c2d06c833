#include "server/gpu/picture/view_sky.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "common/task.h"
#include "server/gpu/picture/view_geometry.h"

namespace radiosity::gpu {

void addSky(ViewPicture& picture, const scene::Camera& camera, const scene::Sky& sky) {
  const int width = picture.image.width, height = picture.image.height;
  const auto half = halfView(camera, width, height);
  // How much the y of a ray through the picture changes from a pixel to the next on its right, and below.
  const double right = 2.0 * half.x * camera.world[0].y / width, down = -2.0 * half.y * camera.world[1].y / height;
  const double first = -camera.world[2].y - 0.5 * ((width - 1) * right + (height - 1) * down);
  // Pixels on the horizon show both parts: edges of surfaces are smooth, too.
  const double step = std::max(std::hypot(right, down), 1e-12);
  for (int y = 0; y < height; ++y) {
    interruptionPoint();
    for (int x = 0; x < width; ++x) {
      const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      if (picture.cover[i] >= 1.0F) continue;
      const double above = std::clamp(0.5 + (first + x * right + y * down) / step, 0.0, 1.0);
      picture.image.pixels[i] += (1.0F - picture.cover[i]) * glm::mix(sky.lower, sky.upper, static_cast<float>(above));
    }
  }
}

}  // namespace radiosity::gpu
