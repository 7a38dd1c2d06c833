#include "server/scene/import/cube_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/packing.hpp>
#include <numbers>
#include <optional>
#include <string_view>

#include "common/task.h"
#include "server/scene/import/sky_file.h"

namespace radiosity::scene {
namespace {

/// Where a direction meets the cube: a face, and on it from -1 to 1, to the right and down.
struct FacePlace {
  std::size_t face = 0;
  double s = 0.0, t = 0.0;
};

FacePlace placeOf(const glm::dvec3& d) {
  const auto size = glm::abs(d);
  if (size.x >= size.y && size.x >= size.z)
    return {d.x > 0.0 ? 0U : 1U, (d.x > 0.0 ? -d.z : d.z) / size.x, -d.y / size.x};
  if (size.y >= size.z) return {d.y > 0.0 ? 2U : 3U, d.x / size.y, (d.y > 0.0 ? d.z : -d.z) / size.y};
  return {d.z > 0.0 ? 4U : 5U, (d.z > 0.0 ? d.x : -d.x) / size.z, -d.y / size.z};
}

constexpr std::size_t kHeader = 80, kLevel = 24;
constexpr std::uint8_t kMagic[12] = {0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n'};

/// How a format of Vulkan lies in memory.
struct Format {
  std::uint32_t number = 0;
  std::size_t bytes = 0;  ///< of a texel
  enum class Kind { kByte, kSrgb, kHalf, kFloat, kShared } kind = Kind::kByte;
};
constexpr Format kFormats[] = {
    {23, 3, Format::Kind::kByte},    {29, 3, Format::Kind::kSrgb},    {37, 4, Format::Kind::kByte},
    {43, 4, Format::Kind::kSrgb},    {90, 6, Format::Kind::kHalf},    {97, 8, Format::Kind::kHalf},
    {106, 12, Format::Kind::kFloat}, {109, 16, Format::Kind::kFloat}, {123, 4, Format::Kind::kShared}};

float linear(float encoded) {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

glm::vec3 texelOf(const std::uint8_t* at, Format::Kind kind) {
  glm::vec3 texel(0.0F);
  if (kind == Format::Kind::kShared) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, at, sizeof(bits));
    return glm::unpackF3x9_E1x5(bits);
  }
  for (int c = 0; c < 3; ++c) {
    if (kind == Format::Kind::kFloat) std::memcpy(&texel[c], at + 4 * c, sizeof(float));
    if (kind == Format::Kind::kHalf) {
      std::uint16_t half = 0;
      std::memcpy(&half, at + 2 * c, sizeof(half));
      texel[c] = glm::unpackHalf1x16(half);
    }
    if (kind == Format::Kind::kByte) texel[c] = static_cast<float>(at[c]) / 255.0F;
    if (kind == Format::Kind::kSrgb) texel[c] = linear(static_cast<float>(at[c]) / 255.0F);
  }
  return texel;
}

/// What the header of a KTX file says.
struct KtxHead {
  std::uint32_t format = 0, type_size = 0, width = 0, height = 0, depth = 0, layers = 0, faces = 0, levels = 0,
                scheme = 0;
  std::uint64_t offset = 0, length = 0;  ///< of the largest level
};

std::optional<KtxHead> headOf(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kHeader + kLevel || !std::equal(std::begin(kMagic), std::end(kMagic), bytes.begin())) return {};
  KtxHead head;
  std::size_t at = sizeof(kMagic);
  for (auto* word : {&head.format, &head.type_size, &head.width, &head.height, &head.depth, &head.layers, &head.faces,
                     &head.levels, &head.scheme}) {
    std::memcpy(word, bytes.data() + at, sizeof(*word));
    at += sizeof(*word);
  }
  std::memcpy(&head.offset, bytes.data() + kHeader, sizeof(head.offset));
  std::memcpy(&head.length, bytes.data() + kHeader + 8, sizeof(head.length));
  return head;
}

}  // namespace

