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

}  // namespace radiosity
