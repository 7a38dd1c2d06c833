// The state of a solve: what every node has received (H, as integers) and what every leaf has shot (S). Radiosity and
// unshot radiosity are derived, never accumulated, so that nothing drifts:
//
//   B = E + rho H + tau H of the other side,   H = received / (rounds area),   unshot = rounds B' - S,   B' = the part
//   of B that scatter shots carry.
//
// Rounds: the first shoots until little is left; each further round adds one to `rounds`, which makes the whole B
// unshot once more, to be shot with fresh samples. H is thereby the mean over rounds, and what a round left over is
// carried to the next.
//
// Push-pull is delayed (Lum, Ma and Max 2002, 4.1): a batch only adds flux to the nodes it linked to; a side is pushed
// and pulled when it is about to shoot or to be read. Owned by the Solver; one thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "common/archive.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/side.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

class RadiosityState {
 public:
  /// `other_flux`: what lights that are no surfaces will add, all channels, lux unit^2; for the scale of the integers.
  RadiosityState(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                 double other_flux = 0.0);

  [[nodiscard]] std::vector<Side>& sides() { return sides_; }
  [[nodiscard]] const std::vector<Side>& sides() const { return sides_; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  [[nodiscard]] double fluxScale() const { return flux_scale_; }
  [[nodiscard]] std::uint32_t rounds() const { return rounds_; }

  /// Emission and reflectance of `side` changed: nothing is invalidated, its unshot radiosity follows.
  void setMaterials(const scene::PatchMaterials& materials);

  /// Makes the whole radiosity unshot once more.
  void startRound();

  /// Adds what a batch delivered. Flux that landed on a node without area (a sliver that only the rasteriser saw) goes
  /// to the nearest ancestor that has some, so none is lost.
  void receive(const FluxAccumulators& batch);

  /// Push: irradiance of every leaf. Pull: unshot power of every node. No-op when clean.
  void pushPull(Side& side);
  void pushPullAll();

  /// Sum of |unshot| area over the leaves of the subtree, all channels. Valid after pushPull of the side.
  [[nodiscard]] float nodeRough(std::uint32_t node) const { return node_rough_[node]; }
  /// Unshot flux of the subtree per channel, signed: what the node would shoot as one.
  [[nodiscard]] const glm::vec3& nodeFlux(std::uint32_t node) const { return node_flux_[node]; }
  /// What a node is worth shooting: its net flux, and a part of what varies inside it, which only matters near by.
  [[nodiscard]] float nodePower(std::uint32_t node) const;
  [[nodiscard]] glm::vec3 unshot(const Side& side, std::uint32_t leaf) const {
    return unshot_[side.first_value + leaf];
  }
  [[nodiscard]] glm::vec3 irradiance(const Side& side, std::uint32_t leaf) const {
    return irradiance_[side.first_value + leaf];
  }

  /// Level of the node that last shot for this leaf; 255: none has.
  [[nodiscard]] std::uint8_t shotLevel(const Side& side, std::uint32_t leaf) const {
    return shot_level_[side.first_value + leaf];
  }

  /// The leaves under a node are as good as shot: S becomes rounds B' there. Keeps the pyramids right. Returns the
  /// flux, per channel, that was unshot there.
  glm::dvec3 markShot(Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y);

  /// The node has shot its mean: S grows by the mean of what was unshot; how leaves differ from it stays unshot,
  /// signed. Returns the flux shot, per channel.
  glm::dvec3 markMeanShot(Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y);

  /// Irradiance (lux) by node id for level 0; other levels are 0. Needs pushPullAll().
  [[nodiscard]] std::vector<glm::vec3> nodeIrradiance() const;

  /// Irradiance by leaf value from one of the two independent halves; pushed on the fly. `out` is leaf_count long.
  void halfIrradiance(const Side& side, std::uint32_t half, std::span<glm::vec3> out) const;

  [[nodiscard]] const scene::SideColours& emissions() const { return emission_; }
  [[nodiscard]] glm::vec3 emission(const Side& side, std::uint32_t leaf) const {
    return emission_.side(side.number)[leaf];
  }
  [[nodiscard]] glm::vec3 reflectance(const Side& side, std::uint32_t leaf) const {
    return reflectance_.side(side.number)[leaf];
  }
  /// Radiosity that leaves there since light arrives on the other side. Needs pushPull() of the side.
  [[nodiscard]] glm::vec3 passed(const Side& side, std::uint32_t leaf) const {
    if (side.other == scene::kNone || transmittance_.sideCount() == 0) return glm::vec3(0.0F);
    return transmittance_.side(side.number)[leaf] * irradiance(sides_[side.other], leaf);
  }
  [[nodiscard]] float leafArea(const Side& side, std::uint32_t leaf) const {
    return patches_->node_area[side.first_node + leaf];
  }
  /// Flux that left, or fell on unlit sides, summed over all rounds; integers as in FluxAccumulators.
  [[nodiscard]] const Flux3& escaped() const { return escaped_; }
  [[nodiscard]] const Flux3& backface() const { return backface_; }
  /// Flux of the gather shots that reached leaves, summed over all rounds.
  [[nodiscard]] const Flux3& gathered() const { return gathered_; }
  [[nodiscard]] const Flux3& scattered() const { return scattered_; }

  /// All but patches and materials.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.sides_, self.received_, self.shot_, self.shot_level_, self.irradiance_, self.unshot_, self.node_rough_,
            self.node_flux_, self.escaped_, self.backface_, self.gathered_, self.scattered_, self.flux_scale_,
            self.rounds_);
  }
  /// Whether what visit() read has the sizes that it must.
  [[nodiscard]] bool isWhole() const;

 private:
  void chooseFluxScale(double other_flux);
  void pull(Side& side);
  void pullNode(const Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y);
  void pullAround(Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y);
  [[nodiscard]] glm::vec3 scatterRadiosity(const Side& side, std::uint32_t leaf) const;
  void push(const Side& side);
  void pushHalf(const Side& side, std::uint32_t half, std::vector<glm::dvec3>& density) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  std::vector<Side> sides_;
  scene::SideColours emission_, reflectance_, transmittance_;
  std::array<std::vector<Flux3>, 2> received_;  // by node, H as integers, unpushed
  std::vector<glm::vec3> shot_;                 // by leaf value: S, summed over rounds
  std::vector<std::uint8_t> shot_level_;        // by leaf value
  std::vector<glm::vec3> irradiance_, unshot_;  // by leaf value, derived by pushPull
  std::vector<float> node_rough_;               // by node, derived by pushPull
  std::vector<glm::vec3> node_flux_;            // by node, derived by pushPull
  Flux3 escaped_{}, backface_{}, gathered_{}, scattered_{};
  double flux_scale_ = 1.0;
  std::uint32_t rounds_ = 1;
};

}  // namespace radiosity::solver
