// For tests of angles.
#pragma once

#include <numbers>

namespace radiosity::scene::test {

inline constexpr double kDegree = std::numbers::pi / 180.0;  ///< in radians

}  // namespace radiosity::scene::test
