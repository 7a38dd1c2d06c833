// Suites whose tests hold whichever way it is found out what a light sees.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "server/gpu/run/sight.h"

namespace radiosity::test {

inline const auto kBothSights = ::testing::Values(gpu::Sight::kImages, gpu::Sight::kRays);

inline std::string nameOfSight(const ::testing::TestParamInfo<gpu::Sight>& info) {
  return info.param == gpu::Sight::kRays ? "Rays" : "Images";
}

}  // namespace radiosity::test
