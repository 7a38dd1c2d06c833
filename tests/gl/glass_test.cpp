// What glass lets pass of a light from far away, at an angle: the same however it is found out what a light sees.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "server/gpu/workers/gpu_transport.h"
#include "server/solver/lamps/punctual_lights.h"
#include "tests/gl/both_sights.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

/// Of the angle between the light and the normals of floor and glass.
constexpr double kCosine = 0.3;

class Glass : public BothSights {
 protected:
  /// Of the light that would fall on a floor, how much does through a wide sheet above it that stops `straight` / 255
  /// of light straight at it.
  [[nodiscard]] double passes(scene::GlassFace face, std::uint8_t straight, bool faces_light) {
    SceneBuilder builder;
    const auto floor = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 16, 16});
    const glm::vec3 across(2, 0, 0), along(0, 2, 0);
    const auto sheet = builder.add(
        {{-1.0F, -1.0F, -0.4F}, faces_light ? across : along, faces_light ? along : across, 8, 8, !face.mirrors_back});
    auto scene = std::make_shared<scene::PatchScene>(*builder.build());
    scene->surfaces[sheet].see_through = true;
    scene->surfaces[sheet].glass = face;
    scene->opacity.assign(64, straight);
    scene::PunctualLight sun{.kind = scene::LightKind::kDirectional, .intensity = {1.0F, 0.0F, 0.0F}};
    sun.direction = {std::sqrt(1.0 - kCosine * kCosine), 0.0, -kCosine};
    return meanOn(*scene, floor, {{sun}, {}}) / kCosine;
  }

 private:
  [[nodiscard]] double meanOn(const scene::PatchScene& scene, std::uint32_t surface,
                              const solver::LightSources& sources) {
    solver::PunctualLights lights(scene, sources, {});
    const auto shared = std::make_shared<const scene::PatchScene>(scene);
    EXPECT_TRUE(transport_->setScene(shared).has_value());
    auto flux = accumulators(scene);
    while (lights.hasSlice(1)) {
      solver::ShotBatch slice;
      lights.addSlice(1, slice);
      slice.flux_scale = kFluxScale;
      const auto counters = transport_->run(slice, flux);
      EXPECT_TRUE(counters.has_value()) << counters.error().text();
    }
    const auto& chart = scene.surfaces[surface];
    double sum = 0.0, area = 0.0;
    for (auto id = chart.first_node[0]; id < chart.first_node[0] + chart.width * chart.height; ++id) {
      sum += static_cast<double>(flux.node[0][id][0] + flux.node[1][id][0]) / kFluxScale;
      area += static_cast<double>(scene.node_area[id]);
    }
    return sum / area;
  }
};

double schlick(double facing) { return facing + (1.0 - facing) * std::pow(1.0 - kCosine, 5.0); }

// 256 leaves x 32 looks, each seen or not: sigma at most 0.5 / sqrt(8192) = 0.6 %.
constexpr double kFourSigma = 0.024;

TEST_P(Glass, PassesWhatFresnelLeavesAtTheAngleFromBothSides) {
  const double truth = (1.0 - 10.0 / 255.0) / 0.96 * (1.0 - schlick(0.04));  // opacity has steps of 1 / 255
  for (const bool mirrors_back : {false, true}) {
    for (const bool faces_light : {false, true})
      EXPECT_NEAR(passes({0.04F, mirrors_back}, 10, faces_light), truth, kFourSigma) << mirrors_back << faces_light;
  }
}

INSTANTIATE_TEST_SUITE_P(Sight, Glass, kBothSights, nameOfSight);

}  // namespace
}  // namespace radiosity::test
