#include "server/scene/shading/opacity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <vector>

#include "common/give_back.h"
#include "common/parallel.h"
#include "server/geometry/triangle_rows.h"
#include "server/scene/shading/specular.h"
#include "server/scene/values/chart_corners.h"
#include "server/scene/values/leaf_opacity.h"
#include "server/scene/values/material_of.h"
#include "server/scene/values/shade_texture.h"

namespace radiosity::scene {
namespace {

constexpr std::uint64_t kMaxCells = std::uint64_t{1} << 26;
constexpr std::uint32_t kMaxScale = 64;        ///< cells across a leaf
constexpr std::uint32_t kMaxPaneScale = 16;    ///< the same of what is glass all over
constexpr int kSamples = 3;                    ///< kSamples^2 looks at the texture in each cell
constexpr std::uint32_t kCellsAtOnce = 16384;  ///< of one thread, about

constexpr glm::u16vec3 kWhite(PatchScene::kTintSteps);

/// In steps of 1/255; what is no number is 0.
std::uint8_t byteOf(float opacity) {
  return static_cast<std::uint8_t>(std::lround(255.0F * (opacity > 0.0F ? std::min(opacity, 1.0F) : 0.0F)));
}

/// By channel, of what passes of the one that does so best.
glm::u16vec3 tintOf(const glm::vec3& passes) {
  const float most = mostOf(passes);
  if (!(most > 0.0F)) return kWhite;
  return glm::u16vec3(glm::round(static_cast<float>(PatchScene::kTintSteps) * (passes / most)));
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

/// A texture of a material, as a triangle has it.
class LaidTexture {
 public:
  /// `use` and the scene are to outlive it. Nothing where there is no texture.
  static std::optional<LaidTexture> of(const Scene& scene, const Primitive& primitive, const TextureUse& use) {
    if (use.texture >= scene.textures.size()) return std::nullopt;
    return LaidTexture(scene.textures[use.texture], primitive, use);
  }

  /// Pixels of it across a step in the triangle's chart.
  [[nodiscard]] double pixelsAcross(const ChartCorners& c) const {
    const UvMap uv(c, texcoords());
    double most = 1.0;
    for (const auto& step : {uv.across, uv.up}) {
      const double across = glm::length(step * size_ * glm::dvec2(use_->scale));
      if (std::isfinite(across)) most = std::max(most, across);
    }
    return most;
  }
  [[nodiscard]] UvMap over(const ChartCorners& c) const { return {c, texcoords()}; }
  [[nodiscard]] const PlainTexture& pixels() const { return pixels_; }

 private:
  LaidTexture(const Texture& texture, const Primitive& primitive, const TextureUse& use)
      : pixels_(texture, use), use_(&use), primitive_(&primitive), size_(texture.width, texture.height) {}
  [[nodiscard]] const std::vector<glm::vec2>& texcoords() const {
    return use_->texcoord == 1 ? primitive_->texcoord1 : primitive_->texcoord0;
  }

  PlainTexture pixels_;
  const TextureUse* use_;
  const Primitive* primitive_;
  glm::dvec2 size_;
};

/// What passes over one surface: how much, and of which colour.
class SurfaceOpacity {
 public:
  SurfaceOpacity(const Scene& scene, PatchScene& patches, Surface& surface)
      : patches_(patches),
        surface_(surface),
        material_(materialOf(scene, surface)),
        instance_(scene.instances[surface.instance]),
        primitive_(patches.cuts.primitiveOf(scene, surface.instance)) {
    const bool passes = material_.transmission > 0.0F;
    const auto lay = [&](const TextureUse& use, bool is_used) {
      return is_used ? LaidTexture::of(scene, primitive_, use) : std::nullopt;
    };
    base_ = lay(material_.base_color_texture, passes || material_.alpha_mode != AlphaMode::kOpaque);
    part_ = lay(material_.transmission_texture, passes);
    metal_ = lay(material_.metallic_texture, passes && material_.metallic > 0.0F);
    shine_ = lay(material_.specular_texture, passes && material_.specular != glm::vec3(0.0F));
  }

  /// Whether a place may pass one channel better than another.
  [[nodiscard]] bool mayTint() const {
    if (material_.transmission <= 0.0F) return false;
    const auto whole = passedPart(material_, PassingPlace::of(material_));
    return base_ || !primitive_.color0.empty() || tintOf(whole) != kWhite;
  }

  /// Cells across a leaf that follow the pixels of its textures: a power of two.
  [[nodiscard]] std::uint32_t wantedScale() const {
    double pixels = 1.0;  // of the texture, across a leaf
    for (const auto* texture : {&base_, &part_, &metal_, &shine_}) {
      for (std::uint32_t i = 0; *texture && i < std::min(surface_.triangle_count, 64U); ++i)
        pixels = std::max(
            pixels, (*texture)->pixelsAcross(cornersOf(patches_, surface_.first_triangle + i, instance_, primitive_)));
    }
    std::uint32_t scale = 1;
    // What is cut out has edges that show in every shadow; the pattern of a pane need not be so fine.
    const auto most = material_.alpha_mode == AlphaMode::kOpaque ? kMaxPaneScale : kMaxScale;
    while (scale < most && scale < pixels) scale *= 2;
    return scale;
  }

  [[nodiscard]] Surface& surface() { return surface_; }
  [[nodiscard]] std::uint64_t cellCount() const {
    return std::uint64_t{surface_.width} * surface_.height * surface_.opacity_scale * surface_.opacity_scale;
  }

  /// Once the surface has its place among all cells, and among those with tints if it may tint. Returns how many rows
  /// there are.
  std::uint32_t start() {
    has_tints_ = mayTint();
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
        if (known_[std::size_t{y} * width_ + x] == 0) fillLikeNeighbour(x, y);
      }
    }
    giveBack(known_);
    giveBack(rows_);
  }

