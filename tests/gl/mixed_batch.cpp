#include "tests/gl/mixed_batch.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/gl/scene_builder.h"

namespace radiosity::test {

solver::ShotBatch mixedBatch(const scene::PatchScene& scene, std::uint32_t shots) {
  std::mt19937 random(23);
  solver::ShotBatch batch;
  batch.flux_scale = kFluxScale;
  for (std::uint32_t i = 0; i < shots; ++i) {
    batch.scatter.push_back(shotFrom(scene, i % 40, 0.27F, 0.7F, i % 7 == 0 ? 128 : 64, random));
    batch.scatter.back().half = i % 2;
  }
  for (std::uint32_t light = 0; light < 3; ++light) {
    const auto& chart = scene.surfaces[6 + light];
    const auto first = scene.indices[3 * static_cast<std::size_t>(chart.first_triangle)];
    solver::GatherShot shot;
    shot.corner_count = 4;
    for (std::uint32_t i = 0; i < 4; ++i) shot.corners[i] = scene.vertices[first + i].position;
    shot.normal = scene.triangles[chart.first_triangle].normal;
    shot.radiosity = {3.0, 2.0, 1.0 / 3.0};
    shot.first_point = static_cast<std::uint32_t>(batch.points.size());
    shot.point_count = 5;
    shot.half = light % 2;
    for (int i = 0; i < 5; ++i) batch.points.push_back(shotFrom(scene, 6 + light, 0.5F, 0.5F, 64, random).frame);
    batch.gather.push_back(shot);
  }
  return batch;
}

void addLamps(solver::ShotBatch& batch) {
  using Kind = solver::LampShape::Kind;
  batch.webs = {2.0F, 1.0F, 0.0F, 180.0F, 0.0F, 5.0F, 1.0F, 3.0F, 1.0F, 0.0F, 90.0F, 180.0F, 0.0F, 4.0F, 2.0F, 1.0F};
  for (const auto kind : {Kind::kDisc, Kind::kBall, Kind::kRectangle, Kind::kWeb, Kind::kWeb, Kind::kWeb}) {
    solver::LampShot shot;
    const auto number = static_cast<std::uint32_t>(batch.lamps.size());
    shot.shape = {kind, {0.1F * static_cast<float>(number), 0.1F, 0.1F}, {0, 0, -1}, {1, 0, 0}, {0.1F, 0.05F}};
    if (kind == Kind::kWeb) {
      shot.first_web = number < 5 ? 7 : 0;
      shot.web_size = number < 5 ? 9 : 7;
    }
    shot.intensity = {3.0, 0.5, 0.1};
    shot.emitted = {18.0, 3.0, 0.6};
    shot.half = number % 2;
    shot.key = number;
    shot.receivers.count = 4;
    for (std::uint32_t p = 0; p < 4; ++p)
      shot.at[p] = shot.receivers.at[p] = {0.1F + 0.2F * static_cast<float>(p), 0.4F};
    batch.lamps.push_back(shot);
  }
}

void expectSame(const solver::FluxAccumulators& a, const solver::FluxAccumulators& b) {
  EXPECT_EQ(a.node, b.node);
  EXPECT_EQ(a.escaped, b.escaped);
  EXPECT_EQ(a.backface, b.backface);
  EXPECT_EQ(a.scattered, b.scattered);
  EXPECT_EQ(a.gathered, b.gathered);
}

}  // namespace radiosity::test
