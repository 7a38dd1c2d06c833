// The patch hierarchies of Lum, Ma and Max (2002), section 4.1: a quadtree for each polygon. A shot adds to the
// unpushed light of the nodes that it reached and to the polygon's unshot power; push and pull are put off until the
// polygon shoots or is shown. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/side.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

class PatchTrees {
 public:
  /// `other_flux`: what lights that are no surfaces will add, all channels, lux unit^2; for the scale of the integers.
  PatchTrees(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
             double other_flux);

  [[nodiscard]] const std::vector<Side>& sides() const { return sides_; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  /// Integers of what shots deliver = flux x this.
  [[nodiscard]] double fluxScale() const { return flux_scale_; }

  /// Step 3 of a shot (section 3): adds to the unpushed light I, and to the polygons' unshot power what they reflect of
  /// it. Flux on a node without area goes to the nearest ancestor that has some. O(nodes).
  void receive(const FluxAccumulators& shot);

  /// Pushes I down to the leaves, which adds to their light and to their unshot radiosity, and pulls unshot power up.
  /// No-op where nothing arrived. O(nodes of the side).
  void pushPull(std::uint32_t side);
  void pushPullAll();

  /// Sum of |unshot| area of a node, all channels, lux unit^2; valid after pushPull of its side.
  [[nodiscard]] double power(std::uint32_t node) const { return power_[node]; }
  [[nodiscard]] double totalPower() const;
  /// The unshot flux of a node, by channel, which is none from now on.
  glm::dvec3 takeUnshot(const NodePlace& node);

  /// By leaf, O(1): light that arrived (lux), and radiosity that is still to be shot.
  [[nodiscard]] const glm::dvec3& irradiance(std::uint32_t leaf_node) const { return irradiance_[leaf_node]; }
  [[nodiscard]] const glm::dvec3& unshot(std::uint32_t leaf_node) const { return unshot_[leaf_node]; }
  [[nodiscard]] glm::vec3 emission(const Side& side, std::uint32_t leaf) const {
    return materials_.emission.side(side.number)[leaf];
  }
  [[nodiscard]] glm::vec3 reflectance(const Side& side, std::uint32_t leaf) const {
    return materials_.reflectance.side(side.number)[leaf];
  }
  /// Of light on the other side of a leaf the part that leaves here.
  [[nodiscard]] glm::dvec3 transmittance(const Side& side, std::uint32_t leaf) const {
    if (side.other == scene::kNone || materials_.transmittance.sideCount() == 0) return glm::dvec3(0.0);
    return glm::dvec3(materials_.transmittance.side(side.number)[leaf]);
  }
  [[nodiscard]] const Side& otherOf(const Side& side) const { return sides_[side.other]; }
  [[nodiscard]] bool letsThrough(const Side& side) const {
    return side.other != scene::kNone && transmittance(side, side.node_count - 1) != glm::dvec3(0.0);
  }
  /// Flux that left the scene, and that fell on unlit sides or on nothing, lux unit^2.
  [[nodiscard]] glm::dvec3 escaped() const;
  [[nodiscard]] glm::dvec3 backface() const;

  /// All but patches and materials.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.sides_, self.unpushed_, self.irradiance_, self.unshot_, self.power_, self.escaped_, self.backface_,
            self.flux_scale_);
  }
  /// Whether what visit() read has the sizes that it must.
  [[nodiscard]] bool isWhole() const;

 private:
  void chooseFluxScale(double other_flux);
  [[nodiscard]] std::uint32_t nodeWithArea(const Side& side, std::uint32_t level, std::uint32_t x,
                                           std::uint32_t y) const;
  void smooth(const Side& side);
  void push(const Side& side);
  void pull(Side& side);
  void pullNode(const Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y);
  [[nodiscard]] double leafPower(std::uint32_t node) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  scene::PatchMaterials materials_;
  std::vector<Side> sides_;
  std::vector<glm::dvec3> unpushed_;             ///< by node: I, as flux, lux unit^2
  std::vector<glm::dvec3> irradiance_, unshot_;  ///< by node, of leaves alone
  std::vector<double> power_;                    ///< by node
  Flux3 escaped_{}, backface_{};
  double flux_scale_ = 1.0;
};

}  // namespace radiosity::solver
