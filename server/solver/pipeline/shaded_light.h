// What is told of light is for the interpolated normals of a file, where it has some: how much more that is than what
// the equations hold for geometric normals. Owned by LinkedSolver; one thread outside of the calls.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/solver/lamps/crowd.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/links/link_system.h"
#include "server/solver/patches/lights.h"
#include "server/solver/reflected/direct_smoothing.h"
#include "server/solver/reflected/leaf_gather.h"
#include "server/solver/reflected/leaf_shading.h"

namespace radiosity::solver {

/// The shooters of a system, and the lights that some of them are. Views.
struct ShootersAndLights {
  const LinkSystem& system;
  const std::vector<LightPolygon>& lights;
  const std::vector<PunctualLights::Source>& sources;
  const std::vector<Crowd>& crowds;
};

class ShadedLight {
 public:
  /// By half and number of LeafShading: what counts for the shading normal less what does for the geometric one.
  using Values = std::array<std::vector<glm::vec3>, 2>;

  /// Both are to outlive it.
  ShadedLight(const scene::PatchScene& patches, const std::vector<Side>& sides) : patches_(patches), sides_(sides) {}

  /// Nothing is known for these normals until update().
  void shadeFor(std::shared_ptr<const scene::ShadingNormals> normals);
  [[nodiscard]] const LeafShading& shading() const { return shading_; }
  /// All normals are those of the surfaces.
  [[nodiscard]] bool empty() const { return shading_.empty(); }

  /// What smoothing made of the light over links that it was given: by it is scaled what that is more.
  [[nodiscard]] Values factors(const DirectSmoothing::Halves& raw, const DirectSmoothing::Halves& smooth) const;
  /// Of the light of which the next update() tells; empty: as it is.
  void scaleNext(Values factors) { next_factors_ = std::move(factors); }
  /// For light over links, as it was last solved for, and what rays brought, before that is forgotten; null: nothing.
  void update(const ShootersAndLights& from, const LeafGather* gather);
  /// Takes the place of what update() found.
  void set(Values values) { values_ = std::move(values); }
  [[nodiscard]] const Values& values() const { return values_; }
  /// Whether there are as many as there should be.
  [[nodiscard]] bool isWhole() const {
    return values_[0].size() == shading_.size() && values_[1].size() == shading_.size();
  }
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.values_);
  }

  /// Adds to values by node: of this half, or the mean of both (kBothHalves).
  void addTo(std::uint32_t half, std::vector<glm::vec3>& nodes) const { add(values_, half, nodes); }
  /// The same of what comes straight from lights, mean of the halves, scaled by `factors`.
  void addDirectTo(const ShootersAndLights& from, const Values& factors, std::vector<glm::vec3>& nodes) const;
  /// What a leaf lacks of its light is for the shading normal in proportion. `light`: all that it has.
  [[nodiscard]] glm::vec3 correction(std::uint32_t value, const glm::vec3& light, const glm::vec3& lacks) const;

 private:
  [[nodiscard]] Values zeros() const;
  static void scale(const Values& factors, Values& values);
  void addLinks(const ShootersAndLights& from, LinkSystem::From which, Values& values) const;
  void add(const Values& values, std::uint32_t half, std::vector<glm::vec3>& nodes) const;
  [[nodiscard]] ShadingEmitter emitterOf(const Shooter& shooter, const ShootersAndLights& from) const;
  [[nodiscard]] ShadingEmitter emitterOf(const NodePlace& node) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  LeafShading shading_;
  Values values_;
  Values next_factors_;
};

}  // namespace radiosity::solver
