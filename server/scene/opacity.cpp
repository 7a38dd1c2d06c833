#include "server/scene/opacity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "server/scene/chart_corners.h"
#include "server/scene/shade_texture.h"

namespace radiosity::scene {
namespace {

constexpr std::uint64_t kMaxCells = std::uint64_t{1} << 26;
constexpr std::uint32_t kMaxScale = 64;  ///< cells across a leaf
constexpr int kSamples = 3;              ///< kSamples^2 looks at the texture in each cell

const Material& materialOf(const Scene& scene, const Surface& surface) {
  static const Material kDefault;
  return surface.material < scene.materials.size() ? scene.materials[surface.material] : kDefault;
}

/// In steps of 1/255; what is no number is 0.
std::uint8_t byteOf(float opacity) {
  return static_cast<std::uint8_t>(std::lround(255.0F * (opacity > 0.0F ? std::min(opacity, 1.0F) : 0.0F)));
}

/// Opacity over one surface.
class SurfaceOpacity {
 public:
  SurfaceOpacity(const Scene& scene, PatchScene& patches, const Surface& surface)
      : patches_(patches),
        surface_(surface),
        material_(materialOf(scene, surface)),
        instance_(scene.instances[surface.instance]),
        primitive_(scene.primitives[instance_.primitive]) {
    const auto texture = material_.base_color_texture.texture;
    if (texture < scene.textures.size() && material_.alpha_mode != AlphaMode::kOpaque) {
      texture_ = &scene.textures[texture];
    }
  }

  /// Cells across a leaf that follow the alpha texture's pixels: a power of two.
  [[nodiscard]] std::uint32_t wantedScale() const {
    if (texture_ == nullptr) return 1;
    float pixels = 1.0F;  // of the texture, across a leaf
    for (std::uint32_t i = 0; i < std::min(surface_.triangle_count, 64U); ++i) {
      const ChartCorners corners = cornersOf(patches_, surface_.first_triangle + i, instance_, primitive_);
      const glm::vec2 size = glm::vec2(texture_->width, texture_->height) * material_.base_color_texture.scale;
      const glm::vec2 at = uvAt(corners, corners.texel[0]);
      for (const glm::dvec2 step : {glm::dvec2(1.0, 0.0), glm::dvec2(0.0, 1.0)}) {
        const float across = glm::length((uvAt(corners, corners.texel[0] + step) - at) * size);
        if (std::isfinite(across)) pixels = std::max(pixels, across);
      }
    }
    std::uint32_t scale = 1;
    while (scale < kMaxScale && static_cast<float>(scale) < pixels) scale *= 2;
    return scale;
  }

  void fill() {
    width_ = surface_.width * surface_.opacity_scale;
    height_ = surface_.height * surface_.opacity_scale;
    known_.assign(std::size_t{width_} * height_, false);
    for (std::uint32_t i = 0; i < surface_.triangle_count; ++i)
      fillTriangle(cornersOf(patches_, surface_.first_triangle + i, instance_, primitive_));
    fillBorders();
  }

 private:
  [[nodiscard]] glm::vec2 uvAt(const ChartCorners& c, const glm::dvec2& p) const {
    const auto& set = material_.base_color_texture.texcoord == 1 ? primitive_.texcoord1 : primitive_.texcoord0;
    if (set.empty()) return glm::vec2(0.0F);
    const glm::vec3 w = c.weightsAt(p);
    return set[c.vertex[0]] * w[0] + set[c.vertex[1]] * w[1] + set[c.vertex[2]] * w[2];
  }

  [[nodiscard]] float alphaAt(const ChartCorners& c, const glm::dvec2& p) const {
    float alpha = material_.alpha;
    if (texture_ != nullptr) alpha *= sampleAlpha(*texture_, material_.base_color_texture, uvAt(c, p));
    if (!primitive_.color0.empty()) {
      const glm::vec3 w = glm::clamp(c.weightsAt(p), 0.0F, 1.0F);
      const auto& color = primitive_.color0;
      alpha *= color[c.vertex[0]].a * w[0] + color[c.vertex[1]].a * w[1] + color[c.vertex[2]].a * w[2];
    }
    return alpha;
  }

  [[nodiscard]] float opacityOf(const ChartCorners& c, const glm::dvec2& cell) const {
    const float transmitted = 1.0F - material_.transmission;
    if (material_.alpha_mode == AlphaMode::kOpaque) return transmitted;
    const bool uniform = texture_ == nullptr && primitive_.color0.empty();
    const int side = uniform ? 1 : kSamples;
    float sum = 0.0F;
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const glm::dvec2 at = (cell + (glm::dvec2(x, y) + 0.5) / double(side)) / double(surface_.opacity_scale);
        const float alpha = alphaAt(c, at);
        const bool mask = material_.alpha_mode == AlphaMode::kMask;
        sum += mask ? (alpha >= material_.alpha_cutoff ? 1.0F : 0.0F) : std::clamp(alpha, 0.0F, 1.0F);
      }
    }
    return transmitted * sum / static_cast<float>(side * side);
  }

  [[nodiscard]] std::uint8_t& cell(std::uint32_t x, std::uint32_t y) {
    return patches_.opacity[surface_.first_opacity + std::size_t{y} * width_ + x];
  }