 private:
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

  /// Of a triangle.
  struct Laid {
    const ChartCorners& corners;
    std::optional<UvMap> base, part, metal, shine;
  };
  [[nodiscard]] Laid over(const ChartCorners& c) const {
    const auto lay = [&](const std::optional<LaidTexture>& texture) {
      return texture ? std::optional<UvMap>(texture->over(c)) : std::nullopt;
    };
    return {c, lay(base_), lay(part_), lay(metal_), lay(shine_)};
  }

  [[nodiscard]] glm::vec4 vertexColour(const ChartCorners& c, const glm::dvec2& p) const {
    if (primitive_.color0.empty()) return glm::vec4(1.0F);
    glm::vec3 w = glm::clamp(c.weightsAt(p), 0.0F, 1.0F);
    w /= w.x + w.y + w.z;  // beyond an edge the rest would be more than all
    const auto& color = primitive_.color0;
    return color[c.vertex[0]] * w[0] + color[c.vertex[1]] * w[1] + color[c.vertex[2]] * w[2];
  }

  /// Of the light straight at it there, by channel.
  [[nodiscard]] glm::vec3 passedAt(const Laid& laid, const glm::dvec2& p, const glm::vec4& vertex) const {
    if (material_.transmission <= 0.0F) return glm::vec3(0.0F);
    auto place = PassingPlace::of(material_);
    place.base *= glm::vec3(vertex);
    if (base_) place.base *= base_->pixels().colourAt(laid.base->at(p));
    if (part_) place.transmission *= part_->pixels().colourAt(laid.part->at(p)).r;
    if (metal_) place.metallic *= metal_->pixels().colourAt(laid.metal->at(p)).b;
    if (shine_) place.specular *= shine_->pixels().colourAt(laid.shine->at(p));
    return passedPart(material_, place);
  }

  /// How much of the surface is there.
  [[nodiscard]] float coverageAt(const Laid& laid, const glm::dvec2& p, float vertex_alpha) const {
    if (material_.alpha_mode == AlphaMode::kOpaque) return 1.0F;
    float alpha = material_.alpha;
    if (base_) alpha *= base_->pixels().alphaAt(laid.base->at(p));
    alpha *= vertex_alpha;
    if (material_.alpha_mode == AlphaMode::kMask) return alpha >= material_.alpha_cutoff ? 1.0F : 0.0F;
    return std::clamp(alpha, 0.0F, 1.0F);
  }