glm::vec3 CubeMap::radiance(const glm::dvec3& direction) const {
  const auto place = placeOf(direction);
  const auto edge = static_cast<double>(size);
  const auto along = [&](double from) { return std::clamp((0.5 * from + 0.5) * edge - 0.5, 0.0, edge - 1.0); };
  const double x = along(place.s), y = along(place.t);
  const auto left = static_cast<std::size_t>(x), top = static_cast<std::size_t>(y);
  const auto right = std::min(left + 1, size - 1), bottom = std::min(top + 1, size - 1);
  const auto across = static_cast<float>(x - static_cast<double>(left)),
             down = static_cast<float>(y - static_cast<double>(top));
  const auto& face = faces[place.face];
  return glm::mix(glm::mix(face[top * size + left], face[top * size + right], across),
                  glm::mix(face[bottom * size + left], face[bottom * size + right], across), down);
}

SkyImage imageOfCube(const CubeMap& cube, const glm::dquat& rotation) {
  constexpr int kSamples = 2;  // each way: an eighth of a face's texel at its corners
  SkyImage image;
  image.width = std::min(4 * cube.size, SkyImageMaker::kMostWidth);
  image.height = std::max<std::size_t>(2, image.width / 2);
  const auto back = glm::conjugate(rotation);
  image.texels.reserve(image.width * image.height);
  for (std::size_t y = 0; y < image.height; ++y) {
    interruptionPoint();
    for (std::size_t x = 0; x < image.width; ++x) {
      glm::vec3 sum(0.0F);
      for (int i = 0; i < kSamples * kSamples; ++i) {
        const double u = (static_cast<double>(x) + (i % kSamples + 0.5) / kSamples) / static_cast<double>(image.width);
        const double v = (static_cast<double>(y) + (i / kSamples + 0.5) / kSamples) / static_cast<double>(image.height);
        const double azimuth = (2.0 * u - 1.0) * std::numbers::pi, polar = v * std::numbers::pi;
        sum += cube.radiance(back * glm::dvec3(std::sin(polar) * std::cos(azimuth), std::cos(polar),
                                               std::sin(polar) * std::sin(azimuth)));
      }
      image.texels.push_back(sum / float{kSamples * kSamples});
    }
  }
  return image;
}

Result<CubeMap> readKtx2Cube(const Bytes& bytes, std::size_t layer, const std::string& where) {
  const auto head = headOf(bytes);
  if (!head) return fail(ErrorCode::kUnsupported, "is no KTX 2.0 file", where);
  if (head->faces != 6 || head->width != head->height || head->depth != 0 || head->width == 0)
    return fail(ErrorCode::kInvalidScene, "is no cubemap", where);
  if (head->width > kMostCubeEdge)
    return fail(
        ErrorCode::kTooLarge,
        "its faces are " + std::to_string(head->width) + " texels wide; the limit is " + std::to_string(kMostCubeEdge),
        where);
  const auto* format = std::ranges::find(kFormats, head->format, &Format::number);
  if (format == std::end(kFormats) || head->scheme != 0)
    return fail(ErrorCode::kUnsupported,
                "its format (" + std::to_string(head->format) +
                    ") is not read, or it is compressed; floats, E5B9G9R9 and "
                    "bytes are",
                where);
  CubeMap cube{head->width, {}};
  const std::uint64_t face_bytes = std::uint64_t{head->width} * head->width * format->bytes;
  const std::uint64_t first = 6 * face_bytes * layer, wanted = first + 6 * face_bytes;
  if (layer >= std::max(1U, head->layers) || head->offset > bytes.size() ||
      head->length > bytes.size() - head->offset || wanted > head->length)
    return fail(ErrorCode::kInvalidScene, "ends before its texels do, or lacks layer " + std::to_string(layer), where);
  for (std::size_t f = 0; f < 6; ++f) {
    const auto* at = bytes.data() + head->offset + first + f * face_bytes;
    auto& face = cube.faces[f];
    face.reserve(cube.size * cube.size);
    for (std::size_t i = 0; i < cube.size * cube.size; ++i)
      face.push_back(texelOf(at + i * format->bytes, format->kind));
    if (auto fault = skyRowFault(face, f); !fault.empty()) return fail(ErrorCode::kInvalidScene, fault, where);
  }
  return cube;
}

}  // namespace radiosity::scene
