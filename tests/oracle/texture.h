// Images of materials, looked up as a shader does: filtered and wrapped as the file's sampler says. A value; any
// thread.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <vector>

namespace radiosity::oracle {

/// Decoded: RGBA of 8 bits, row 0 = v 0.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};

/// An image with its sampler.
struct Texture {
  enum class Wrap { kRepeat, kClamp, kMirror };

  std::shared_ptr<const Image> image;
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  bool nearest = false;  ///< magFilter NEAREST; otherwise bilinear, pixels' centres at half integers

  /// RGB turned from sRGB to linear before it is filtered; alpha as stored.
  [[nodiscard]] glm::dvec4 colour(const glm::dvec2& uv) const;
  /// All four channels as stored, in [0, 1].
  [[nodiscard]] glm::dvec4 value(const glm::dvec2& uv) const;
};

}  // namespace radiosity::oracle
