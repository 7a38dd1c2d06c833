// How images are best made in a context. Plain values, any thread.
#pragma once

#include "server/gpu/egl_context.h"

namespace radiosity::gpu {

/// What is fast where the driver draws with the processor is slow with a card, and the other way round.
enum class Drawing {
  kByProcessor,  ///< what may be seen, into images that fit its caches
  kByCard,       ///< everything, into as many images as fill it
};

[[nodiscard]] inline Drawing drawingOf(const EglContext& context) {
  return context.software() ? Drawing::kByProcessor : Drawing::kByCard;
}

}  // namespace radiosity::gpu
