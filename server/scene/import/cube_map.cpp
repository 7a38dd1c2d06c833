#include "server/scene/import/cube_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/packing.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vector_relational.hpp>
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
  enum class Kind { kByte, kSrgb, kHalf, kFloat, kShared, kPacked } kind = Kind::kByte;
};
constexpr Format kFormats[] = {{23, 3, Format::Kind::kByte},    {29, 3, Format::Kind::kSrgb},
                               {37, 4, Format::Kind::kByte},    {43, 4, Format::Kind::kSrgb},
                               {90, 6, Format::Kind::kHalf},    {97, 8, Format::Kind::kHalf},
                               {106, 12, Format::Kind::kFloat}, {109, 16, Format::Kind::kFloat},
                               {122, 4, Format::Kind::kPacked}, {123, 4, Format::Kind::kShared}};

glm::vec3 texelOf(const std::uint8_t* at, Format::Kind kind) {
  glm::vec3 texel(0.0F);
  if (kind == Format::Kind::kShared || kind == Format::Kind::kPacked) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, at, sizeof(bits));
    return kind == Format::Kind::kShared ? glm::unpackF3x9_E1x5(bits) : glm::unpackF2x11_1x10(bits);
  }
  for (int c = 0; c < 3; ++c) {
    if (kind == Format::Kind::kFloat) std::memcpy(&texel[c], at + 4 * c, sizeof(float));
    if (kind == Format::Kind::kHalf) {
      std::uint16_t half = 0;
      std::memcpy(&half, at + 2 * c, sizeof(half));
      texel[c] = glm::unpackHalf1x16(half);
    }
    if (kind == Format::Kind::kByte) texel[c] = static_cast<float>(at[c]) / 255.0F;
    if (kind == Format::Kind::kSrgb) texel[c] = linearOf(static_cast<float>(at[c]) / 255.0F);
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

float linearOf(float encoded) {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

glm::vec3 CubeMap::radiance(const glm::dvec3& direction) const {
  const auto place = placeOf(direction);
  const auto along = [&](double from) {
    const double at = std::clamp((0.5 * from + 0.5) * static_cast<double>(size), 0.0, static_cast<double>(size) - 1.0);
    return static_cast<std::size_t>(at);
  };
  return faces[place.face][along(place.t) * size + along(place.s)];
}

CubeFaceMaker::CubeFaceMaker(std::size_t edge)
    : edge_(edge), size_(std::min(edge, kMostSize)), across_(size_), sums_(size_, glm::dvec4(0.0)) {
  texels_.reserve(size_ * size_);
}

void CubeFaceMaker::addRow(std::span<const glm::vec3> row) {
  const double step = static_cast<double>(size_) / static_cast<double>(edge_);
  const auto middle = [&](std::size_t i) {
    return (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(edge_) - 1.0;
  };
  // Of what begins `from` and is one step long, how much lies in the texel where it begins; the rest is in the next.
  const auto inFirst = [&](double from, std::size_t first) {
    return std::min(from + step, static_cast<double>(first + 1)) - from;
  };
  std::ranges::fill(across_, glm::dvec4(0.0));
  const double t = middle(next_);
  for (std::size_t x = 0; x < edge_; ++x) {
    const double s = middle(x), from = static_cast<double>(x) * step;
    const double square = 1.0 + s * s + t * t, solid_angle = 1.0 / (square * std::sqrt(square));
    const auto light = solid_angle * glm::dvec4(row[x], 1.0);
    const auto first = std::min(size_ - 1, static_cast<std::size_t>(from));
    const double part = inFirst(from, first);
    across_[first] += part * light;
    if (first + 1 < size_) across_[first + 1] += std::max(0.0, step - part) * light;
  }
  const double from = static_cast<double>(next_++) * step;
  const auto made = texels_.size() / size_;
  const double part = inFirst(from, made);
  for (std::size_t x = 0; x < size_; ++x) sums_[x] += part * across_[x];
  if (from + step < static_cast<double>(made + 1) - 1e-9 && next_ < edge_) return;
  finishRow();
  for (std::size_t x = 0; x < size_; ++x) sums_[x] += std::max(0.0, step - part) * across_[x];
}

void CubeFaceMaker::finishRow() {
  for (auto& sum : sums_) {
    texels_.push_back(glm::vec3(glm::dvec3(sum) / sum.w));
    sum = glm::dvec4(0.0);
  }
}

namespace {

/// Means over texels of an image, of places that lie evenly by solid angle.
class TexelSampler {
 public:
  TexelSampler(const CubeMap& cube, const glm::dquat& rotation, std::size_t width, std::size_t height)
      : cube_(cube), back_(glm::mat3_cast(glm::conjugate(rotation))), width_(width), height_(height) {
    few_.reserve(kFew * width);
    for (std::size_t i = 0; i < kFew * width; ++i) few_.push_back(turn(i, kFew * width));
  }

  /// Of a few places. `is_even`: they do not differ much.
  [[nodiscard]] glm::vec3 quickMean(std::size_t x, std::size_t y, bool& is_even) const {
    Sum sum;
    for (std::size_t i = 0; i < kFew; ++i)
      for (std::size_t j = 0; j < kFew; ++j) sum.add(at(few_[kFew * x + i], height(y, j, kFew)));
    is_even = sum.isEven();
    return sum.mean();
  }
  [[nodiscard]] glm::vec3 mean(std::size_t x, std::size_t y) const {
    Sum sum;
    for (std::size_t i = 0; i < kMany; ++i) {
      const auto way = turn(kMany * x + i, kMany * width_);
      for (std::size_t j = 0; j < kMany; ++j) sum.add(at(way, height(y, j, kMany)));
    }
    return sum.mean();
  }

 private:
  static constexpr std::size_t kFew = 3, kMany = 16;
  struct Sum {
    void add(const glm::vec3& light) {
      sum += glm::dvec3(light);
      least = glm::min(least, light);
      most = glm::max(most, light);
      count += 1.0;
    }
    [[nodiscard]] glm::vec3 mean() const { return glm::vec3(sum / count); }
    [[nodiscard]] bool isEven() const { return glm::all(glm::lessThanEqual(most, 4.0F * least)); }
    glm::dvec3 sum{0.0};
    glm::vec3 least{HUGE_VALF}, most{0.0F};
    double count = 0.0;
  };
  /// Towards the middle of one of so many columns.
  [[nodiscard]] static glm::dvec2 turn(std::size_t column, std::size_t columns) {
    const double azimuth =
        (2.0 * (static_cast<double>(column) + 0.5) / static_cast<double>(columns) - 1.0) * std::numbers::pi;
    return {std::cos(azimuth), std::sin(azimuth)};
  }
  [[nodiscard]] double height(std::size_t y, std::size_t part, std::size_t parts) const {
    const auto edge = [&](std::size_t row) {
      return std::cos(std::numbers::pi * static_cast<double>(row) / static_cast<double>(height_));
    };
    return edge(y) + (edge(y + 1) - edge(y)) * (static_cast<double>(part) + 0.5) / static_cast<double>(parts);
  }
  [[nodiscard]] glm::vec3 at(const glm::dvec2& way, double height) const {
    const double across = std::sqrt(1.0 - height * height);
    return cube_.radiance(back_ * glm::dvec3(across * way.x, height, across * way.y));
  }

  const CubeMap& cube_;
  glm::dmat3 back_;
  std::size_t width_, height_;
  std::vector<glm::dvec2> few_;  ///< cosine and sine of azimuths, by column and place
};

}  // namespace

SkyImage imageOfCube(const CubeMap& cube, const glm::dquat& rotation) {
  SkyImage image;
  image.width = std::min(4 * cube.size, SkyImageMaker::kMostWidth);
  image.height = std::max<std::size_t>(2, image.width / 2);
  const TexelSampler sampler(cube, rotation, image.width, image.height);
  image.texels.resize(image.width * image.height);
  std::vector<std::uint8_t> is_near_uneven(image.texels.size());  // what is bright may lie between few places
  for (std::size_t y = 0; y < image.height; ++y) {
    interruptionPoint();
    for (std::size_t x = 0; x < image.width; ++x) {
      bool is_even = true;
      image.texels[y * image.width + x] = sampler.quickMean(x, y, is_even);
      if (is_even) continue;
      for (std::size_t row = y - std::min<std::size_t>(y, 1); row <= std::min(y + 1, image.height - 1); ++row)
        for (const std::size_t column : {x + image.width - 1, x, x + 1})
          is_near_uneven[row * image.width + column % image.width] = 1;
    }
  }
  for (std::size_t i = 0; i < image.texels.size(); ++i) {
    if (i % image.width == 0) interruptionPoint();
    if (is_near_uneven[i] != 0) image.texels[i] = sampler.mean(i % image.width, i / image.width);
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
        ErrorCode::kUnsupported,
        "its faces are " + std::to_string(head->width) + " texels wide; the limit is " + std::to_string(kMostCubeEdge),
        where);
  const auto* format = std::ranges::find(kFormats, head->format, &Format::number);
  if (format == std::end(kFormats) || head->scheme != 0)
    return fail(ErrorCode::kUnsupported,
                "its format (" + std::to_string(head->format) +
                    ") is not read, or it is compressed; floats, E5B9G9R9 and "
                    "bytes are",
                where);
  const std::size_t edge = head->width;
  const std::uint64_t face_bytes = std::uint64_t{edge} * edge * format->bytes;
  const std::uint64_t first = 6 * face_bytes * layer, wanted = first + 6 * face_bytes;
  if (layer >= std::max(1U, head->layers) || head->offset > bytes.size() ||
      head->length > bytes.size() - head->offset || wanted > head->length)
    return fail(ErrorCode::kInvalidScene, "ends before its texels do, or lacks layer " + std::to_string(layer), where);
  CubeMap cube;
  std::vector<glm::vec3> row(edge);
  const auto* at = bytes.data() + head->offset + first;
  for (auto& face : cube.faces) {
    CubeFaceMaker maker(edge);
    cube.size = maker.size();
    for (std::size_t y = 0; y < edge; ++y) {
      interruptionPoint();
      for (auto& texel : row) {
        texel = texelOf(at, format->kind);
        at += format->bytes;
      }
      if (auto fault = skyRowFault(row, y); !fault.empty()) return fail(ErrorCode::kInvalidScene, fault, where);
      maker.addRow(row);
    }
    face = maker.take();
  }
  return cube;
}

}  // namespace radiosity::scene
