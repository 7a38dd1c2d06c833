#include "server/scene/shading/opacity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <vector>

#include "common/give_back.h"
#include "common/parallel.h"
#include "server/geometry/triangle_rows.h"
#include "server/scene/shading/specular.h"
#include "server/scene/values/chart_corners.h"
#include "server/scene/values/material_of.h"
#include "server/scene/values/shade_texture.h"

namespace radiosity::scene {
namespace {

constexpr std::uint64_t kMaxCells = std::uint64_t{1} << 26;
constexpr std::uint32_t kMaxScale = 64;        ///< cells across a leaf
constexpr int kSamples = 3;                    ///< kSamples^2 looks at the texture in each cell
constexpr std::uint32_t kCellsAtOnce = 16384;  ///< of one thread, about

/// In steps of 1/255; what is no number is 0.
std::uint8_t byteOf(float opacity) {
  return static_cast<std::uint8_t>(std::lround(255.0F * (opacity > 0.0F ? std::min(opacity, 1.0F) : 0.0F)));
}

/// Texture coordinates over a triangle, which are affine in the chart's.
struct UvMap {
  glm::dvec2 origin, across, up;

  UvMap(const ChartCorners& c, const std::vector<glm::vec2>& set) : origin(0.0), across(0.0), up(0.0) {
    if (set.empty()) return;
    const glm::dvec2 uv(set[c.vertex[0]]), to1 = glm::dvec2(set[c.vertex[1]]) - uv,
                                           to2 = glm::dvec2(set[c.vertex[2]]) - uv;
    const glm::dvec2 edge1 = c.texel[1] - c.texel[0], edge2 = c.texel[2] - c.texel[0];
    across = c.inverse_area * (edge2.y * to1 - edge1.y * to2);
    up = c.inverse_area * (edge1.x * to2 - edge2.x * to1);
    origin = uv - c.texel[0].x * across - c.texel[0].y * up;
  }

  [[nodiscard]] glm::vec2 at(const glm::dvec2& p) const { return glm::vec2(origin + p.x * across + p.y * up); }
};

/// Opacity over one surface.
class SurfaceOpacity {
 public:
  SurfaceOpacity(const Scene& scene, PatchScene& patches, Surface& surface)
      : patches_(patches),
        surface_(surface),
        material_(materialOf(scene, surface)),
        instance_(scene.instances[surface.instance]),
        primitive_(patches.cuts.primitiveOf(scene, surface.instance)) {
    const auto texture = material_.base_color_texture.texture;
    if (texture < scene.textures.size() && material_.alpha_mode != AlphaMode::kOpaque) {
      texture_.emplace(scene.textures[texture], material_.base_color_texture);
      texture_size_ = glm::dvec2(scene.textures[texture].width, scene.textures[texture].height);
    }
  }

  /// Cells across a leaf that follow the alpha texture's pixels: a power of two.
  [[nodiscard]] std::uint32_t wantedScale() const {
    if (!texture_) return 1;
    double pixels = 1.0;  // of the texture, across a leaf
    for (std::uint32_t i = 0; i < std::min(surface_.triangle_count, 64U); ++i) {
      const UvMap uv(cornersOf(patches_, surface_.first_triangle + i, instance_, primitive_), texcoords());
      const auto size = texture_size_ * glm::dvec2(material_.base_color_texture.scale);
      for (const auto& step : {uv.across, uv.up}) {
        const double across = glm::length(step * size);
        if (std::isfinite(across)) pixels = std::max(pixels, across);
      }
    }
    std::uint32_t scale = 1;
    while (scale < kMaxScale && scale < pixels) scale *= 2;
    return scale;
  }

  [[nodiscard]] Surface& surface() { return surface_; }
  [[nodiscard]] std::uint64_t cellCount() const {
    return std::uint64_t{surface_.width} * surface_.height * surface_.opacity_scale * surface_.opacity_scale;
  }

  /// Once the surface has its place among all cells. Returns how many rows there are.
  std::uint32_t start() {
    width_ = surface_.width * surface_.opacity_scale;
    height_ = surface_.height * surface_.opacity_scale;
    known_.assign(std::size_t{width_} * height_, 0);
    rows_.reserve(surface_.triangle_count);
    for (std::uint32_t i = 0; i < surface_.triangle_count; ++i) {
      const auto [low, high] = extentOf(cornersOf(patches_, surface_.first_triangle + i, instance_, primitive_));
      rows_.push_back({rowAt(std::floor(low.y)), rowAt(std::ceil(high.y))});
    }
    return height_;
  }
  [[nodiscard]] std::uint32_t width() const { return width_; }

