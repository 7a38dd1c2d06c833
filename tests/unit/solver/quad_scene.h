// Scenes of a few rectangles and a transport that casts rays at them: lets the solver be tested without OpenGL,
// importer or chart builder.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <memory>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/transport.h"

namespace radiosity::test {

struct Quad {
  glm::vec3 origin, du, dv;  // corners origin, +du, +du+dv, +dv; front = du x dv
  std::uint32_t width = 8, height = 8;
  glm::vec3 emission{0.0F}, reflectance{0.0F};
  glm::vec3 transmittance{0.0F};  ///< not black: both sides have leaves, and emit and reflect alike
};

struct QuadScene {
  std::shared_ptr<scene::PatchScene> patches;
  scene::PatchMaterials materials;
};

/// Full, unburied leaves; emission and reflectance uniform over a quad.
[[nodiscard]] QuadScene makeQuadScene(const std::vector<Quad>& quads);

/// For cubeQuads().
inline constexpr std::array<float, 6> kDark{}, kGrey{0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F};

/// The six inward faces of a cube of side 1 around the origin, each with `emission[i]`, `reflectance[i]`.
[[nodiscard]] std::vector<Quad> cubeQuads(std::uint32_t leaves, const std::array<float, 6>& emission,
                                          const std::array<float, 6>& reflectance);
/// cubeQuads() of 6 leaves that do not shine, all of one reflectance, without one of its faces.
[[nodiscard]] std::vector<Quad> openCube(std::size_t missing, float reflectance);
/// Form factor from a face of the cube to the one opposite.
inline constexpr double kOpposite = 0.1998248957;

/// Brute force: `rays` cosine-distributed rays a scatter shot, links to leaves; gathered light at leaf centres from the
/// light points with Lambert's formula and shadow rays.
class RayTransport final : public solver::Transport {
 public:
  explicit RayTransport(std::uint32_t rays) : rays_(rays) {}
  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override;
  Result<solver::TransportCounters> run(const solver::ShotBatch& batch, solver::FluxAccumulators& into) override;
  [[nodiscard]] std::string description() const override { return "rays"; }

  std::chrono::milliseconds pause{0};  ///< with each run, as a slow renderer would

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches_; }

 private:
  struct Hit {
    std::uint32_t surface = scene::kNone;
    bool front = false;
    glm::vec2 texel{0.0F};
    float distance = 0.0F;
  };
  [[nodiscard]] std::uint32_t nodeOf(const Hit& hit) const;
  [[nodiscard]] Hit cast(const glm::vec3& origin, const glm::vec3& direction) const;
  void scatter(const solver::ScatterShot& shot, double scale, solver::FluxAccumulators& into) const;
  void gather(const solver::GatherShot& shot, const solver::ShotBatch& batch, solver::FluxAccumulators& into) const;

  /// Irradiance at leaf middles from one direction or point, for an intensity of 1; 0 where hidden.
  template <typename Irradiance>
  void light(const std::array<double, 3>& unit, const std::array<double, 3>& emitted, std::uint32_t half, double scale,
             Irradiance irradiance, solver::FluxAccumulators& into) const;
  void point(const solver::PointShot& shot, double scale, solver::FluxAccumulators& into) const;
  void lamp(const solver::LampShot& shot, const solver::ShotBatch& batch, solver::FluxAccumulators& into) const;
  void parallel(const solver::ParallelShot& shot, const solver::ShotBatch& batch, solver::FluxAccumulators& into) const;

  void countLost(const solver::GatherShot& shot, const solver::ShotBatch& batch, double light_area,
                 solver::FluxAccumulators& into) const;

  std::uint32_t rays_;
  std::shared_ptr<const scene::PatchScene> patches_;
};

}  // namespace radiosity::test
