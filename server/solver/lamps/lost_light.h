// Where light goes that lights nothing: asked by rays, after a solve, of lamps that may be lost and of rooms that are
// turned inside out. Plain values; one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/patches/side.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/transport/lamp_rays.h"

namespace radiosity::solver {

/// Flux of each light, and then of the upper and the lower half of the sky, and of its picture and sun together, all
/// channels, lux unit^2. A pass over the vertices, and O(1) a light.
[[nodiscard]] std::vector<double> fluxes(const scene::PatchScene& patches, const LightSources& sources);

class LostLight {
 public:
  /// Keeps the first two. `rays`: Solver::rays(); null: makes its own, O(n log n) in triangles. Else a pass over the
  /// sides.
  LostLight(const scene::PatchScene& patches, const scene::PatchMaterials& materials,
            std::shared_ptr<const LeafRays> rays);

  /// What became of a lamp's rays: of kRays, or of fewer where one arrived.
  struct Fate {
    bool arrives = false;                  ///< one at least ends on a lit side
    std::uint32_t sky = 0;                 ///< so many leave the scene
    std::uint32_t back = 0;                ///< end on backs, of single-sided surfaces or without patches
    std::uint32_t beyond = 0;              ///< end beyond the light's range
    std::uint32_t back_of = scene::kNone;  ///< the surface whose back one of them meets
  };
  static constexpr std::uint32_t kRays = 256;
  /// Of all emission of one instance. Cost: up to kRays rays, and a pass over its leaves.
  [[nodiscard]] Fate ofInstance(std::uint32_t instance) const;
  /// Of a light without extent.
  [[nodiscard]] Fate ofLight(const scene::PunctualLight& light);

  /// By instance: the part of the light that ends on backs which ends on those of the instance; largest first, none of
  /// 0. `irradiance`: lux, by node of level 0. Cost: some thousand rays, a pass over all leaves.
  struct Share {
    std::uint32_t instance;
    double part;
  };
  [[nodiscard]] std::vector<Share> backs(std::span<const glm::vec3> irradiance, const LightSources& sources);

 private:
  struct Ray {
    LeafRays::Place from;
    glm::dvec3 direction;
    double weight = 1.0;  ///< 0: nothing is sent there
  };
  /// What sends light, by its flux: leaves, then lights, then the two halves of the sky, then its lamps.
  class Senders;
  [[nodiscard]] Ray ofLeaf(std::uint32_t value, std::uint32_t index, std::uint64_t key) const;
  /// `leaving`: of a light with a size or a web; null of others.
  [[nodiscard]] Ray ofLamp(const scene::PunctualLight& light, const LampRays* leaving, std::uint32_t index,
                           std::uint64_t key) const;
  /// Of a light with a size or a web; none of others.
  [[nodiscard]] std::optional<LampRays> leaving(const scene::PunctualLight& light);
  /// From outside of the scene, against `towards`.
  [[nodiscard]] Ray fromFar(const glm::dvec3& towards, double u, double v) const;
  /// True: it arrives.
  bool follow(const Ray& ray, std::uint64_t key, double range, Fate& fate) const;

  const scene::PatchScene& patches_;
  const scene::PatchMaterials& materials_;
  std::vector<Side> sides_;
  std::vector<std::vector<std::uint32_t>> sides_of_;  ///< by instance: into sides_
  std::shared_ptr<const LeafRays> rays_;
  KnownWebs webs_;
  glm::dvec3 middle_{0.0};
  double radius_ = 0.0;
};

}  // namespace radiosity::solver