  /// Of some rows; others may be filled by other threads.
  void fill(std::uint32_t first_row, std::uint32_t end_row) {
    for (std::uint32_t i = 0; i < surface_.triangle_count; ++i) {
      if (rows_[i].end <= first_row || rows_[i].first >= end_row) continue;
      fillTriangle(cornersOf(patches_, surface_.first_triangle + i, instance_, primitive_), first_row, end_row);
    }
  }

  /// Cells that triangles only touch, without their middles, are as the next one. When all rows are filled.
  void fillBorders() {
    for (std::uint32_t y = 0; y < height_; ++y) {
      interruptionPoint();
      for (std::uint32_t x = 0; x < width_; ++x) {
        if (known_[std::size_t{y} * width_ + x] == 0) cell(x, y) = neighbour(x, y);
      }
    }
    giveBack(known_);
    giveBack(rows_);
  }

 private:
  [[nodiscard]] const std::vector<glm::vec2>& texcoords() const {
    return material_.base_color_texture.texcoord == 1 ? primitive_.texcoord1 : primitive_.texcoord0;
  }

  struct Extent {
    glm::dvec2 low, high;
  };
  /// Of a triangle, in cells.
  [[nodiscard]] Extent extentOf(const ChartCorners& c) const {
    const auto scale = static_cast<double>(surface_.opacity_scale);
    return {glm::min(glm::min(c.texel[0], c.texel[1]), c.texel[2]) * scale,
            glm::max(glm::max(c.texel[0], c.texel[1]), c.texel[2]) * scale};
  }
  [[nodiscard]] std::uint32_t rowAt(double y) const {
    return static_cast<std::uint32_t>(std::clamp(y, 0.0, static_cast<double>(height_)));
  }

  [[nodiscard]] float alphaAt(const ChartCorners& c, const UvMap& uv, const glm::dvec2& p) const {
    float alpha = material_.alpha;
    if (texture_) alpha *= texture_->at(uv.at(p));
    if (!primitive_.color0.empty()) {
      glm::vec3 w = glm::clamp(c.weightsAt(p), 0.0F, 1.0F);
      w /= w.x + w.y + w.z;  // beyond an edge the rest would be more than all
      const auto& color = primitive_.color0;
      alpha *= color[c.vertex[0]].a * w[0] + color[c.vertex[1]].a * w[1] + color[c.vertex[2]].a * w[2];
    }
    return alpha;
  }

  [[nodiscard]] float opacityOf(const ChartCorners& c, const UvMap& uv, const glm::dvec2& cell) const {
    const float stopped = 1.0F - passedPart(material_);
    if (material_.alpha_mode == AlphaMode::kOpaque) return stopped;
    const bool uniform = !texture_ && primitive_.color0.empty();
    const int side = uniform ? 1 : kSamples;
    float sum = 0.0F;
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const glm::dvec2 at = (cell + (glm::dvec2(x, y) + 0.5) / double(side)) / double(surface_.opacity_scale);
        const float alpha = alphaAt(c, uv, at);
        const bool mask = material_.alpha_mode == AlphaMode::kMask;
        sum += mask ? (alpha >= material_.alpha_cutoff ? 1.0F : 0.0F) : std::clamp(alpha, 0.0F, 1.0F);
      }
    }
    return stopped * sum / static_cast<float>(side * side);
  }

  [[nodiscard]] std::uint8_t& cell(std::uint32_t x, std::uint32_t y) {
    return patches_.opacity[surface_.first_opacity + std::size_t{y} * width_ + x];
  }

  void fillTriangle(const ChartCorners& c, std::uint32_t first_row, std::uint32_t end_row) {
    const auto scale = static_cast<double>(surface_.opacity_scale);
    const auto [low, high] = extentOf(c);
    const auto end_x = std::min(width_, static_cast<std::uint32_t>(std::ceil(std::max(high.x, 0.0))));
    const auto end_y = std::min(end_row, static_cast<std::uint32_t>(std::ceil(std::max(high.y, 0.0))));
    const UvMap uv(c, texcoords());
    const std::array<glm::dvec2, 3> cells{c.texel[0] * scale, c.texel[1] * scale, c.texel[2] * scale};
    for (auto y = std::max(first_row, static_cast<std::uint32_t>(std::max(low.y, 0.0))); y < end_y; ++y) {
      interruptionPoint();
      const auto columns = columnsOf(cells, static_cast<int>(y), static_cast<int>(width_));
      const auto end = std::min(end_x, static_cast<std::uint32_t>(columns.end));
      for (auto x =
               std::max(static_cast<std::uint32_t>(std::max(low.x, 0.0)), static_cast<std::uint32_t>(columns.first));
           x < end; ++x) {
        const glm::vec3 w = c.weightsAt((glm::dvec2(x, y) + 0.5) / scale);
        if (std::min({w.x, w.y, w.z}) < -1e-6F) continue;
        cell(x, y) = byteOf(opacityOf(c, uv, glm::dvec2(x, y)));
        known_[std::size_t{y} * width_ + x] = 1;
      }
    }
  }

