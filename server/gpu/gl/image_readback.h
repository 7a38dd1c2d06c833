// Images on their way to memory of ours: from a card, through memory of the driver's that the processor may read. One
// thread, that of the context.
#pragma once

#include <cstdint>
#include <vector>

#include "server/gpu/gl/drawing.h"
#include "server/gpu/gl/gl_objects.h"

namespace radiosity::gpu {

class ImageReadback {
 public:
  ImageReadback(const EglContext& context, Drawing drawing) : context_(&context), drawing_(drawing) {}

  /// The first layers of an array of 32-bit integers, width x height x layers. Waits for what draws them.
  void read(const Texture& from, std::uint32_t width, std::uint32_t height, std::size_t layers,
            std::vector<std::uint32_t>& into);

 private:
  void makeRoom(std::size_t count);

  const EglContext* context_;
  Drawing drawing_;
  Buffer buffer_;
  std::size_t room_ = 0;                   ///< values
  const std::uint32_t* mapped_ = nullptr;  ///< the buffer's, as long as it lives
};

}  // namespace radiosity::gpu
