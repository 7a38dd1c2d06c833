// A picture of a sky (HDR or EXR): an image of finite numbers, none below 0, or refused with a reason, at a bounded
// cost.
#include "server/scene/import/sky_file.h"
#include "tests/fuzz/cost.h"
#include "tests/fuzz/target.h"

namespace radiosity::fuzz {
namespace {

constexpr double kMostSeconds = 5.0;
constexpr long kMostKilobytes = 256L << 10U;

std::string hdr(const std::string& size, const std::string& pixels) {
  return "#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n" + size + "\n" + pixels;
}

/// One attribute of an EXR's header.
std::string attribute(const std::string& name, const std::string& type, const std::string& value) {
  std::string text = name + '\0' + type + '\0';
  for (unsigned shift = 0; shift < 32; shift += 8) text += static_cast<char>(value.size() >> shift & 0xFFU);
  return text + value;
}

std::string word(std::uint32_t value) {
  std::string text;
  for (unsigned shift = 0; shift < 32; shift += 8) text += static_cast<char>(value >> shift & 0xFFU);
  return text;
}

/// Two pixels of half floats, not compressed; `more`: attributes.
std::string exr(const std::string& more = "") {
  std::string channels;
  for (const char* name : {"B", "G", "R"})
    channels += std::string(name) + '\0' + word(1) + std::string(4, '\0') + word(1) + word(1);
  const auto window = word(0) + word(0) + word(1) + word(0);
  std::string file = "\x76\x2F\x31\x01" + word(2) + attribute("channels", "chlist", channels + '\0') +
                     attribute("compression", "compression", std::string(1, '\0')) + more +
                     attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window) +
                     attribute("lineOrder", "lineOrder", std::string(1, '\0')) +
                     attribute("pixelAspectRatio", "float", std::string("\0\0\x80\x3F", 4)) +
                     attribute("screenWindowCenter", "v2f", std::string(8, '\0')) +
                     attribute("screenWindowWidth", "float", std::string("\0\0\x80\x3F", 4)) + '\0';
  file += word(static_cast<std::uint32_t>(file.size() + 8)) + word(0);
  return file + word(0) + word(12) + std::string("\0\x3C\0\x3C\0\x3C\0\x3C\0\x3C\0\x3C", 12);
}

}  // namespace

std::vector<Seed> seeds() {
  const std::string pixel("\x80\x40\x20\x81", 4);
  std::string row("\x02\x02\x00\x08", 4);
  for (int channel = 0; channel < 3; ++channel) row += std::string("\x88\x50", 2);
  row += std::string("\x04\x80\x81\x82\x83\x84\x80", 7);
  return {seedOf(hdr("-Y 1 +X 2", pixel + pixel)),
          seedOf(hdr("-Y 1 +X 3", pixel + std::string("\x01\x01\x01\x02", 4))),
          seedOf(hdr("-Y 2 +X 8", row + row)),
          seedOf(hdr("-Y 8192 +X 16384", row)),
          seedOf(exr()),
          seedOf(exr(attribute("tiles", "tiledesc", word(64) + word(64) + '\0') +
                     attribute("preview", "preview", word(2) + word(1) + std::string(8, '\0')) +
                     attribute("whiteLuminance", "float", std::string("\0\0\x80\x40", 4))))};
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  const fuzz::Cost cost;
  const auto image = scene::readSkyFile({data, size}, "fuzz.hdr");
  cost.requireAtMost(fuzz::kMostSeconds, fuzz::kMostKilobytes);
  if (!image) {
    fuzz::require(!image.error().message.empty(), "a refusal says why");
    return 0;
  }
  fuzz::require(image->texels.size() == image->width * image->height && !image->texels.empty(), "it has its texels");
  for (const auto& texel : image->texels)
    for (int c = 0; c < 3; ++c)
      fuzz::require(texel[c] >= 0.0F && texel[c] <= 1.001F * scene::kMostSkyNits,
                    "radiance is a number, none negative");
  return 0;
}
