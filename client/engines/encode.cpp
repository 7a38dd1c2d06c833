#include "client/engines/encode.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <half.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <glm/common.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/exr_stream.h"

namespace radiosity::engines {
namespace {

using HalfPixel = std::array<half, 4>;  // R, G, B, 1

glm::vec3 sane(const glm::vec3& value) {
  const auto channel = [](float v) { return v > 0.0F && std::isfinite(v) ? v : 0.0F; };
  return {channel(value.r), channel(value.g), channel(value.b)};
}

void count(EncodedPage& into, const glm::vec3& value, const glm::vec3& stored) {
  for (int c = 0; c < 3; ++c) {
    const double loss = double{stored[c]} * into.unit - double{value[c]};
    into.square_loss += loss * loss;
    into.square += double{value[c]} * double{value[c]};
  }
}

std::vector<HalfPixel> toHalves(const Image& page, EncodedPage& into) {
  std::vector<HalfPixel> halves;
  halves.reserve(page.pixels.size());
  const auto scale = static_cast<float>(1.0 / into.unit);
  for (const auto& pixel : page.pixels) {
    const auto value = sane(pixel), scaled = glm::min(value * scale, glm::vec3(HALF_MAX));
    halves.push_back({half(scaled.r), half(scaled.g), half(scaled.b), half(1.0F)});
    const auto& stored = halves.back();
    count(into, value, {stored[0], stored[1], stored[2]});
  }
  return halves;
}

Result<Bytes> writeExr(const Image& page, const std::vector<HalfPixel>& halves, Imf::Compression compression) {
  try {
    Imf::Header header(page.width, page.height);
    header.compression() = compression;
    Imf::FrameBuffer frame;
    auto* first = reinterpret_cast<char*>(const_cast<HalfPixel*>(halves.data()));  // it is only read
    for (const auto& [name, place] : {std::pair("R", 0), std::pair("G", 1), std::pair("B", 2)}) {
      header.channels().insert(name, Imf::Channel(Imf::HALF));
      frame.insert(name, Imf::Slice(Imf::HALF, first + place * static_cast<std::ptrdiff_t>(sizeof(half)),
                                    sizeof(HalfPixel), sizeof(HalfPixel) * static_cast<std::size_t>(page.width)));
    }
    ExrStream stream;
    {
      Imf::OutputFile file(stream, header);
      file.setFrameBuffer(frame);
      file.writePixels(page.height);
    }
    return std::move(stream.bytes);
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, std::string("OpenEXR: ") + error.what());
  }
}

/// A DDS header without mip levels: "Programming Guide for DDS", Microsoft. 113 is D3DFMT_A16B16G16R16F, whose channels
/// lie in memory as R, G, B, A.
Bytes writeDds(const Image& page, const std::vector<HalfPixel>& halves) {
  constexpr std::uint32_t kMagic = 0x20534444, kHeaderSize = 124, kFormatSize = 32, kFourCc = 4, kHalves = 113;
  constexpr std::uint32_t kCapsHeightWidthFormatPitch = 0x100F, kTexture = 0x1000;
  constexpr std::size_t kWords = 32;
  std::array<std::uint32_t, kWords> words{};
  words[0] = kMagic;
  words[1] = kHeaderSize;
  words[2] = kCapsHeightWidthFormatPitch;
  words[3] = static_cast<std::uint32_t>(page.height);
  words[4] = static_cast<std::uint32_t>(page.width);
  words[5] = static_cast<std::uint32_t>(sizeof(HalfPixel)) * static_cast<std::uint32_t>(page.width);
  words[19] = kFormatSize;
  words[20] = kFourCc;
  words[21] = kHalves;
  words[27] = kTexture;
  Bytes bytes(sizeof words + halves.size() * sizeof(HalfPixel));
  std::memcpy(bytes.data(), words.data(), sizeof words);
  std::memcpy(bytes.data() + sizeof words, halves.data(), halves.size() * sizeof(HalfPixel));
  return bytes;
}

}  // namespace

double unitFor(float largest) {
  if (!(largest > 0.0F) || !std::isfinite(largest) || (largest >= 1.0F && largest <= HALF_MAX)) return 1.0;
  constexpr int kHalfBits = 15;  // below 2^16, with room for rounding
  int exponent = 0;
  (void)std::frexp(largest, &exponent);
  return std::ldexp(1.0, exponent - kHalfBits);
}

Result<EncodedPage> encodePage(const Image& page, Encoding encoding, double unit) {
  EncodedPage encoded;
  float largest = 0.0F;
  for (const auto& pixel : page.pixels) {
    const auto value = sane(pixel);
    largest = std::max({largest, value.r, value.g, value.b});
  }
  encoded.unit = unit > 0.0 ? unit : unitFor(largest);
  const auto halves = toHalves(page, encoded);
  if (encoding == Encoding::kHalfDds) {
    encoded.bytes = writeDds(page, halves);
    return encoded;
  }
  auto bytes = writeExr(page, halves, encoding == Encoding::kHalfExr ? Imf::ZIP_COMPRESSION : Imf::NO_COMPRESSION);
  if (!bytes) return tl::unexpected(bytes.error());
  encoded.bytes = std::move(*bytes);
  return encoded;
}

}  // namespace radiosity::engines
