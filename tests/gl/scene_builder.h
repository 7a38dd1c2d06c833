// Patch scenes made by hand: quads with a grid of leaves each. For tests of the light transport.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <memory>
#include <random>

#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/transport.h"

namespace radiosity::test {

struct Quad {
  glm::vec3 origin, u, v;  ///< corners origin, +u, +u+v, +v; front side: u x v
  std::uint32_t width = 4, height = 4;
  bool double_sided = false;
};

class SceneBuilder {
 public:
  /// Returns the surface's index.
  std::uint32_t add(const Quad& quad);
  /// The six faces of an axis-parallel box, seen from inside (or from outside); first surface's index.
  std::uint32_t addBox(glm::vec3 low, glm::vec3 high, std::uint32_t texels, bool inside);
  /// A square plate of ten faces with two sides, 0.4 wide and 0.005 thick, bevelled above, lying at z = -0.2: thinner
  /// than the pixels of most item buffers. Its first surface.
  std::uint32_t addBevelledPlate();
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> build() const;

 private:
  scene::PatchScene scene_;
};

/// A room of 6 walls with boxes in it (each box: 6 quads), `quads` surfaces in all, about `texels` leaves.
[[nodiscard]] std::shared_ptr<const scene::PatchScene> randomRoom(std::uint32_t quads, std::uint32_t texels,
                                                                  std::uint32_t seed);

/// A shot of flux 1 from a point of a surface, random rotation and lattice.
[[nodiscard]] solver::ScatterShot shotFrom(const scene::PatchScene& scene, std::uint32_t surface, float u, float v,
                                           std::uint32_t resolution, std::mt19937& random);

/// Accumulators of the right size.
[[nodiscard]] solver::FluxAccumulators accumulators(const scene::PatchScene& scene);

/// Flux that reached one side of a surface, all levels, channel 0, both halves.
[[nodiscard]] double fluxAt(const scene::PatchScene& scene, const solver::FluxAccumulators& flux, std::uint32_t surface,
                            double flux_scale, int side = 0);

/// Of the light on such a plate, channel 0: what fell into it, as a part of what fell on it.
[[nodiscard]] double shareInside(const scene::PatchScene& scene, const solver::FluxAccumulators& flux,
                                 std::uint32_t plate);

inline constexpr double kFluxScale = 1099511627776.0;  // 2^40

}  // namespace radiosity::test
