// Which surfaces emit light, as far as it decides what is seen of faces that lie on each other (PatchScene::seenOrder).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

[[nodiscard]] inline bool isBright(const glm::vec3& light) {
  return light.r > 0.0F || light.g > 0.0F || light.b > 0.0F;
}
/// Of a sky, but for its sun: what is above the horizon, or below it.
[[nodiscard]] inline bool isBright(const Sky& sky, bool above) {
  return isBright(above ? sky.upper : sky.lower) || (sky.picture && sky.strength > 0.0F && sky.picture->shines(above));
}

/// Whether a material emits anywhere, as far as its factors tell.
[[nodiscard]] inline bool mayEmit(const Material& material) { return material.emission != glm::vec3(0.0F); }

/// Which triangles emit: their material has emission, and its texture is not black, in a channel that the factor lets
/// through, where the triangle shows it, by the box around its texture coordinates. O(pixels) once for each emissive
/// texture and set of channels, O(1) a triangle.
class Emitters {
 public:
  /// Refers to the scene, and to what of it is cut.
  Emitters(const Scene& scene, const WallCuts& cuts);
  ~Emitters();
  Emitters(const Emitters&) = delete;
  Emitters& operator=(const Emitters&) = delete;

  /// A triangle of the instance's primitive, as cut.
  [[nodiscard]] bool shines(std::uint32_t instance, std::uint32_t triangle) const;

 private:
  class BrightPixels;
  [[nodiscard]] const BrightPixels* pixelsOf(const Material& material) const;

  const Scene& scene_;
  const WallCuts& cuts_;
  /// By texture and channels of the factor (bits).
  std::map<std::pair<std::uint32_t, unsigned>, std::unique_ptr<const BrightPixels>> bright_;
};

/// What lies on surfaces that emit nothing although their material may, in a scene where faces lie on each other: who
/// draws these must know which of them is seen.
class DarkOfEmitters {
 public:
  /// Of nothing.
  DarkOfEmitters() = default;
  /// Once Surface::emits is known; O(triangles).
  DarkOfEmitters(const Scene& scene, const PatchScene& patches);

  /// A triangle of the instance's primitive.
  [[nodiscard]] bool has(std::size_t instance, std::size_t triangle) const {
    if (instance >= of_instance_.size()) return false;
    const auto& triangles = of_instance_[instance];
    return triangle < triangles.size() && triangles[triangle];
  }
  bool operator==(const DarkOfEmitters&) const = default;

 private:
  std::vector<std::vector<bool>> of_instance_;  ///< by triangle; either may be empty where it has none
};

/// Fills Surface::emits: some of its triangles do. Needs triangles and their sources.
void findEmitters(const Scene& scene, PatchScene& patches);

}  // namespace radiosity::scene
