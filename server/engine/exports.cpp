#include "server/engine/exports.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <stb_image_write.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <exception>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_inverse.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

namespace radiosity::engine {
namespace {

/// OpenEXR writes into a growing buffer.
class MemoryStream : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("lightmap.exr") {}
  void write(const char* data, int count) override {
    const std::size_t end = position_ + static_cast<std::size_t>(count);
    if (end > bytes.size()) bytes.resize(end);
    std::memcpy(bytes.data() + position_, data, static_cast<std::size_t>(count));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }

  Bytes bytes;

 private:
  std::size_t position_ = 0;
};

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

void appendBytes(void* context, void* data, int size) {
  auto& bytes = *static_cast<Bytes*>(context);
  const auto* first = static_cast<const std::uint8_t*>(data);
  bytes.insert(bytes.end(), first, first + size);
}

/// Looks at the middle of the scene from outside, a little from above; back faces are not drawn, so one sees into a
/// room.
scene::Camera framingCamera(const scene::Scene& scene) {
  glm::dvec3 low(std::numeric_limits<double>::max()), high(std::numeric_limits<double>::lowest());
  for (const auto& instance : scene.instances) {
    if (!instance.visible) continue;
    for (const auto& p : scene.primitives[instance.primitive].positions) {
      const glm::dvec3 world(instance.world * glm::dvec4(p, 1.0));
      low = glm::min(low, world);
      high = glm::max(high, world);
    }
  }
  if (low.x > high.x) low = glm::dvec3(-1.0), high = glm::dvec3(1.0);
  scene::Camera camera;
  const glm::dvec3 middle = 0.5 * (low + high), direction = glm::normalize(glm::dvec3(0.55, 0.45, 1.0));
  const double radius = std::max(0.5 * glm::length(high - low), 1e-6);
  const glm::dvec3 eye = middle + direction * (radius / std::tan(0.5 * camera.yfov_rad) * 1.05);
  camera.name = "framed";
  camera.world = glm::inverse(glm::lookAt(eye, middle, glm::dvec3(0.0, 1.0, 0.0)));
  camera.znear = radius * 1e-3;
  return camera;
}

}  // namespace

Result<Bytes> encodeExr(const Image& irradiance) {
  try {
    Imf::Header header(irradiance.width, irradiance.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    header.insert("unit", Imf::StringAttribute("irradiance, lux"));
    Imf::FrameBuffer frame;
    const auto* base = reinterpret_cast<const char*>(irradiance.pixels.data());
    const std::size_t stride = sizeof(glm::vec3);
    const char* names[] = {"R", "G", "B"};
    for (std::size_t c = 0; c < 3; ++c) {
      header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
      frame.insert(names[c], Imf::Slice(Imf::FLOAT, const_cast<char*>(base + c * sizeof(float)), stride,
                                        stride * static_cast<std::size_t>(irradiance.width)));
    }
    MemoryStream stream;
    {
      Imf::OutputFile file(stream, header);
      file.setFrameBuffer(frame);
      file.writePixels(irradiance.height);
    }
    return std::move(stream.bytes);
  } catch (const std::exception& e) {
    return fail(ErrorCode::kInternal, std::string("OpenEXR: ") + e.what());
  }
}

Result<Bytes> encodePng(const Image& display) {
  std::vector<std::uint8_t> rgb(display.pixels.size() * 3);
  for (std::size_t i = 0; i < display.pixels.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      rgb[3 * i + static_cast<std::size_t>(c)] =
          static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(display.pixels[i][c], 0.0F, 1.0F)));
    }
  }
  Bytes bytes;
  if (stbi_write_png_to_func(appendBytes, &bytes, display.width, display.height, 3, rgb.data(), display.width * 3) ==
      0) {
    return fail(ErrorCode::kInternal, "the PNG encoder ran out of memory");
  }
  return bytes;
}

float autoExposure(const Image& radiance) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& pixel : radiance.pixels) {
    const double luminance = 0.2126 * static_cast<double>(pixel.r) + 0.7152 * static_cast<double>(pixel.g) +
                             0.0722 * static_cast<double>(pixel.b);
    if (luminance <= 0.0) continue;
    sum += std::log(luminance);
    ++count;
  }
  return count == 0 ? 1.0F : static_cast<float>(0.18 / std::exp(sum / static_cast<double>(count)));
}

Image toneMap(const Image& radiance, float exposure) {
  Image display(radiance.width, radiance.height);
  std::transform(radiance.pixels.begin(), radiance.pixels.end(), display.pixels.begin(),
                 [exposure](const glm::vec3& pixel) {
                   const glm::vec3 mapped = neutralCurve(glm::max(pixel, glm::vec3(0.0F)) * exposure);
                   return glm::vec3(encodeSrgb(mapped.r), encodeSrgb(mapped.g), encodeSrgb(mapped.b));
                 });
  return display;
}

Result<scene::Camera> chooseCamera(const scene::Scene& scene, const std::string& wanted) {
  if (wanted.empty()) return scene.cameras.empty() ? framingCamera(scene) : scene.cameras.front();
  for (const auto& camera : scene.cameras) {
    if (camera.name == wanted) return camera;
  }
  std::size_t index = 0;
  const auto parsed = std::from_chars(wanted.data(), wanted.data() + wanted.size(), index);
  if (parsed.ec == std::errc() && parsed.ptr == wanted.data() + wanted.size() && index < scene.cameras.size()) {
    return scene.cameras[index];
  }
  return fail(ErrorCode::kNotFound,
              "the scene has no camera \"" + wanted + "\" (it has " + std::to_string(scene.cameras.size()) + ")");
}

}  // namespace radiosity::engine
