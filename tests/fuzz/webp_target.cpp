// A picture in WebP: as many texels as its header says, few enough, or refused.
#include <webp/encode.h>

#include "server/scene/document/image_decode.h"
#include "tests/fuzz/cost.h"
#include "tests/fuzz/target.h"

namespace radiosity::fuzz {
namespace {

constexpr double kMostSeconds = 10.0;
constexpr long kMostKilobytes = 256L << 10U;
constexpr std::size_t kMostPixels = std::size_t{1} << 18U;

Seed seedOf(int width, int height, bool lossless, bool flat) {
  Bytes rgba(static_cast<std::size_t>(4 * width * height));
  for (std::size_t i = 0; i < rgba.size(); ++i) rgba[i] = static_cast<std::uint8_t>(flat ? 200 : i * i / 5);
  std::uint8_t* out = nullptr;
  const auto size = lossless ? WebPEncodeLosslessRGBA(rgba.data(), width, height, 4 * width, &out)
                             : WebPEncodeRGBA(rgba.data(), width, height, 4 * width, 60.0F, &out);
  Seed seed(out, out + size);
  WebPFree(out);
  return seed;
}

}  // namespace

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  for (const bool lossless : {true, false})
    for (const bool flat : {true, false}) {
      all.push_back(seedOf(17, 9, lossless, flat));
      all.push_back(seedOf(64, 64, lossless, flat));
    }
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  Bytes bytes(data, data + size);
  if (scene::sniffImageType(bytes) != "image/webp") return 0;
  const fuzz::Cost cost;
  const auto texture = scene::decodeImage(bytes, fuzz::kMostPixels, "fuzz.webp", {true, size % 3U == 0 ? 1U : 0U});
  cost.requireAtMost(fuzz::kMostSeconds, fuzz::kMostKilobytes);
  if (!texture) {
    fuzz::require(!texture.error().message.empty(), "a refusal says why");
    return 0;
  }
  const auto pixels = static_cast<std::size_t>(texture->width) * static_cast<std::size_t>(texture->height);
  fuzz::require(pixels <= fuzz::kMostPixels && texture->rgba.size() == 4 * pixels, "it has the texels that it may");
  return 0;
}
