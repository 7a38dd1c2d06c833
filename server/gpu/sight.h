// How it is found out what a light sees. Plain values, any thread.
#pragma once

#include <cstdint>

namespace radiosity::gpu {

enum class Sight : std::uint32_t {
  kAuto,    ///< by rays where the processor draws, by images where a card does
  kRays,    ///< a ray from each receiver to each point of a light
  kImages,  ///< an image from each point of a light
};

/// `software`: the processor draws.
[[nodiscard]] inline Sight sightFor(Sight wanted, bool software) {
  if (wanted != Sight::kAuto) return wanted;
  return software ? Sight::kRays : Sight::kImages;
}

/// Of what was decided on, for reports.
[[nodiscard]] inline const char* sightText(Sight decided) {
  return decided == Sight::kRays ? "lights see by rays" : "lights see by images";
}

}  // namespace radiosity::gpu
