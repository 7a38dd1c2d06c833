// Textures as linear light at any footprint: mean-preserving mip levels. Used while a scene is shaded; plain values.
#pragma once

#include <cstdint>
#include <glm/mat2x2.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/scene.h"

namespace radiosity::scene {

/// Refers to the texture, which must outlive it.
class TexturePyramid {
 public:
  explicit TexturePyramid(const Texture& texture);

  /// Linear RGB around `uv` (after TextureUse's transform and wrapping), averaged over about `footprint` (in UV units).
  [[nodiscard]] glm::vec3 sample(const TextureUse& use, const glm::vec2& uv, const glm::vec2& footprint) const;

 private:
  struct Level {
    int width, height;
    std::vector<glm::vec3> pixels;
  };
  [[nodiscard]] glm::vec3 pixel(std::size_t level, int x, int y) const;
  [[nodiscard]] glm::vec3 bilinear(std::size_t level, const TextureUse& use, const glm::vec2& uv) const;
  [[nodiscard]] int widthOf(std::size_t level) const { return level == 0 ? texture_->width : levels_[level - 1].width; }
  [[nodiscard]] int heightOf(std::size_t level) const {
    return level == 0 ? texture_->height : levels_[level - 1].height;
  }

  const Texture* texture_;
  std::vector<Level> levels_;  ///< from level 1; level 0 stays 8-bit
};

/// uv -> offset + rotate(scale * uv), KHR_texture_transform.
[[nodiscard]] glm::vec2 transformUv(const TextureUse& use, const glm::vec2& uv);

/// Alpha of a texture. Refers to it, and to its use.
class AlphaTexture {
 public:
  AlphaTexture(const Texture& texture, const TextureUse& use);

  /// Around `uv` (after TextureUse's transform and wrapping), bilinear, in [0, 1]; 1 where it has no pixels.
  [[nodiscard]] float at(const glm::vec2& uv) const;

 private:
  const Texture& texture_;
  const TextureUse& use_;
  bool has_pixels_;
  glm::mat2 turn_;  ///< after which comes TextureUse::offset
};

}  // namespace radiosity::scene
