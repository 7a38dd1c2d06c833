// Mirrors that are flat and smooth, by the planes that they lie in: what is seen in one is seen as its image behind the
// plane. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/side.h"
#include "server/solver/rays/specular_leaves.h"

namespace radiosity::solver {

class FlatMirrors {
 public:
  /// Lobes of microfacets of such a roughness are a third of a degree wide.
  static constexpr float kSharp = 0.05F;

  struct Plane {
    glm::dvec3 normal{0.0};          ///< unit
    double distance = 0.0;           ///< of its points along the normal, unit box
    glm::dvec3 low{0.0}, high{0.0};  ///< box around its mirrors
    double area = 0.0;               ///< of these, times what they reflect of light from all around

    [[nodiscard]] double heightOf(const glm::dvec3& point) const;
    [[nodiscard]] glm::dvec3 mirrored(const glm::dvec3& point) const;
    [[nodiscard]] glm::dvec3 mirroredWay(const glm::dvec3& way) const;
  };

  /// The `most` planes of whose mirrors most light may come. Null: there are none. O(leaves).
  [[nodiscard]] static std::shared_ptr<const FlatMirrors> find(const scene::PatchScene& patches,
                                                               const std::vector<Side>& sides,
                                                               const SpecularLeaves& mirrors, std::size_t most);

  [[nodiscard]] const std::vector<Plane>& planes() const { return planes_; }
  static constexpr std::uint8_t kNoPlane = 255;
  /// By leaf value: the number of the plane of the mirror there, or kNoPlane.
  [[nodiscard]] std::uint8_t planeOf(std::uint32_t value) const { return plane_of_[value]; }

 private:
  FlatMirrors() = default;

  std::vector<Plane> planes_;
  std::vector<std::uint8_t> plane_of_;
};

}  // namespace radiosity::solver