  void fillTriangle(const ChartCorners& c) {
    const auto scale = static_cast<double>(surface_.opacity_scale);
    const glm::dvec2 low = glm::min(glm::min(c.texel[0], c.texel[1]), c.texel[2]) * scale;
    const glm::dvec2 high = glm::max(glm::max(c.texel[0], c.texel[1]), c.texel[2]) * scale;
    const auto end_x = std::min(width_, static_cast<std::uint32_t>(std::ceil(std::max(high.x, 0.0))));
    const auto end_y = std::min(height_, static_cast<std::uint32_t>(std::ceil(std::max(high.y, 0.0))));
    for (auto y = static_cast<std::uint32_t>(std::max(low.y, 0.0)); y < end_y; ++y) {
      for (auto x = static_cast<std::uint32_t>(std::max(low.x, 0.0)); x < end_x; ++x) {
        const glm::vec3 w = c.weightsAt((glm::dvec2(x, y) + 0.5) / scale);
        if (std::min({w.x, w.y, w.z}) < -1e-6F) continue;
        cell(x, y) = byteOf(opacityOf(c, glm::dvec2(x, y)));
        known_[std::size_t{y} * width_ + x] = true;
      }
    }
  }

  /// Cells that triangles only touch, without their middles, are as the next one.
  void fillBorders() {
    const auto before = known_;
    for (std::uint32_t y = 0; y < height_; ++y) {
      for (std::uint32_t x = 0; x < width_; ++x) {
        if (!before[std::size_t{y} * width_ + x]) cell(x, y) = neighbour(before, x, y);
      }
    }
  }

  [[nodiscard]] std::uint8_t neighbour(const std::vector<bool>& known, std::uint32_t x, std::uint32_t y) {
    for (std::uint32_t ny = y == 0 ? 0 : y - 1; ny < std::min(y + 2, height_); ++ny) {
      for (std::uint32_t nx = x == 0 ? 0 : x - 1; nx < std::min(x + 2, width_); ++nx) {
        if (known[std::size_t{ny} * width_ + nx]) return cell(nx, ny);
      }
    }
    // Slivers that hold no cell's middle: as the surface would be without a texture.
    const float alpha = material_.alpha_mode == AlphaMode::kBlend ? material_.alpha : 1.0F;
    return byteOf(alpha * (1.0F - material_.transmission));
  }

  PatchScene& patches_;
  const Surface& surface_;
  const Material& material_;
  const Instance& instance_;
  const Primitive& primitive_;
  const Texture* texture_ = nullptr;
  std::uint32_t width_ = 0, height_ = 0;
  std::vector<bool> known_;
};

std::uint64_t cellsOf(const Surface& surface) {
  return std::uint64_t{surface.width} * surface.height * surface.opacity_scale * surface.opacity_scale;
}

/// Mean over the cells of a leaf, in [0, 1].
float leafOpacity(const PatchScene& patches, const Surface& surface, std::uint32_t leaf) {
  const std::uint32_t scale = surface.opacity_scale, width = surface.width * scale;
  const std::uint32_t x0 = leaf % surface.width * scale, y0 = leaf / surface.width * scale;
  std::uint64_t sum = 0;
  for (std::uint32_t y = y0; y < y0 + scale; ++y) {
    for (std::uint32_t x = x0; x < x0 + scale; ++x) {
      sum += patches.opacity[surface.first_opacity + std::size_t{y} * width + x];
    }
  }
  return static_cast<float>(static_cast<double>(sum) / (255.0 * scale * scale));
}

}  // namespace

bool isSeeThrough(const Material& material) {
  return material.alpha_mode != AlphaMode::kOpaque || material.transmission > 0.0F;
}

void measureOpacity(const Scene& scene, PatchScene& patches) {
  std::uint64_t cells = 0;
  for (Surface& surface : patches.surfaces) {
    if (!surface.see_through) continue;
    surface.opacity_scale = SurfaceOpacity(scene, patches, surface).wantedScale();
    cells += cellsOf(surface);
  }
  bool coarser = false;
  for (bool more = true; cells > kMaxCells && more;) {
    more = false;
    cells = 0;
    for (Surface& surface : patches.surfaces) {
      if (!surface.see_through) continue;
      if (surface.opacity_scale > 1) {
        surface.opacity_scale /= 2;
        more = coarser = true;
      }
      cells += cellsOf(surface);
    }
  }
  if (coarser) patches.warnings.emplace_back("cut-outs are coarser than their textures: there are too many of them");
  patches.opacity.assign(cells, 255);
  std::uint64_t first = 0;
  for (Surface& surface : patches.surfaces) {
    if (!surface.see_through) continue;
    surface.first_opacity = static_cast<std::uint32_t>(first);
    first += cellsOf(surface);
    SurfaceOpacity(scene, patches, surface).fill();
  }
}

void applyOpacity(PatchScene& patches) {
  for (const Surface& surface : patches.surfaces) {
    if (!surface.see_through) continue;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const float opacity = leafOpacity(patches, surface, leaf);
      for (const auto first : surface.first_node) {
        if (first != kNone) patches.node_area[first + leaf] *= opacity;
      }
      if (opacity <= 0.0F) patches.leaves[surface.first_leaf + leaf] = {};
    }
  }
}

}  // namespace radiosity::scene
