// How a hemicube looks at the scene: the axes of its five faces, shared by the renderer, the culler and the gatherer.
// Plain values, any thread.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "server/gpu/cull/hemicube_weights.h"
#include "server/gpu/gl/shader_constants.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

struct HemicubeAxes {
  glm::vec3 origin, tangent, bitangent, normal;
};

[[nodiscard]] inline HemicubeAxes hemicubeAxes(const solver::HemicubeFrame& frame) {
  return {frame.origin, frame.tangent, glm::cross(frame.normal, frame.tangent), frame.normal};
}

/// One face as hemicube.vert reads it.
struct FaceView {
  glm::vec4 right, up, depth, origin;
  glm::vec4 normal{0.0F};  ///< of the hemicube, where it is the card that leaves out what lies below
};

/// `layer`: where the image goes. `level_bias`: of the shot.
[[nodiscard]] inline std::array<FaceView, RAD_FACES> faceViews(const solver::HemicubeFrame& frame,
                                                               std::uint32_t resolution, float level_bias,
                                                               std::uint32_t layer) {
  const auto axes = hemicubeAxes(frame);
  const auto [across, up] = latticePhase(frame.lattice);
  const auto columns = static_cast<double>(resolution);
  // Sample i must fall on the centre of pixel i: shift by half a pixel less the phase.
  const auto shift_x = static_cast<float>((1.0 - 2.0 * across) / columns);
  const auto shift_top = static_cast<float>((1.0 - 2.0 * up) / columns);
  const auto shift_side = static_cast<float>((1.0 - 2.0 * up) / (columns / 2.0) - 1.0);
  const float footprint = 4.0F / static_cast<float>(resolution * resolution) * std::exp2(2.0F * level_bias);
  const auto origin = axes.origin, t = axes.tangent, b = axes.bitangent, n = axes.normal;
  const auto side = [&](glm::vec3 right, glm::vec3 depth) {
    return FaceView{{right + shift_x * depth, footprint},
                    {2.0F * n + shift_side * depth, 0.0F},
                    {depth, static_cast<float>(layer)},
                    {origin, level_bias},
                    {n, 0.0F}};
  };
  const FaceView top{{t + shift_x * n, footprint},
                     {b + shift_top * n, 0.0F},
                     {n, static_cast<float>(layer)},
                     {origin, level_bias},
                     {n, 0.0F}};
  return {top, side(b, t), side(b, -t), side(t, b), side(t, -b)};
}

}  // namespace radiosity::gpu
