// Textures as linear light at any footprint: mean-preserving mip levels. Used while a scene is shaded; plain values.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/mat2x2.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// Whether there are as many pixels as it says, and at least one.
[[nodiscard]] bool hasPixels(const Texture& texture);

/// What bytes stand for, in [0, 1].
struct ByteValues {
  std::array<float, 256> plain, srgb;
};
extern const ByteValues kByteValues;
/// Of four bytes, linear; alpha last.
[[nodiscard]] inline glm::vec4 linearPixel(const std::uint8_t* rgba, bool srgb) {
  const auto& values = srgb ? kByteValues.srgb : kByteValues.plain;
  return {values[rgba[0]], values[rgba[1]], values[rgba[2]], kByteValues.plain[rgba[3]]};
}
/// One pixel of a texture, likewise.
[[nodiscard]] inline glm::vec4 pixelOf(const Texture& texture, int x, int y) {
  const auto index =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(texture.width) + static_cast<std::size_t>(x);
  return linearPixel(&texture.rgba[index * 4], texture.srgb);
}

/// Mip levels of RGB, of which some pixels may count for less than others, or not at all: RGB behind a cut-out says
/// nothing of the surface, so lookups and levels mix pixels by their coverage.
class TexturePyramid {
 public:
  /// RGB of a pixel, linear, and how much it counts, 0 to 1.
  using Pixels = std::function<glm::vec4(int x, int y)>;
  struct Look {
    glm::vec3 rgb;
    float coverage;
  };

  /// Refers to the texture, which must outlive it. All pixels count.
  explicit TexturePyramid(const Texture& texture);
  /// `all_count`: coverage is 1 everywhere.
  TexturePyramid(int width, int height, Pixels pixels, bool all_count);

  [[nodiscard]] std::size_t bytes() const;
  /// RGB around `uv` (after TextureUse's transform and wrapping), averaged over about `footprint` (in UV units), and
  /// the coverage there. Where that is 0, RGB is of the nearest pixels that count, if any.
  [[nodiscard]] Look look(const TextureUse& use, const glm::vec2& uv, const glm::vec2& footprint) const;
  [[nodiscard]] glm::vec3 sample(const TextureUse& use, const glm::vec2& uv, const glm::vec2& footprint) const {
    return look(use, uv, footprint).rgb;
  }

 private:
  struct Level {
    int width, height;
    std::vector<glm::vec4> pixels;  ///< RGB times coverage, and coverage
  };
  [[nodiscard]] glm::vec4 pixel(std::size_t level, int x, int y) const;
  [[nodiscard]] glm::vec4 mixed(std::size_t level, const TextureUse& use, const glm::vec2& uv) const;
  void buildLevels();

  int width_, height_;
  Pixels pixels_;
  bool all_count_;
  std::vector<Level> levels_;  ///< from level 1; level 0 is read from `pixels_`
};

/// uv -> offset + rotate(scale * uv), KHR_texture_transform.
[[nodiscard]] glm::vec2 transformUv(const TextureUse& use, const glm::vec2& uv);

/// A texture at its own resolution. Refers to it, and to its use.
class PlainTexture {
 public:
  PlainTexture(const Texture& texture, const TextureUse& use);

  /// Alpha around `uv` (after TextureUse's transform and wrapping), as it is filtered, in [0, 1]; 1 where it has no
  /// pixels.
  [[nodiscard]] float alphaAt(const glm::vec2& uv) const;
  /// RGB there, linear, each in [0, 1]; 1 where it has no pixels.
  [[nodiscard]] glm::vec3 colourAt(const glm::vec2& uv) const;

 private:
  template <typename Value, typename Pixel>
  [[nodiscard]] Value filtered(const glm::vec2& uv, const Pixel& pixel) const;

  const Texture* texture_;
  const TextureUse* use_;
  bool has_pixels_;
  glm::mat2 turn_;  ///< after which comes TextureUse::offset
};

}  // namespace radiosity::scene
