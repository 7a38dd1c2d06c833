// Which texels of a lightmap page are taken, while charts are placed beside those that stay (atlas.cpp). Plain values.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/vec2.hpp>
#include <optional>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

struct TexelRect {
  std::uint32_t x = 0, y = 0, width = 0, height = 0;
};

std::uint32_t mostPageTexels(const ChartOptions& options) {
  return std::clamp(options.max_page_size, 16U, 32768U) & ~3U;
}
std::uint32_t mostChartTexels(const ChartOptions& options) {
  const auto page = mostPageTexels(options);
  return page - std::min(options.gutter, page / 2);
}

/// Which texels of a page are taken.
class PageSpace {
 public:
  explicit PageSpace(const Page& page) : page_(page), taken_(cells(), false) {}

  [[nodiscard]] std::uint64_t cells() const { return std::uint64_t{page_.width} * page_.height; }

  void take(const TexelRect& rect) {
    for (std::uint32_t y = rect.y; y < std::min(rect.y + rect.height, page_.height); ++y)
      for (std::uint32_t x = rect.x; x < std::min(rect.x + rect.width, page_.width); ++x) taken_[index(x, y)] = true;
  }

  /// The first place from the top where a rectangle is free.
  [[nodiscard]] std::optional<glm::uvec2> findFree(std::uint32_t width, std::uint32_t height) const {
    for (std::uint32_t y = 0; y + height <= page_.height; ++y)
      for (std::uint32_t x = 0; x + width <= page_.width;) {
        const auto next = blockedUntil({x, y, width, height});
        if (next == x) return glm::uvec2(x, y);
        x = next;
      }
    return std::nullopt;
  }

 private:
  [[nodiscard]] std::size_t index(std::uint32_t x, std::uint32_t y) const { return std::size_t{y} * page_.width + x; }
  /// rect.x if it is free; else the column after one that is taken.
  [[nodiscard]] std::uint32_t blockedUntil(const TexelRect& rect) const {
    for (std::uint32_t y = rect.y; y < rect.y + rect.height; ++y)
      for (std::uint32_t x = rect.x + rect.width; x-- > rect.x;)
        if (taken_[index(x, y)]) return x + 1;
    return rect.x;
  }

  Page page_;
  std::vector<bool> taken_;
};

}  // namespace radiosity::scene
