#include "tests/scenes/hdr_writer.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <stdexcept>
#include <string>

namespace radiosity::test_scenes {
namespace {

void appendPixel(std::string& to, const glm::dvec3& nits) {
  const double largest = std::max({nits.x, nits.y, nits.z});
  int exponent = 0;
  if (largest > 1e-32) std::frexp(largest * 256.0 / 255.5, &exponent);
  const double scale = largest > 1e-32 ? std::ldexp(256.0, -exponent) : 0.0;
  for (int c = 0; c < 3; ++c) to += static_cast<char>(std::min(255L, std::lround(nits[c] * scale)));
  to += static_cast<char>(largest > 1e-32 ? exponent + 128 : 0);
}

}  // namespace

void writeHdr(const std::filesystem::path& file, int width, int height,
              const std::function<glm::dvec3(const glm::dvec3&)>& radiance) {
  std::string pixels;
  for (int y = 0; y < height; ++y) {
    const double polar = (y + 0.5) / height * std::numbers::pi;
    for (int x = 0; x < width; ++x) {
      const double azimuth = (2.0 * (x + 0.5) / width - 1.0) * std::numbers::pi;
      appendPixel(pixels, radiance({std::sin(polar) * std::cos(azimuth), std::cos(polar),
                                    std::sin(polar) * std::sin(azimuth)}));
    }
  }
  std::ofstream out(file, std::ios::binary);
  out << "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " << height << " +X " << width << "\n" << pixels;
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace radiosity::test_scenes
