// Light gathered from the quads of scenes made by hand.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "server/gpu/workers/gpu_transport.h"
#include "tests/gl/both_sights.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {

/// A gather shot of a quad surface with points on a jittered grid.
[[nodiscard]] solver::ShotBatch gatherFrom(const scene::PatchScene& scene, std::uint32_t surface,
                                           std::uint32_t points_a_side, std::mt19937& random);

/// Irradiance of leaf (x, y), channel 0.
[[nodiscard]] double irradiance(const scene::PatchScene& scene, const solver::FluxAccumulators& flux,
                                std::uint32_t surface, std::uint32_t x, std::uint32_t y);

class Gather : public BothSights {
 protected:
  solver::FluxAccumulators run(const std::shared_ptr<const scene::PatchScene>& scene, const solver::ShotBatch& batch) {
    EXPECT_TRUE(transport_->setScene(scene).has_value());
    auto flux = accumulators(*scene);
    const auto counters = transport_->run(batch, flux);
    EXPECT_TRUE(counters.has_value()) << counters.error().text();
    return flux;
  }
};

}  // namespace radiosity::test
