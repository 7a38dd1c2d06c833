#include "tests/oracle/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>

namespace radiosity::oracle {
namespace {

/// Of the sRGB standard, IEC 61966-2-1.
double toLinear(double value) { return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4); }

const std::array<double, 256>& linearOfByte() {
  static const auto table = [] {
    std::array<double, 256> made{};
    for (std::size_t i = 0; i < made.size(); ++i) made[i] = toLinear(static_cast<double>(i) / 255.0);
    return made;
  }();
  return table;
}

int wrapped(double index, int size, Texture::Wrap wrap) {
  if (!std::isfinite(index)) return 0;
  if (wrap == Texture::Wrap::kClamp) return static_cast<int>(std::clamp(index, 0.0, size - 1.0));
  const double period = wrap == Texture::Wrap::kMirror ? 2.0 * size : size;
  const double within = std::clamp(index - period * std::floor(index / period), 0.0, period - 1.0);
  return static_cast<int>(within < size ? within : period - 1.0 - within);
}

template <typename Decode>
glm::dvec4 lookUp(const Texture& texture, const glm::dvec2& uv, Decode decode) {
  const auto& image = *texture.image;
  const auto pixel = [&](double x, double y) {
    const auto column = static_cast<std::size_t>(wrapped(x, image.width, texture.wrap_u));
    const auto row = static_cast<std::size_t>(wrapped(y, image.height, texture.wrap_v));
    return decode(&image.rgba[4 * (row * static_cast<std::size_t>(image.width) + column)]);
  };
  const glm::dvec2 place = uv * glm::dvec2(image.width, image.height);
  if (texture.nearest) return pixel(std::floor(place.x), std::floor(place.y));
  const auto corner = glm::floor(place - 0.5);
  const auto t = place - 0.5 - corner;
  return glm::mix(glm::mix(pixel(corner.x, corner.y), pixel(corner.x + 1.0, corner.y), t.x),
                  glm::mix(pixel(corner.x, corner.y + 1.0), pixel(corner.x + 1.0, corner.y + 1.0), t.x), t.y);
}

}  // namespace

glm::dvec4 Texture::colour(const glm::dvec2& uv) const {
  const auto& linear = linearOfByte();
  return lookUp(*this, uv, [&linear](const std::uint8_t* p) {
    return glm::dvec4(linear[p[0]], linear[p[1]], linear[p[2]], p[3] / 255.0);
  });
}

glm::dvec4 Texture::value(const glm::dvec2& uv) const {
  return lookUp(*this, uv, [](const std::uint8_t* p) { return glm::dvec4(p[0], p[1], p[2], p[3]) / 255.0; });
}

}  // namespace radiosity::oracle
