#include "server/scene/shading/emitters.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <vector>

#include "common/task.h"
#include "server/scene/values/shade_texture.h"

namespace radiosity::scene {
namespace {

/// Pixels first .. last of one axis.
struct PixelRange {
  int first, last;
};

/// That lookups between two coordinates may read, neighbours of bilinear ones included. All of them where the
/// coordinates pass the texture's end and it repeats.
PixelRange pixelsBetween(float low, float high, int size, bool repeat, bool mirror) {
  if (!std::isfinite(low) || !std::isfinite(high)) return {0, size - 1};
  if (repeat) {
    const float tile = std::floor(low);
    if (high - tile > 1.0F || std::abs(tile) > 1e6F) return {0, size - 1};
    low -= tile;
    high -= tile;
    if (mirror && std::fmod(std::abs(tile), 2.0F) > 0.5F) {
      const float turned = 1.0F - high;
      high = 1.0F - low;
      low = turned;
    }
  }
  const auto pixel = [&](float at) {
    const float place = std::clamp(at, 0.0F, 1.0F) * static_cast<float>(size);
    return std::clamp(static_cast<int>(std::floor(place)), 0, size - 1);
  };
  return {pixel(low - 0.5F / static_cast<float>(size)), pixel(high + 0.5F / static_cast<float>(size))};
}

/// Bits of those in which there is any light.
unsigned channelsOf(const glm::vec3& light) {
  return (light.r > 0.0F ? 1U : 0U) | (light.g > 0.0F ? 2U : 0U) | (light.b > 0.0F ? 4U : 0U);
}

}  // namespace

/// How many pixels of a texture are not black in all of some channels, by rectangle: a summed-area table (Crow 1984).
class Emitters::BrightPixels {
 public:
  BrightPixels(const Texture& texture, unsigned channels) : width_(texture.width), height_(texture.height) {
    const auto row = static_cast<std::size_t>(width_) + 1;
    sums_.assign(row * (static_cast<std::size_t>(height_) + 1), 0);
    for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
      interruptionPoint();
      std::uint32_t in_row = 0;
      for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x) {
        const auto* p = &texture.rgba[4 * (y * static_cast<std::size_t>(width_) + x)];
        const unsigned bright = (p[0] != 0 ? 1U : 0U) | (p[1] != 0 ? 2U : 0U) | (p[2] != 0 ? 4U : 0U);
        in_row += (bright & channels) != 0U ? 1 : 0;
        sums_[(y + 1) * row + x + 1] = sums_[y * row + x + 1] + in_row;
      }
    }
  }

  [[nodiscard]] bool anyIn(const glm::vec2& low, const glm::vec2& high, const TextureUse& use) const {
    const auto columns = pixelsBetween(low.x, high.x, width_, use.repeat_u, use.mirror_u);
    const auto rows = pixelsBetween(low.y, high.y, height_, use.repeat_v, use.mirror_v);
    const auto sum = [&](int x, int y) {
      return sums_[static_cast<std::size_t>(y) * (static_cast<std::size_t>(width_) + 1) + static_cast<std::size_t>(x)];
    };
    return sum(columns.last + 1, rows.last + 1) - sum(columns.first, rows.last + 1) -
               sum(columns.last + 1, rows.first) + sum(columns.first, rows.first) !=
           0;
  }

 private:
  int width_, height_;
  std::vector<std::uint32_t> sums_;
};

Emitters::Emitters(const Scene& scene, const WallCuts& cuts) : scene_(scene), cuts_(cuts) {
  for (const Material& material : scene.materials) {
    const auto index = material.emissive_texture.texture;
    const auto channels = channelsOf(material.emission);
    if (!mayEmit(material) || index >= scene.textures.size() || bright_.contains({index, channels})) continue;
    const Texture& texture = scene.textures[index];
    const auto bytes = static_cast<std::size_t>(std::max(0, texture.width)) *
                       static_cast<std::size_t>(std::max(0, texture.height)) * 4;
    if (bytes > 0 && texture.rgba.size() >= bytes)
      bright_.emplace(std::pair{index, channels}, std::make_unique<const BrightPixels>(texture, channels));
  }
}

Emitters::~Emitters() = default;

/// Null: without a texture, or without its pixels, a material emits all over.
const Emitters::BrightPixels* Emitters::pixelsOf(const Material& material) const {
  const auto found = bright_.find({material.emissive_texture.texture, channelsOf(material.emission)});
  return found != bright_.end() ? found->second.get() : nullptr;
}

bool Emitters::shines(std::uint32_t instance, std::uint32_t triangle) const {
  const Primitive& primitive = cuts_.primitiveOf(scene_, instance);
  if (primitive.material >= scene_.materials.size()) return false;
  const Material& material = scene_.materials[primitive.material];
  if (!mayEmit(material)) return false;
  const auto* pixels = pixelsOf(material);
  if (pixels == nullptr) return true;
  const auto& use = material.emissive_texture;
  const auto& set = use.texcoord == 1 ? primitive.texcoord1 : primitive.texcoord0;
  const auto corner = [&](std::size_t k) {
    return transformUv(use, set.empty() ? glm::vec2(0.0F) : set[primitive.indices[std::size_t{3} * triangle + k]]);
  };
  const auto a = corner(0), b = corner(1), c = corner(2);
  return pixels->anyIn(glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c)), use);
}

DarkOfEmitters::DarkOfEmitters(const Scene& scene, const PatchScene& patches) {
  if (patches.covered.empty()) return;
  for (const Surface& surface : patches.surfaces) {
    if (surface.emits || surface.material >= scene.materials.size() || !mayEmit(scene.materials[surface.material]))
      continue;
    of_instance_.resize(scene.instances.size());
    auto& triangles = of_instance_[surface.instance];
    triangles.resize(patches.cuts.primitiveOf(scene, surface.instance).indices.size() / 3, false);
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t)
      triangles[patches.triangle_source[t]] = true;
  }
}

void findEmitters(const Scene& scene, PatchScene& patches) {
  const Emitters emitters(scene, patches.cuts);
  for (Surface& surface : patches.surfaces) {
    interruptionPoint();
    surface.emits = false;
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count && !surface.emits; ++t)
      surface.emits = emitters.shines(surface.instance, patches.triangle_source[t]);
  }
}

}  // namespace radiosity::scene
