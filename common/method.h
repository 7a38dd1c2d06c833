// How a scene is solved. Plain values, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace radiosity {

enum class Method : std::uint8_t {
  kGather,    ///< lamps shoot, texels gather the reflected light along rays (the default)
  kShooting,  ///< progressive shooting in rounds, until the stated error is reached; remembers no links
  kPaper,     ///< Lum, Ma and Max 2002: progressive shooting through hemicubes of mipmapped patch IDs
};

inline constexpr std::array<std::string_view, 3> kMethodNames{"gather", "shooting", "paper"};
inline constexpr const char* kMethodNamesText = "gather, shooting, paper";

[[nodiscard]] constexpr std::string_view nameOf(Method method) {
  return kMethodNames[static_cast<std::size_t>(method)];
}

/// None: no such method.
[[nodiscard]] constexpr std::optional<Method> methodFrom(std::string_view name) {
  for (std::size_t i = 0; i < kMethodNames.size(); ++i)
    if (kMethodNames[i] == name) return static_cast<Method>(i);
  return std::nullopt;
}

/// Whether the program chooses the sizes of texels: not where one size was asked for, nor in paper mode, which has
/// patches alike.
[[nodiscard]] constexpr bool choosesTexels(bool adaptive, double texel_size_m, Method method) {
  return adaptive && texel_size_m <= 0.0 && method != Method::kPaper;
}

/// Texels of a scene unless another number is named: all alike, and the most where the program chooses them.
inline constexpr std::uint64_t kTexels = 24'000, kMostTexels = 1'000'000;
[[nodiscard]] constexpr std::uint64_t usualTexels(bool chosen) { return chosen ? kMostTexels : kTexels; }

}  // namespace radiosity
