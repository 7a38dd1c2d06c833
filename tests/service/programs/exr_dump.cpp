// For the service tests: an EXR's size as text, then its R, G, B as raw little-endian 32-bit floats, row 0 first.
#include <ImathBox.h>
#include <ImfArray.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include <cstdio>
#include <exception>
#include <vector>

int main(int argc, char** argv) try {
  if (argc != 2) return 2;
  Imf::InputFile file(argv[1]);
  const Imath::Box2i window = file.header().dataWindow();
  const int width = window.max.x - window.min.x + 1;
  const int height = window.max.y - window.min.y + 1;
  for (const char* name : {"R", "G", "B"}) {
    const Imf::Channel* channel = file.header().channels().findChannel(name);
    if (channel == nullptr || channel->type != Imf::FLOAT) {
      std::fprintf(stderr, "%s: channel %s is missing or not 32-bit float\n", argv[1], name);
      return 1;
    }
  }
  std::vector<float> pixels(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  constexpr std::size_t kPixelBytes = 3 * sizeof(float);
  const std::size_t row_bytes = kPixelBytes * static_cast<std::size_t>(width);
  Imf::FrameBuffer frame;
  for (int c = 0; c < 3; ++c) {
    frame.insert(c == 0   ? "R"
                 : c == 1 ? "G"
                          : "B",
                 Imf::Slice::Make(Imf::FLOAT, pixels.data() + c, window, kPixelBytes, row_bytes));
  }
  file.setFrameBuffer(frame);
  file.readPixels(window.min.y, window.max.y);
  std::printf("%d %d\n", width, height);
  std::fwrite(pixels.data(), sizeof(float), pixels.size(), stdout);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
