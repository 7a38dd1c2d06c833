#include "server/engine/publish/exports.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <glm/common.hpp>
#include <string>
#include <vector>

#include "common/exr_stream.h"
#include "common/parallel.h"
#include "common/task.h"
#include "server/scene/document/png.h"

namespace radiosity::engine {
namespace {

/// That are compressed between two interruption points: whole blocks of 16, as ZIP_COMPRESSION has them.
constexpr int kExrRows = 64;
constexpr std::size_t kPixelsAThread = 20'000;

/// Khronos PBR Neutral tone mapper (specification of 2024), for linear sRGB.
glm::vec3 neutralCurve(glm::vec3 color) {
  constexpr float kStart = 0.8F - 0.04F, kDesaturation = 0.15F;
  const float x = std::min({color.r, color.g, color.b});
  color -= x < 0.08F ? x - 6.25F * x * x : 0.04F;
  const float peak = std::max({color.r, color.g, color.b});
  if (peak < kStart) return color;
  const float d = 1.0F - kStart;
  const float new_peak = 1.0F - d * d / (peak + d - kStart);
  color *= new_peak / peak;
  const float g = 1.0F - 1.0F / (kDesaturation * (peak - new_peak) + 1.0F);
  return glm::mix(color, glm::vec3(new_peak), g);
}

float encodeSrgb(float linear) {
  const float v = std::clamp(linear, 0.0F, 1.0F);
  return v <= 0.0031308F ? 12.92F * v : 1.055F * std::pow(v, 1.0F / 2.4F) - 0.055F;
}

const char* unitOf(Quantity quantity) {
  switch (quantity) {
    case Quantity::kIrradiance:
      return "irradiance, lux";
    case Quantity::kRadiosity:
      return "radiosity, lm/m^2";
    case Quantity::kError:
      return "standard error of irradiance, lux";
    case Quantity::kPatchId:
      return "patch id, 4294967295 is none";
    case Quantity::kMipLevel:
      return "mip level that shot, 4294967295 is none";
    case Quantity::kUnshot:
      return "unshot radiosity, lm/m^2";
    case Quantity::kNormal:
      return "normal, (n + 1) / 2";
  }
  return "";
}

struct ExrChannel {
  const char* name;
  Imf::PixelType type;
  const char* first;
  std::size_t stride;  ///< bytes from a pixel to the next
};

Result<Bytes> writeExr(int width, int height, Quantity quantity, const std::vector<ExrChannel>& channels) {
  try {
    Imf::Header header(width, height);
    header.compression() = Imf::ZIP_COMPRESSION;
    header.insert("unit", Imf::StringAttribute(unitOf(quantity)));
    Imf::FrameBuffer frame;
    for (const auto& channel : channels) {
      header.channels().insert(channel.name, Imf::Channel(channel.type));
      frame.insert(channel.name, Imf::Slice(channel.type, const_cast<char*>(channel.first), channel.stride,
                                            channel.stride * static_cast<std::size_t>(width)));
    }
    ExrStream stream;
    {
      Imf::OutputFile file(stream, header);
      file.setFrameBuffer(frame);
      for (int row = 0; row < height; row += kExrRows) {
        interruptionPoint();
        file.writePixels(std::min(kExrRows, height - row));
      }
    }
    return std::move(stream.bytes);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& e) {
    return fail(ErrorCode::kInternal, std::string("OpenEXR: ") + e.what());
  }
}

}  // namespace

Result<Bytes> encodeExr(const Image& values, Quantity quantity) {
  const auto* base = reinterpret_cast<const char*>(values.pixels.data());
  return writeExr(values.width, values.height, quantity,
                  {{"R", Imf::FLOAT, base, sizeof(glm::vec3)},
                   {"G", Imf::FLOAT, base + sizeof(float), sizeof(glm::vec3)},
                   {"B", Imf::FLOAT, base + 2 * sizeof(float), sizeof(glm::vec3)}});
}

Result<Bytes> encodeExr(const IdImage& ids, Quantity quantity) {
  return writeExr(ids.width, ids.height, quantity,
                  {{"Y", Imf::UINT, reinterpret_cast<const char*>(ids.ids.data()), sizeof(std::uint32_t)}});
}

Image dithered(Image display) {
  // Bayer's order: the bits of x ^ y and y in turn, the lowest first.
  const auto orderAt = [](std::uint32_t x, std::uint32_t y) {
    std::uint32_t order = 0;
    for (std::uint32_t bit = 0; bit < 3; ++bit) order = order << 2U | (((x ^ y) >> bit & 1U) << 1U) | (y >> bit & 1U);
    return order;
  };
  for (int row = 0; row < display.height; ++row) {
    interruptionPoint();
    for (int column = 0; column < display.width; ++column) {
      const auto order = orderAt(static_cast<std::uint32_t>(column) % 8, static_cast<std::uint32_t>(row) % 8);
      const float move = ((static_cast<float>(order) + 0.5F) / 64.0F - 0.5F) / 255.0F;
      display.at(column, row) += move;
    }
  }
  return display;
}

Bytes encodePng(const Image& display) {
  std::vector<std::uint8_t> rgb(display.pixels.size() * 3);
  for (std::size_t i = 0; i < display.pixels.size(); ++i) {
    interruptionPoint();
    for (int c = 0; c < 3; ++c) {
      rgb[3 * i + static_cast<std::size_t>(c)] =
          static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(display.pixels[i][c], 0.0F, 1.0F)));
    }
  }
  return scene::encodePng(display.width, display.height, 3, rgb);
}

Image toneMap(const Image& radiance, float exposure) {
  constexpr float kMost = 1e30F;  // white, and no number that overflows on the way
  Image display(radiance.width, radiance.height);
  const auto width = static_cast<std::size_t>(radiance.width);
  const auto mapRow = [&](std::size_t row) {
    const auto first = radiance.pixels.begin() + static_cast<std::ptrdiff_t>(row * width);
    std::transform(first, first + radiance.width, display.pixels.begin() + static_cast<std::ptrdiff_t>(row * width),
                   [exposure](const glm::vec3& pixel) {
                     const glm::vec3 mapped =
                         neutralCurve(glm::clamp(pixel * exposure, glm::vec3(0.0F), glm::vec3(kMost)));
                     return glm::vec3(encodeSrgb(mapped.r), encodeSrgb(mapped.g), encodeSrgb(mapped.b));
                   });
  };
  inTurns(static_cast<std::size_t>(radiance.height), mapRow, radiance.pixels.size() / kPixelsAThread);
  return display;
}

}  // namespace radiosity::engine
