// Direct light of a polygon at every leaf: exact form factor times visibility, which item buffers rendered from points
// on the light decide. One thread.
//
// A leaf is hidden from a light point only if it lies behind the plane of the triangle seen in its direction: no depth
// bias, hence no acne, and light does not leak under blocks.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "server/gpu/flux_sink.h"
#include "server/gpu/hemicube_renderer.h"
#include "server/gpu/hemicube_weights.h"

namespace radiosity::gpu {

class LightGatherer {
 public:
  LightGatherer() = default;
  explicit LightGatherer(std::shared_ptr<const scene::PatchScene> patches);

  void gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points, double flux_scale,
              HemicubeRenderer& renderer, WeightCache& weights, const FluxSink& sink,
              solver::TransportCounters& counters);

 private:
  /// A side of a leaf that can receive light.
  struct Receiver {
    std::uint32_t node, triangle;
    glm::vec2 texel;  ///< corner of the leaf when full, else the point itself
    bool full;
    float side;  ///< +1 front, -1 back
  };
  struct Plane {
    glm::vec3 normal;
    float distance;
  };
  /// Receivers that the polygon faces and that face it, with what the points found so far.
  struct Lit {
    std::vector<float> x, y, z, nx, ny, nz;
    std::vector<float> weight, visible_weight, visible;
    std::vector<double> form_factor;
    std::vector<std::uint32_t> receiver;
    std::vector<std::uint32_t> pixel;
  };

  void findLit(const solver::GatherShot& shot);
  void testPoint(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                 std::span<const std::uint32_t> items);
  void weighLost(const solver::HemicubeFrame& point, std::span<const std::uint32_t> items,
                 const HemicubeWeights& weights, std::uint64_t& escaped, std::uint64_t& absorbed);
  void deliver(const solver::GatherShot& shot, double flux_scale, const FluxSink& sink,
               solver::TransportCounters& counters) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  std::vector<Receiver> receivers_;
  std::vector<Plane> planes_;                 ///< by triangle
  std::vector<std::array<bool, 2>> absorbs_;  ///< by triangle: front, back
  solver::GatherShot lit_for_;                ///< what lit_ was made for
  bool lit_valid_ = false;
  Lit lit_;
  std::vector<std::uint32_t> starts_;
};

}  // namespace radiosity::gpu
