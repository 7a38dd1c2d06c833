// A plain picture: rows from the top, linear RGB floats. What the numbers mean (lux, display values) is the owner's
// business.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <vector>

#include "common/check.h"

namespace radiosity {

struct Image {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> pixels;  ///< width * height, row-major, first row = row 0

  Image() = default;
  Image(int w, int h, glm::vec3 fill = glm::vec3(0.0F))
      : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {}

  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
  [[nodiscard]] glm::vec3& at(int x, int y) { return pixels[index(x, y)]; }
  [[nodiscard]] const glm::vec3& at(int x, int y) const { return pixels[index(x, y)]; }
};

}  // namespace radiosity
