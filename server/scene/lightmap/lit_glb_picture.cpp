#include "server/scene/lightmap/lit_glb_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <vector>

#include "common/task.h"
#include "server/geometry/triangle_rows.h"
#include "server/scene/document/png.h"

namespace radiosity::scene {
namespace {

std::uint8_t byteOf(float value) {
  return static_cast<std::uint8_t>(std::lround((std::isfinite(value) ? std::clamp(value, 0.0F, 1.0F) : 0.0F) * 255.0F));
}

/// Half-open, in pixels.
struct PixelRect {
  int x0, y0, x1, y1;
};

/// One side of a surface on the page.
struct PlacedSide {
  const Surface* surface;
  PagePlace place;
};

/// A page with alpha.
class SeeThroughPage {
 public:
  SeeThroughPage(const PatchScene& patches, const Image& display, std::vector<PlacedSide> sides)
      : patches_(patches), display_(display), sides_(std::move(sides)) {
    for (const auto& side : sides_) scale_ = std::max(scale_, static_cast<int>(side.surface->opacity_scale));
    while (scale_ > 1 && std::max(display.width, display.height) * scale_ > static_cast<int>(kMostPixels)) scale_ /= 2;
    width_ = display.width * scale_;
    height_ = display.height * scale_;
    rgba_.assign(std::size_t{4} * static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), 255);
  }

  Bytes png() {
    writeColours();
    // First what lookups reach around the charts, then the charts: in a file's own layout their rectangles may overlap.
    for (const auto& side : sides_) writeAround(side);
    for (const auto& side : sides_)
      for (std::uint32_t t = 0; t < side.surface->triangle_count; ++t)
        writeTriangle(side, side.surface->first_triangle + t);
    return encodePng(width_, height_, 4, rgba_);
  }

