// How normals turn where positions are transformed. Pure; any thread.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

namespace radiosity::scene {

/// Turns normals as `m` turns the planes that they stand on, but for their length: its inverse transpose without a
/// division by its determinant, so that it holds for what is flat and for any scale. Its largest element is 1.
[[nodiscard]] glm::dmat3 normalMatrix(const glm::dmat4& m);

}  // namespace radiosity::scene
