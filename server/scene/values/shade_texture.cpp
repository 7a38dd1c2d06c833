#include "server/scene/values/shade_texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <utility>

#include "common/parallel.h"

namespace radiosity::scene {
namespace {

ByteValues valuesOfBytes() {
  ByteValues values{};
  for (int i = 0; i < 256; ++i) {
    const double v = i / 255.0;
    const auto at = static_cast<std::size_t>(i);
    values.plain[at] = static_cast<float>(i) / 255.0F;
    values.srgb[at] = static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
  }
  return values;
}

/// Of a level that is made: fewer are not worth a thread.
constexpr std::size_t kPixelsAThread = std::size_t{1} << 14;

int wrap(int i, int size, bool repeat, bool mirror) {
  if (i >= 0 && i < size) return i;
  if (!repeat) return std::clamp(i, 0, size - 1);
  const int period = mirror ? 2 * size : size;
  int m = i % period;
  if (m < 0) m += period;
  return mirror && m >= size ? 2 * size - 1 - m : m;
}

/// The same place of the texture as `uv`, within its first two repeats (two, for mirrors) or, where it does not repeat,
/// within one texture's width of it: so that a wild UV overflows no integer, and pixels are told apart around it.
/// Exact.
float fold(float uv, bool repeat) {
  if (!repeat) return std::clamp(uv, -1.0F, 2.0F);
  return std::abs(uv) < 2.0F ? uv : std::fmod(uv, 2.0F);
}

/// What a bilinear lookup mixes: the first pixel, and the weights of the next ones.
struct Lookup {
  int x, y;
  glm::vec2 next;
};
Lookup lookupAt(const TextureUse& use, const glm::vec2& uv, int width, int height, bool nearest) {
  const glm::vec2 place = glm::vec2(fold(uv.x, use.repeat_u), fold(uv.y, use.repeat_v)) * glm::vec2(width, height) -
                          (nearest ? 0.0F : 0.5F);
  const glm::vec2 base = glm::floor(place);
  return {static_cast<int>(base.x), static_cast<int>(base.y), nearest ? glm::vec2(0.0F) : place - base};
}

/// Source pixels and weights of target pixel `i` when `from` pixels become `to`: exact overlap, so the mean is kept for
/// odd sizes too.
struct Taps {
  int first, count;
  std::array<float, 4> weight;
};
Taps tapsOf(int i, int from, int to) {
  const double ratio = static_cast<double>(from) / to;
  const double low = i * ratio, high = low + ratio;
  Taps taps{static_cast<int>(std::floor(low + 1e-9)), 0, {}};
  for (int p = taps.first; p < from && p < high - 1e-9 && taps.count < 4; ++p)
    taps.weight[static_cast<std::size_t>(taps.count++)] =
        static_cast<float>((std::min(high, p + 1.0) - std::max(low, static_cast<double>(p))) / ratio);
  return taps;
}

}  // namespace

const ByteValues kByteValues = valuesOfBytes();

bool hasPixels(const Texture& texture) {
  const auto pixels =
      static_cast<std::size_t>(std::max(0, texture.width)) * static_cast<std::size_t>(std::max(0, texture.height));
  return pixels > 0 && texture.rgba.size() >= 4 * pixels;
}

glm::vec2 transformUv(const TextureUse& use, const glm::vec2& uv) {
  const glm::vec2 s = uv * use.scale;
  const float c = std::cos(use.rotation), d = std::sin(use.rotation);
  return use.offset + glm::vec2(c * s.x + d * s.y, -d * s.x + c * s.y);
}

PlainTexture::PlainTexture(const Texture& texture, const TextureUse& use)
    : texture_(&texture), use_(&use), has_pixels_(hasPixels(texture)) {
  const float c = std::cos(use.rotation), d = std::sin(use.rotation);
  turn_ = {c * use.scale.x, -d * use.scale.x, d * use.scale.y, c * use.scale.y};
}

/// `pixel(x, y)`: a value of the texture.
template <typename Value, typename Pixel>
Value PlainTexture::filtered(const glm::vec2& uv, const Pixel& pixel) const {
  const glm::vec2 turned = use_->offset + turn_ * uv;
  if (!has_pixels_ || !std::isfinite(turned.x) || !std::isfinite(turned.y)) return Value(1.0F);
  const Lookup lookup = lookupAt(*use_, turned, texture_->width, texture_->height, use_->nearest);
  const auto at = [&](int dx, int dy) -> Value {
    return pixel(wrap(lookup.x + dx, texture_->width, use_->repeat_u, use_->mirror_u),
                 wrap(lookup.y + dy, texture_->height, use_->repeat_v, use_->mirror_v));
  };
  if (use_->nearest) return at(0, 0);
  return glm::mix(glm::mix(at(0, 0), at(1, 0), lookup.next.x), glm::mix(at(0, 1), at(1, 1), lookup.next.x),
                  lookup.next.y);
}

float PlainTexture::alphaAt(const glm::vec2& uv) const {
  return filtered<float>(uv, [&](int x, int y) { return pixelOf(*texture_, x, y).a; });
}

glm::vec3 PlainTexture::colourAt(const glm::vec2& uv) const {
  return filtered<glm::vec3>(uv, [&](int x, int y) { return glm::vec3(pixelOf(*texture_, x, y)); });
}

TexturePyramid::TexturePyramid(const Texture& texture)
    : TexturePyramid(
          texture.width, texture.height,
          [&texture](int x, int y) { return glm::vec4(glm::vec3(pixelOf(texture, x, y)), 1.0F); }, true) {}

TexturePyramid::TexturePyramid(int width, int height, Pixels pixels, bool all_count)
    : width_(width), height_(height), pixels_(std::move(pixels)), all_count_(all_count) {
  buildLevels();
}

std::size_t TexturePyramid::bytes() const {
  std::size_t bytes = 0;
  for (const auto& level : levels_) bytes += level.pixels.size() * sizeof(glm::vec4);
  return bytes;
}

void TexturePyramid::buildLevels() {
  int width = width_, height = height_;
  for (std::size_t level = 0; width > 1 || height > 1; ++level) {
    Level next{std::max(1, width / 2), std::max(1, height / 2), {}};
    next.pixels.resize(static_cast<std::size_t>(next.width) * static_cast<std::size_t>(next.height));
    std::vector<Taps> columns;
    for (int x = 0; x < next.width; ++x) columns.push_back(tapsOf(x, width, next.width));
    const auto fillRow = [&](std::size_t y) {
      const Taps rows = tapsOf(static_cast<int>(y), height, next.height);
      for (std::size_t x = 0; x < columns.size(); ++x) {
        glm::vec4 sum(0.0F);
        for (int j = 0; j < rows.count; ++j)
          for (int i = 0; i < columns[x].count; ++i)
            sum += pixel(level, columns[x].first + i, rows.first + j) * columns[x].weight[static_cast<std::size_t>(i)] *
                   rows.weight[static_cast<std::size_t>(j)];
        next.pixels[y * columns.size() + x] = sum;
      }
    };
    inTurns(static_cast<std::size_t>(next.height), fillRow, next.pixels.size() / kPixelsAThread);
    width = next.width;
    height = next.height;
    levels_.push_back(std::move(next));
  }
}

glm::vec4 TexturePyramid::pixel(std::size_t level, int x, int y) const {
  if (level == 0) {
    const auto plain = pixels_(x, y);
    return {glm::vec3(plain) * plain.a, plain.a};
  }
  const auto& in = levels_[level - 1];
  return in.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(in.width) + static_cast<std::size_t>(x)];
}