 private:
  [[nodiscard]] std::uint8_t* pixel(int x, int y) {
    return &rgba_[4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x))];
  }

  /// What a bilinear lookup gives at the pixel's middle.
  [[nodiscard]] glm::vec3 colourAt(int x, int y) const {
    const glm::vec2 most(display_.width - 1, display_.height - 1);
    const glm::vec2 at =
        glm::clamp((glm::vec2(x, y) + 0.5F) / static_cast<float>(scale_) - 0.5F, glm::vec2(0.0F), most);
    const glm::ivec2 low(at), high = glm::min(low + 1, glm::ivec2(most));
    const glm::vec2 part = at - glm::vec2(low);
    return glm::mix(glm::mix(display_.at(low.x, low.y), display_.at(high.x, low.y), part.x),
                    glm::mix(display_.at(low.x, high.y), display_.at(high.x, high.y), part.x), part.y);
  }

  void writeColours() {
    for (int y = 0; y < height_; ++y) {
      interruptionPoint();
      for (int x = 0; x < width_; ++x) {
        const auto colour = colourAt(x, y);
        for (int c = 0; c < 3; ++c) pixel(x, y)[c] = byteOf(colour[c]);
      }
    }
  }

  /// Chart coordinates of a place on the picture, in pixels.
  [[nodiscard]] glm::vec2 texelAt(const PlacedSide& side, const glm::vec2& place) const {
    return place / static_cast<float>(scale_) - glm::vec2(side.place.x, side.place.y);
  }

  /// Mean over a pixel of the surface, or of what is nearest to it.
  [[nodiscard]] std::uint8_t opacityAt(const PlacedSide& side, int x, int y) const {
    const Surface& surface = *side.surface;
    const int cells = std::max(1, static_cast<int>(surface.opacity_scale) / scale_);
    const glm::vec2 most = glm::vec2(surface.width, surface.height) - 0.5F / static_cast<float>(surface.opacity_scale);
    std::uint32_t sum = 0;
    for (int j = 0; j < cells; ++j)
      for (int i = 0; i < cells; ++i) {
        const auto place = glm::vec2(x, y) + (glm::vec2(i, j) + 0.5F) / static_cast<float>(cells);
        sum += patches_.opacityAt(surface, glm::clamp(texelAt(side, place), glm::vec2(0.0F), most));
      }
    const auto count = static_cast<std::uint32_t>(cells * cells);
    return static_cast<std::uint8_t>((sum + count / 2) / count);
  }

  [[nodiscard]] PixelRect clipped(const PixelRect& rect) const {
    return {std::max(rect.x0, 0), std::max(rect.y0, 0), std::min(rect.x1, width_), std::min(rect.y1, height_)};
  }

  /// A lookup on a chart reaches a texel beyond it.
  void writeAround(const PlacedSide& side) {
    const auto x = static_cast<int>(side.place.x), y = static_cast<int>(side.place.y);
    const auto x1 = x + static_cast<int>(side.surface->width), y1 = y + static_cast<int>(side.surface->height);
    const auto rect = clipped({(x - 1) * scale_, (y - 1) * scale_, (x1 + 1) * scale_, (y1 + 1) * scale_});
    interruptionPoint();
    for (int row = rect.y0; row < rect.y1; ++row)
      for (int column = rect.x0; column < rect.x1; ++column) pixel(column, row)[3] = opacityAt(side, column, row);
  }

  void writeTriangle(const PlacedSide& side, std::uint32_t triangle) {
    interruptionPoint();
    std::array<glm::vec2, 3> corner;
    for (std::size_t k = 0; k < 3; ++k)
      corner[k] = (patches_.vertices[patches_.indices[std::size_t{3} * triangle + k]].texel +
                   glm::vec2(side.place.x, side.place.y)) *
                  static_cast<float>(scale_);
    const auto cross = [](const glm::vec2& a, const glm::vec2& b) { return a.x * b.y - a.y * b.x; };
    const float twice = cross(corner[1] - corner[0], corner[2] - corner[0]);
    if (!(std::abs(twice) > 0.0F)) return;
    const auto low = glm::floor(glm::min(glm::min(corner[0], corner[1]), corner[2]));
    const auto high = glm::ceil(glm::max(glm::max(corner[0], corner[1]), corner[2]));
    const auto rect =
        clipped({static_cast<int>(low.x), static_cast<int>(low.y), static_cast<int>(high.x), static_cast<int>(high.y)});
    const std::array<glm::dvec2, 3> precise{glm::dvec2(corner[0]), glm::dvec2(corner[1]), glm::dvec2(corner[2])};
    for (int y = rect.y0; y < rect.y1; ++y) {
      const auto columns = columnsOf(precise, y, width_);
      for (int x = std::max(rect.x0, columns.first); x < std::min(rect.x1, columns.end); ++x) {
        const auto middle = glm::vec2(x, y) + 0.5F;
        const auto edge = [&](std::size_t k) {
          return cross(corner[(k + 1) % 3] - corner[k], middle - corner[k]) / twice;
        };
        if (std::min({edge(0), edge(1), edge(2)}) >= -1e-5F) pixel(x, y)[3] = opacityAt(side, x, y);
      }
    }
  }

  const PatchScene& patches_;
  const Image& display_;
  std::vector<PlacedSide> sides_;
  int scale_ = 1, width_ = 0, height_ = 0;
  std::vector<std::uint8_t> rgba_;
};

}  // namespace

Bytes encodePagePng(const PatchScene& patches, std::uint32_t page, const Image& display) {
  std::vector<PlacedSide> see_through;
  for (const Surface& surface : patches.surfaces)
    for (const auto& place : surface.place)
      if (place.page == page && surface.see_through) see_through.push_back({&surface, place});
  if (!see_through.empty()) return SeeThroughPage(patches, display, std::move(see_through)).png();
  std::vector<std::uint8_t> rgb;
  rgb.reserve(display.pixels.size() * 3);
  for (const auto& pixel : display.pixels)
    for (int c = 0; c < 3; ++c) rgb.push_back(byteOf(pixel[c]));
  return encodePng(display.width, display.height, 3, rgb);
}

}  // namespace radiosity::scene
