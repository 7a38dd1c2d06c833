// The sky as options and messages write it. Plain values; used by the server's options, the client and the codec.
#pragma once

#include <array>
#include <string>

#include "common/result.h"

namespace radiosity::protocol {

/// Radiance of everything outside the scene, nits: one colour above the horizon, one below it.
struct Sky {
  std::array<double, 3> upper{}, lower{};
  bool operator==(const Sky&) const = default;
};

/// Largest radiance of a channel, nits: a thousand suns.
inline constexpr double kMaxSkyNits = 1e12;

/// "1000", "900,1000,1200" or "900,1000,1200/200,180,150" (above / below the horizon; without "/" both are alike).
/// kBadUsage for anything else.
[[nodiscard]] Result<Sky> parseSky(const std::string& text);

}  // namespace radiosity::protocol
