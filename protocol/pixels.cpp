#include "protocol/pixels.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace radiosity::protocol {

std::uint16_t halfFromFloat(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const auto sign = static_cast<std::uint16_t>((bits >> 16) & 0x8000U);
  const auto magnitude = bits & 0x7fffffffU;
  if (magnitude < 0x38800000U) {  // below 2^-14: a multiple of 2^-24, rounded by the addition itself
    const float shifted = std::bit_cast<float>(magnitude) + 0.5F;
    return static_cast<std::uint16_t>(sign | (std::bit_cast<std::uint32_t>(shifted) - 0x3f000000U));
  }
  if (magnitude >= 0x47800000U)  // 65536 and above, infinity, NaN
    return static_cast<std::uint16_t>(sign | (magnitude > 0x7f800000U ? 0x7e00U : 0x7c00U));
  const auto odd = (magnitude >> 13) & 1U;
  return static_cast<std::uint16_t>(sign | ((magnitude - 0x38000000U + 0xfffU + odd) >> 13));
}

float floatFromHalf(std::uint16_t half) {
  const auto sign = static_cast<std::uint32_t>(half & 0x8000U) << 16;
  const std::uint32_t exponent = (half >> 10) & 0x1fU;
  const std::uint32_t mantissa = half & 0x3ffU;
  if (exponent == 0)
    return std::copysign(std::ldexp(static_cast<float>(mantissa), -24), std::bit_cast<float>(sign | 0x3f800000U));
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7f800000U | (mantissa << 13));
  return std::bit_cast<float>(sign | ((exponent + 112) << 23) | (mantissa << 13));
}

std::uint32_t rgb9e5FromFloat(const glm::vec3& value) {
  static constexpr float kLargest = 65408.0F;  // 511/512 x 2^16
  const auto clean = [](float v) { return v > 0.0F ? std::min(v, kLargest) : 0.0F; };
  const glm::vec3 c(clean(value.x), clean(value.y), clean(value.z));
  const float largest = std::max({c.x, c.y, c.z});
  int exponent = 0;  // largest < 2^(exponent - 15)
  if (largest > 0.0F) {
    std::frexp(largest, &exponent);
    exponent = std::clamp(exponent + 15, 0, 31);
  }
  const auto quantize = [&](float v) { return std::lround(std::ldexp(v, 24 - exponent)); };
  if (quantize(largest) == 512) ++exponent;  // rounding carried; kLargest rules out exponent 32
  const auto field = [&](float v) { return static_cast<std::uint32_t>(quantize(v)); };
  return field(c.x) | (field(c.y) << 9) | (field(c.z) << 18) | (static_cast<std::uint32_t>(exponent) << 27);
}

glm::vec3 floatFromRgb9e5(std::uint32_t packed) {
  const int exponent = static_cast<int>(packed >> 27) - 24;
  const auto channel = [&](int shift) { return std::ldexp(static_cast<float>((packed >> shift) & 0x1ffU), exponent); };
  return {channel(0), channel(9), channel(18)};
}

}  // namespace radiosity::protocol
