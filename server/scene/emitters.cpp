#include "server/scene/emitters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <map>
#include <optional>
#include <vector>

#include "server/scene/shade_texture.h"

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

/// One material's emissive texture.
class EmissiveTexture {
 public:
  EmissiveTexture(const Texture& texture, const TextureUse& use) : texture_(texture), use_(use) {}

  /// Whether a pixel is not black that the triangle may show. By the box around its corners: a little more than it
  /// shows.
  [[nodiscard]] bool shines(const Primitive& primitive, std::uint32_t triangle) {
    auto& known = known_[&primitive];
    known.resize(primitive.indices.size() / 3);
    auto& answer = known[triangle];
    if (!answer) answer = looksBright(primitive, triangle);
    return *answer;
  }

 private:
  [[nodiscard]] bool looksBright(const Primitive& primitive, std::uint32_t triangle) const {
    const auto& set = use_.texcoord == 1 ? primitive.texcoord1 : primitive.texcoord0;
    const auto corner = [&](std::size_t k) {
      return transformUv(use_, set.empty() ? glm::vec2(0.0F) : set[primitive.indices[std::size_t{3} * triangle + k]]);
    };
    const auto a = corner(0), b = corner(1), c = corner(2);
    const auto low = glm::min(a, glm::min(b, c)), high = glm::max(a, glm::max(b, c));
    const auto columns = pixelsBetween(low.x, high.x, texture_.width, use_.repeat_u, use_.mirror_u);
    const auto rows = pixelsBetween(low.y, high.y, texture_.height, use_.repeat_v, use_.mirror_v);
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) {
        const auto pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(texture_.width) + static_cast<std::size_t>(x);
        const auto* p = &texture_.rgba[4 * pixel];
        if (p[0] != 0 || p[1] != 0 || p[2] != 0) return true;
      }
    }
    return false;
  }

  const Texture& texture_;
  const TextureUse& use_;
  /// Of many instances of one mesh each triangle is looked at once.
  std::map<const Primitive*, std::vector<std::optional<bool>>> known_;
};

/// Nothing: without one, or without its pixels, a material emits all over.
std::optional<EmissiveTexture> textureOf(const Scene& scene, const Material& material) {
  const auto& use = material.emissive_texture;
  if (use.texture >= scene.textures.size()) return std::nullopt;
  const Texture& texture = scene.textures[use.texture];
  const auto bytes =
      static_cast<std::size_t>(std::max(0, texture.width)) * static_cast<std::size_t>(std::max(0, texture.height)) * 4;
  if (bytes == 0 || texture.rgba.size() < bytes) return std::nullopt;
  return EmissiveTexture(texture, use);
}

}  // namespace

void findEmitters(const Scene& scene, PatchScene& patches) {
  std::map<std::uint32_t, std::optional<EmissiveTexture>> textures;  // by material
  for (Surface& surface : patches.surfaces) {
    surface.emits = surface.material < scene.materials.size() && mayEmit(scene.materials[surface.material]);
    if (!surface.emits) continue;
    auto known = textures.find(surface.material);
    if (known == textures.end())
      known = textures.emplace(surface.material, textureOf(scene, scene.materials[surface.material])).first;
    if (!known->second) continue;
    const Primitive& primitive = scene.primitives[scene.instances[surface.instance].primitive];
    surface.emits = false;
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count && !surface.emits; ++t)
      surface.emits = known->second->shines(primitive, patches.triangle_source[t]);
  }
}

}  // namespace radiosity::scene
