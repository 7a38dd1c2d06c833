// Suites whose tests hold whichever way it is found out what a light sees.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "server/gpu/run/sight.h"
#include "server/gpu/workers/gpu_transport.h"

namespace radiosity::test {

inline const auto kBothSights = ::testing::Values(gpu::Sight::kImages, gpu::Sight::kRays);

inline std::string nameOfSight(const ::testing::TestParamInfo<gpu::Sight>& info) {
  return info.param == gpu::Sight::kRays ? "Rays" : "Images";
}

/// A transport in this process that finds it out the one way or the other.
class BothSights : public ::testing::TestWithParam<gpu::Sight> {
 protected:
  void SetUp() override {
    auto made = gpu::makeInProcessTransport(0, std::nullopt, GetParam());
    if (!made) GTEST_SKIP() << made.error().text();
    transport_ = std::move(*made);
  }

  std::unique_ptr<solver::Transport> transport_;
};

}  // namespace radiosity::test
