// The energy balance of a report, for tests of solves.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace radiosity::accuracy {

/// All light that is emitted is found again, and chance makes up a fiftieth of it at most.
inline void expectBalance(const nlohmann::json& report) {
  const auto& e = report.at("energy");
  const double emitted = e.at("emitted");
  const double found = e.at("absorbed").get<double>() + e.at("escaped").get<double>() + e.at("backface").get<double>() +
                       e.at("unshot").get<double>() + e.at("imbalance").get<double>();
  EXPECT_NEAR(found / emitted, 1.0, 1e-5);
  EXPECT_LT(std::abs(e.at("imbalance").get<double>()), 0.02 * emitted);
}

}  // namespace radiosity::accuracy
