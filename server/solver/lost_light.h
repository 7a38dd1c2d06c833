// Where light goes that lights nothing: asked by rays, after a solve, of lamps that may be lost and of rooms that are
// turned inside out. Plain values; one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/patch_scene.h"
#include "server/scene/scene.h"
#include "server/solver/leaf_rays.h"
#include "server/solver/punctual_lights.h"
#include "server/solver/side.h"

namespace radiosity::solver {

/// Flux of single lights, all channels, lux unit^2: as totalFlux(), without a pass over the scene for each.
class LightFlux {
 public:
  /// O(vertices).
  explicit LightFlux(const scene::PatchScene& patches) : patches_(patches), none_(patches, {}, {}) {}

  [[nodiscard]] double of(const scene::PunctualLight& light) const;

 private:
  const scene::PatchScene& patches_;
  PunctualLights none_;
};

class LostLight {
 public:
  /// Keeps the first two. `rays`: Solver::rays(); null: makes its own, O(n log n) in triangles.
  LostLight(const scene::PatchScene& patches, const scene::PatchMaterials& materials,
            std::shared_ptr<const LeafRays> rays);

  /// What became of a lamp's rays: of kRays, or of fewer where one arrived.
  struct Fate {
    bool arrives = false;                  ///< one at least ends on a lit side
    std::uint32_t sky = 0;                 ///< so many leave the scene
    std::uint32_t back = 0;                ///< end on backs of single-sided surfaces
    std::uint32_t beyond = 0;              ///< end beyond the light's range
    std::uint32_t back_of = scene::kNone;  ///< the surface whose back one of them meets
  };
  static constexpr std::uint32_t kRays = 256;
  /// Of all emission of one instance. Cost: up to kRays rays, and a pass over its leaves.
  [[nodiscard]] Fate ofInstance(std::uint32_t instance) const;
  /// Of a light without extent.
  [[nodiscard]] Fate ofLight(const scene::PunctualLight& light) const;

  /// By instance: the part of the light that ends on backs which ends on those of the instance; largest first, none of
  /// 0. `irradiance`: lux, by node of level 0. Cost: some thousand rays, a pass over all leaves.
  struct Share {
    std::uint32_t instance;
    double part;
  };
  [[nodiscard]] std::vector<Share> backs(std::span<const glm::vec3> irradiance, const LightSources& sources) const;

 private:
  struct Ray {
    LeafRays::Place from;
    glm::dvec3 direction;
  };
  /// What sends light, by its flux: leaves, then lights, then the two halves of the sky.
  class Senders;
  [[nodiscard]] Ray ofLeaf(std::uint32_t value, std::uint32_t index, std::uint64_t key) const;
  [[nodiscard]] Ray ofLamp(const scene::PunctualLight& light, std::uint32_t index, std::uint64_t key) const;
  /// From outside of the scene, against `towards`.
  [[nodiscard]] Ray fromFar(const glm::dvec3& towards, double u, double v) const;
  /// True: it arrives.
  bool follow(const Ray& ray, std::uint64_t key, double range, Fate& fate) const;

  const scene::PatchScene& patches_;
  const scene::PatchMaterials& materials_;
  std::vector<Side> sides_;
  std::vector<std::uint32_t> by_instance_;  ///< sides, by the instance of their surface
  std::shared_ptr<const LeafRays> rays_;
  glm::dvec3 middle_{0.0};
  double radius_ = 0.0;
};

}  // namespace radiosity::solver