  [[nodiscard]] std::uint8_t neighbour(std::uint32_t x, std::uint32_t y) {
    for (std::uint32_t ny = y == 0 ? 0 : y - 1; ny < std::min(y + 2, height_); ++ny) {
      for (std::uint32_t nx = x == 0 ? 0 : x - 1; nx < std::min(x + 2, width_); ++nx) {
        if (known_[std::size_t{ny} * width_ + nx] != 0) return cell(nx, ny);
      }
    }
    // Slivers that hold no cell's middle: as the surface would be without a texture.
    const float alpha = material_.alpha_mode == AlphaMode::kBlend ? material_.alpha : 1.0F;
    return byteOf(alpha * (1.0F - passedPart(material_)));
  }

  PatchScene& patches_;
  Surface& surface_;
  const Material& material_;
  const Instance& instance_;
  const Primitive& primitive_;
  std::optional<AlphaTexture> texture_;
  glm::dvec2 texture_size_{0.0};
  std::uint32_t width_ = 0, height_ = 0;
  std::vector<std::uint8_t> known_;  // by cell
  struct Rows {
    std::uint32_t first, end;
  };
  std::vector<Rows> rows_;  // by triangle: that it may reach into
};

/// As fine as wanted, as long as that is not too much.
void chooseScales(PatchScene& patches, std::vector<SurfaceOpacity>& some) {
  std::uint64_t cells = 0;
  for (auto& one : some) {
    one.surface().opacity_scale = one.wantedScale();
    cells += one.cellCount();
  }
  bool coarser = false;
  for (bool more = true; cells > kMaxCells && more;) {
    more = false;
    cells = 0;
    for (auto& one : some) {
      if (one.surface().opacity_scale > 1) {
        one.surface().opacity_scale /= 2;
        more = coarser = true;
      }
      cells += one.cellCount();
    }
  }
  if (coarser) patches.warnings.emplace_back("cut-outs are coarser than their textures: there are too many of them");
  patches.opacity.assign(cells, 255);
  std::uint64_t first = 0;
  for (auto& one : some) {
    one.surface().first_opacity = static_cast<std::uint32_t>(first);
    first += one.cellCount();
  }
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
  std::vector<SurfaceOpacity> some;
  for (Surface& surface : patches.surfaces) {
    if (!surface.see_through) continue;
    surface.glass = glassFace(materialOf(scene, surface));
    some.emplace_back(scene, patches, surface);
  }
  chooseScales(patches, some);
  struct Rows {
    std::size_t of;
    std::uint32_t first, end;
  };
  std::vector<Rows> parts;
  for (std::size_t i = 0; i < some.size(); ++i) {
    const auto rows = some[i].start(), step = std::max(1U, kCellsAtOnce / std::max(1U, some[i].width()));
    for (std::uint32_t first = 0; first < rows; first += step)
      parts.push_back({i, first, std::min(rows, first + step)});
  }
  inTurns(parts.size(), [&](std::size_t i) { some[parts[i].of].fill(parts[i].first, parts[i].end); });
  inTurns(some.size(), [&](std::size_t i) { some[i].fillBorders(); });
}

void applyOpacity(PatchScene& patches) {
  for (const Surface& surface : patches.surfaces) {
    interruptionPoint();
    if (!surface.see_through) continue;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      float opacity = leafOpacity(patches, surface, leaf);
      if (surface.glass.isGlass()) opacity = surface.glass.meanStopped(opacity);
      for (const auto first : surface.first_node) {
        if (first != kNone) patches.node_area[first + leaf] *= opacity;
      }
      if (opacity <= 0.0F) patches.leaves[surface.first_leaf + leaf] = {};
    }
  }
}

}  // namespace radiosity::scene