/// What NEAREST looks up, too, is mixed above level 0, whose pixels are the only ones with borders of their own.
glm::vec4 TexturePyramid::mixed(std::size_t level, const TextureUse& use, const glm::vec2& uv) const {
  const int width = level == 0 ? width_ : levels_[level - 1].width;
  const int height = level == 0 ? height_ : levels_[level - 1].height;
  const bool nearest = use.nearest && level == 0;
  const auto [x0, y0, f] = lookupAt(use, uv, width, height, nearest);
  const auto at = [&](int x, int y) {
    return pixel(level, wrap(x, width, use.repeat_u, use.mirror_u), wrap(y, height, use.repeat_v, use.mirror_v));
  };
  if (nearest) return at(x0, y0);
  return glm::mix(glm::mix(at(x0, y0), at(x0 + 1, y0), f.x), glm::mix(at(x0, y0 + 1), at(x0 + 1, y0 + 1), f.x), f.y);
}

TexturePyramid::Look TexturePyramid::look(const TextureUse& use, const glm::vec2& uv,
                                          const glm::vec2& footprint) const {
  constexpr Look kWhite{glm::vec3(1.0F), 1.0F};
  if (width_ <= 0 || height_ <= 0) return kWhite;
  const glm::vec2 place = transformUv(use, uv);
  if (!std::isfinite(place.x) || !std::isfinite(place.y)) return kWhite;
  const glm::vec2 extent = glm::abs(footprint * use.scale) * glm::vec2(width_, height_);
  const float pixels = std::max({1.0F, extent.x, extent.y});  // 1 comes first: what is no number is then passed over
  const auto level = std::min(levels_.size(), static_cast<std::size_t>(std::lround(std::log2(std::min(pixels, 1e6F)))));
  auto found = mixed(level, use, place);
  if (all_count_) return {glm::vec3(found), 1.0F};
  const float coverage = found.a;
  for (auto coarser = level + 1; !(found.a > 0.0F) && coarser <= levels_.size(); ++coarser)
    found = mixed(coarser, use, place);
  return found.a > 0.0F ? Look{glm::vec3(found) / found.a, coverage} : Look{glm::vec3(1.0F), 0.0F};
}

}  // namespace radiosity::scene
