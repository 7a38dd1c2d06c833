// How it is found out what a light sees. Plain values, any thread.
#pragma once

#include <cstdint>

namespace radiosity::gpu {

enum class Sight : std::uint32_t {
  kAuto,      ///< by rays where the processor draws, else as kMeasured
  kRays,      ///< a ray from each receiver to each point of a light
  kImages,    ///< an image from each point of a light
  kMeasured,  ///< the faster of the two, tried at start-up (sight_trial.h)
};

/// Whether both ways have to be tried. `software`: the processor draws, and rays were faster in every scene.
[[nodiscard]] inline bool wantsTrial(Sight wanted, bool software) {
  return wanted == Sight::kMeasured || (wanted == Sight::kAuto && !software);
}

/// Without a trial.
[[nodiscard]] inline Sight sightFor(Sight wanted, bool software) {
  if (wanted == Sight::kRays || wanted == Sight::kImages) return wanted;
  return software ? Sight::kRays : Sight::kImages;
}

/// Of what was decided on, for reports.
[[nodiscard]] inline const char* sightText(Sight decided) {
  return decided == Sight::kRays ? "lights see by rays" : "lights see by images";
}

}  // namespace radiosity::gpu
