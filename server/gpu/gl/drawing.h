// How images are best made in a context. Plain values, any thread.
#pragma once

#include <cstddef>

#include "server/gpu/gl/egl_context.h"

namespace radiosity::gpu {

/// What is fast where the driver draws with the processor is slow with a card, and the other way round.
enum class Drawing {
  kByProcessor,  ///< what may be seen, into images that fit its caches
  kByCard,       ///< everything, into as many images as fill it
};

/// A card is asked for so many triangles at once at most: systems end work that keeps one busy for seconds.
inline constexpr std::size_t kCardTriangles = std::size_t{1} << 26U;

[[nodiscard]] inline Drawing drawingOf(const EglContext& context) {
  return context.software() ? Drawing::kByProcessor : Drawing::kByCard;
}

}  // namespace radiosity::gpu
