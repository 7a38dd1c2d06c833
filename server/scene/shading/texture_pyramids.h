// The mip levels that materials are shaded with, each made once for all materials that look at the same pictures in the
// same way, and kept as long as there is room. Of one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <list>
#include <memory>

#include "server/scene/values/shade_texture.h"

namespace radiosity::scene {

/// Pictures laid over each other; those that are null are white. They must outlive the pyramid.
struct PictureStack {
  const Texture* colour = nullptr;
  const Texture* metal = nullptr;  ///< takes from the colour, by `metal_factor`
  const Texture* shine = nullptr;  ///< likewise
  const Texture* alpha = nullptr;  ///< says how much a pixel counts; null: all do
  float metal_factor = 0.0F;
  glm::vec3 shine_factor{0.0F};
  /// Of `alpha`: pixels of at least cutoff / factor count, and no others; 0: by their alpha.
  float alpha_factor = 1.0F, alpha_cutoff = 0.0F;
  bool is_mask = false;

  bool operator==(const PictureStack&) const = default;
};

class TexturePyramids {
 public:
  /// `most_pixels`: of all pyramids that are made; of what comes after them a look at few of their pixels is taken.
  explicit TexturePyramids(std::uint64_t most_pixels = std::uint64_t{256} << 20) : most_pixels_(most_pixels) {}

  [[nodiscard]] std::shared_ptr<const TexturePyramid> of(const PictureStack& asked);
  [[nodiscard]] std::size_t made() const { return made_; }
  /// Of those made: of few pixels.
  [[nodiscard]] std::size_t coarse() const { return coarse_; }

 private:
  struct Kept {
    PictureStack stack;
    std::shared_ptr<const TexturePyramid> pyramid;
  };
  void makeRoom();

  std::uint64_t most_pixels_, pixels_ = 0;
  std::size_t made_ = 0, coarse_ = 0, bytes_ = 0;
  std::list<Kept> kept_;  ///< those used last first
};

}  // namespace radiosity::scene
