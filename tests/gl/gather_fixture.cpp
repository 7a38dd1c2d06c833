#include "tests/gl/gather_fixture.h"

namespace radiosity::test {

solver::ShotBatch gatherFrom(const scene::PatchScene& scene, std::uint32_t surface, std::uint32_t points_a_side,
                             std::mt19937& random) {
  const auto& chart = scene.surfaces[surface];
  const auto first_vertex = scene.indices[3 * static_cast<std::size_t>(chart.first_triangle)];
  solver::ShotBatch batch;
  batch.flux_scale = kFluxScale;
  solver::GatherShot shot;
  shot.corner_count = 4;
  for (std::uint32_t i = 0; i < 4; ++i) shot.corners[i] = scene.vertices[first_vertex + i].position;
  shot.normal = scene.triangles[chart.first_triangle].normal;
  shot.radiosity = {1.0, 2.0, 0.0};
  shot.point_count = points_a_side * points_a_side;
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  for (std::uint32_t i = 0; i < shot.point_count; ++i) {
    const auto side = static_cast<float>(points_a_side);
    const float u = (static_cast<float>(i % points_a_side) + unit(random)) / side;
    const float v = (static_cast<float>(i / points_a_side) + unit(random)) / side;
    batch.points.push_back(shotFrom(scene, surface, u, v, 64, random).frame);
  }
  batch.gather = {shot};
  return batch;
}

double irradiance(const scene::PatchScene& scene, const solver::FluxAccumulators& flux, std::uint32_t surface,
                  std::uint32_t x, std::uint32_t y) {
  const auto& chart = scene.surfaces[surface];
  const auto id = chart.first_node[0] + y * chart.width + x;
  return static_cast<double>(flux.node[0][id][0]) / kFluxScale / static_cast<double>(scene.node_area[id]);
}

}  // namespace radiosity::test
