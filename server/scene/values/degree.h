#pragma once

#include <numbers>

namespace radiosity::scene {

/// In radians.
inline constexpr double kDegree = std::numbers::pi / 180.0;

}  // namespace radiosity::scene
