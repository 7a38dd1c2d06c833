// Many small lamps, of which a receiver draws one with a chance that is about in proportion to what it brings: a
// tree over light polygons, eight children a node, which know their flux, their bounds and a cone around their normals.
// Immutable; any thread. Source: A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree
// Splitting", PACMCGIT 1(2), 2018, without the splitting.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/patches/lights.h"

namespace radiosity::solver {

class LightTree {
 public:
  /// `strengths`: exitance by light, positive, any unit. O(n log^2 n).
  LightTree(std::vector<LightPolygon> lights, std::span<const float> strengths);

  struct Draw {
    std::uint32_t light = scene::kNone;  ///< kNone: no light can reach the receiver
    double chance = 0.0;                 ///< with which it is drawn
  };
  /// For a receiver at `position` (unit box) with the unit `normal`. `u`, in [0, 1), is used up to its last digits:
  /// numbers that are spread evenly draw lights that are. Every light before the receiver that faces it has a chance.
  /// Cost: O(log n), some tens of nanoseconds a level of eight.
  [[nodiscard]] Draw draw(const glm::vec3& position, const glm::vec3& normal, double u) const;

  /// Those that may bring a receiver at `position` more than `form_factor` each, by their areas and the distance of
  /// their boxes, whatever way it faces: into `lights`. False: there are more than `most`. Cost: of those found, and
  /// O(log n).
  [[nodiscard]] bool findNear(const glm::vec3& position, float form_factor, std::size_t most,
                              std::vector<std::uint32_t>& lights) const;

  [[nodiscard]] std::span<const LightPolygon> lights() const { return lights_; }
  [[nodiscard]] double strength(std::uint32_t light) const { return static_cast<double>(strengths_[light]); }
  /// Of all lights: strengths times areas, unit box squared.
  [[nodiscard]] double flux() const { return flux_; }
  /// A light drawn in proportion to its flux; `u` in [0, 1), which is in [0, 1) again within it afterwards.
  [[nodiscard]] std::uint32_t byFlux(double& u) const;

 private:
  static constexpr std::size_t kChildren = 8;
  /// Lights in some box: flux, and a cone around their normals.
  struct Bounds {
    glm::vec3 low{0.0F}, high{0.0F};
    glm::vec3 axis{0.0F};
    float cosine = 1.0F;  ///< of the angle around the axis that holds all normals; -1: they point anywhere
    float flux = 0.0F;
    float largest = 0.0F;  ///< area of a light
  };
  /// A part of the lights, and the two that it falls into, while the tree is built.
  struct Half;
  /// Children as structure of arrays; those that are not there have no flux.
  struct alignas(32) Node {
    using Lanes = std::array<float, kChildren>;
    Lanes x{}, y{}, z{}, radius_square{};  ///< around their boxes
    Lanes axis_x{}, axis_y{}, axis_z{}, cosine{}, sine{};
    Lanes flux{};
    Lanes half_x{}, half_y{}, half_z{};            ///< of their boxes
    Lanes largest{};                               ///< area of a light; 0: there is no such child
    std::array<std::uint32_t, kChildren> child{};  ///< a node, or kLight and a light
  };
  static constexpr std::uint32_t kLight = 1U << 31U;

  void split(std::vector<Half>& halves, std::size_t at);
  [[nodiscard]] Bounds around(std::span<const std::uint32_t> lights) const;
  std::uint32_t addNode(const std::vector<Half>& halves, std::size_t at);
  static void importance(const Node& node, const glm::vec3& position, const glm::vec3& normal, float* of_child);

  std::vector<LightPolygon> lights_;
  std::vector<float> strengths_;
  std::vector<glm::vec3> middles_;    ///< while it is built
  std::vector<std::uint32_t> order_;  ///< likewise
  std::vector<Node> nodes_;           ///< the root first
  std::vector<double> flux_before_;   ///< by light: of all before it
  double flux_ = 0.0;
};

}  // namespace radiosity::solver
