// The photometric web of a lamp as a file tells it. Plain values; used by the server and the codec.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace radiosity::protocol {

struct Web {
  std::uint64_t revision = 0;
  double lumens = 0.0, most_candela = 0.0;
  std::array<double, 3> axis{}, across{};  ///< in the node's space
  std::vector<float> polar, azimuth;       ///< degrees
  std::vector<float> candela;              ///< azimuth by azimuth
};

/// {"revision", "lumens", "candelaMost", "axis", "across", "polar", "azimuth", "candela"}
[[nodiscard]] std::string encodeHttpWeb(const Web& web);

}  // namespace radiosity::protocol
