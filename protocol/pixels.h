// One pixel to its stored form and back. Stored values are those of the wire, before the scale exponent is applied.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

namespace radiosity::protocol {

/// IEEE binary16, round to nearest even. |value| must be below 65520.
[[nodiscard]] std::uint16_t halfFromFloat(float value);
/// Exact. Infinities and NaNs come out as such.
[[nodiscard]] float floatFromHalf(std::uint16_t half);

/// Shared exponent of EXT_texture_shared_exponent (R in bits 0-8, G 9-17, B 18-26, exponent 27-31); negative channels
/// become 0, channels above 65408 become 65408.
[[nodiscard]] std::uint32_t rgb9e5FromFloat(const glm::vec3& value);
[[nodiscard]] glm::vec3 floatFromRgb9e5(std::uint32_t packed);

}  // namespace radiosity::protocol
