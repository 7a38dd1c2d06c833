// Which surfaces emit light, as far as it decides what is seen of faces that lie on each other (PatchScene::seenOrder).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "server/scene/patch_scene.h"
#include "server/scene/scene.h"

namespace radiosity::scene {

[[nodiscard]] inline bool isBright(const glm::vec3& light) {
  return light.r > 0.0F || light.g > 0.0F || light.b > 0.0F;
}

/// Whether a material emits anywhere, as far as its factors tell.
[[nodiscard]] inline bool mayEmit(const Material& material) { return material.emission != glm::vec3(0.0F); }

/// Which triangles emit: their material has emission, and its texture is not black where the triangle shows it, by the
/// box around its texture coordinates. O(pixels) once for each emissive texture, O(1) a triangle.
class Emitters {
 public:
  /// Refers to the scene.
  explicit Emitters(const Scene& scene);
  ~Emitters();
  Emitters(const Emitters&) = delete;
  Emitters& operator=(const Emitters&) = delete;

  /// A triangle of the instance's primitive.
  [[nodiscard]] bool shines(std::uint32_t instance, std::uint32_t triangle) const;

 private:
  class BrightPixels;
  [[nodiscard]] const BrightPixels* pixelsOf(const Material& material) const;

  const Scene& scene_;
  std::vector<std::unique_ptr<const BrightPixels>> of_texture_;  ///< by texture; null: of no emitter
};

/// Fills Surface::emits: some of its triangles do. Needs triangles and their sources.
void findEmitters(const Scene& scene, PatchScene& patches);

}  // namespace radiosity::scene