  /// Over a cell, by channel, of the light straight at it.
  [[nodiscard]] glm::vec3 stoppedBy(const Laid& laid, const glm::dvec2& cell) const {
    const bool uniform = !base_ && !part_ && !metal_ && !shine_ && primitive_.color0.empty();
    const int side = uniform ? 1 : kSamples;
    glm::vec3 sum(0.0F);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const glm::dvec2 at = (cell + (glm::dvec2(x, y) + 0.5) / double(side)) / double(surface_.opacity_scale);
        const auto vertex = vertexColour(laid.corners, at);
        sum += coverageAt(laid, at, vertex.a) * (1.0F - passedAt(laid, at, vertex));
      }
    }
    return sum / static_cast<float>(side * side);
  }

  [[nodiscard]] std::size_t cellAt(std::uint32_t x, std::uint32_t y) const {
    return surface_.first_opacity + std::size_t{y} * width_ + x;
  }
  /// Of PatchScene::tints, for one of PatchScene::opacity.
  [[nodiscard]] std::size_t tintCell(std::size_t cell) const {
    return cell - surface_.first_opacity + surface_.first_tint_cell;
  }
  void setCell(std::size_t cell, const glm::vec3& stopped) {
    patches_.opacity[cell] = byteOf(std::min({stopped.r, stopped.g, stopped.b}));
    if (has_tints_) patches_.tints[tintCell(cell)] = tintOf(1.0F - stopped);
  }

  void fillTriangle(const ChartCorners& c, std::uint32_t first_row, std::uint32_t end_row) {
    const auto scale = static_cast<double>(surface_.opacity_scale);
    const auto [low, high] = extentOf(c);
    const auto end_x = std::min(width_, static_cast<std::uint32_t>(std::ceil(std::max(high.x, 0.0))));
    const auto end_y = std::min(end_row, static_cast<std::uint32_t>(std::ceil(std::max(high.y, 0.0))));
    const auto laid = over(c);
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
        setCell(cellAt(x, y), stoppedBy(laid, glm::dvec2(x, y)));
        known_[std::size_t{y} * width_ + x] = 1;
      }
    }
  }

  void fillLikeNeighbour(std::uint32_t x, std::uint32_t y) {
    for (std::uint32_t ny = y == 0 ? 0 : y - 1; ny < std::min(y + 2, height_); ++ny) {
      for (std::uint32_t nx = x == 0 ? 0 : x - 1; nx < std::min(x + 2, width_); ++nx) {
        if (known_[std::size_t{ny} * width_ + nx] == 0) continue;
        const auto to = cellAt(x, y), from = cellAt(nx, ny);
        patches_.opacity[to] = patches_.opacity[from];
        if (has_tints_) patches_.tints[tintCell(to)] = patches_.tints[tintCell(from)];
        return;
      }
    }
    // Slivers that hold no cell's middle: as the surface would be without a texture.
    const float coverage = material_.alpha_mode == AlphaMode::kBlend ? material_.alpha : 1.0F;
    setCell(cellAt(x, y), coverage * (1.0F - passedPart(material_, PassingPlace::of(material_))));
  }

  PatchScene& patches_;
  Surface& surface_;
  const Material& material_;
  const Instance& instance_;
  const Primitive& primitive_;
  std::optional<LaidTexture> base_, part_, metal_, shine_;
  bool has_tints_ = false;
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
  if (coarser)
    patches.warnings.emplace_back(
        "cut-outs, and panes with textures, are coarser than these: there are too many of them");
  patches.opacity.assign(cells, 255);
  std::uint64_t first = 0;
  for (auto& one : some) {
    one.surface().first_opacity = static_cast<std::uint32_t>(first);
    first += one.cellCount();
  }
  first = 0;
  for (auto& one : some) {
    if (!one.mayTint()) continue;
    one.surface().first_tint_cell = static_cast<std::uint32_t>(first);
    first += one.cellCount();
  }
  patches.tints.assign(first, kWhite);
}

/// Of what passes a leaf: by chance as much as of the channel that passes best at each place.
glm::vec3 leafTint(const PatchScene& patches, const Surface& surface, std::uint32_t leaf) {
  glm::dvec3 passes(0.0);
  double most = 0.0;
  forCellsOf(surface, leaf, [&](std::size_t cell) {
    const double passed = 255.0 - static_cast<double>(patches.opacity[cell]);
    most += passed;
    const auto& tint = patches.tints[cell - surface.first_opacity + surface.first_tint_cell];
    passes += passed * glm::dvec3(tint) / static_cast<double>(PatchScene::kTintSteps);
  });
  return most > 0.0 ? glm::vec3(passes / most) : glm::vec3(1.0F);
}

/// Of surfaces that are coloured anywhere.
void measureTints(PatchScene& patches) {
  if (patches.tints.empty()) return;
  for (Surface& surface : patches.surfaces) {
    if (!surface.see_through || surface.first_tint_cell == kNone) continue;
    interruptionPoint();
    const auto cells = std::size_t{surface.width} * surface.height * surface.opacity_scale * surface.opacity_scale;
    const auto of = std::span(patches.tints).subspan(surface.first_tint_cell, cells);
    if (std::ranges::all_of(of, [](const glm::u16vec3& tint) { return tint == kWhite; })) continue;
    surface.first_tint = static_cast<std::uint32_t>(patches.leaf_tints.size());
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf)
      patches.leaf_tints.push_back(leafTint(patches, surface, leaf));
  }
  if (patches.leaf_tints.empty()) patches.tints = {};
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
  measureTints(patches);
}

void applyOpacity(PatchScene& patches) {
  for (const Surface& surface : patches.surfaces) {
    interruptionPoint();
    if (!surface.see_through) continue;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const float opacity = stoppedByLeaf(patches, surface, leaf);
      for (const auto first : surface.first_node) {
        if (first != kNone) patches.node_area[first + leaf] *= opacity;
      }
      if (opacity <= 0.0F) patches.leaves[surface.first_leaf + leaf] = {};
    }
  }
}

}  // namespace radiosity::scene
