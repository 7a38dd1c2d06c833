// How much of the light that meets a face of glass at an angle is reflected, and passes. Plain values; any thread. The
// shader see_through.frag has the same law.
#pragma once

#include <algorithm>

namespace radiosity::scene {

struct GlassFace {
  float facing = 0.0F;        ///< reflectance for light straight at it; 0: this is no glass
  bool mirrors_back = false;  ///< the back has no light of its own, and reflects as the front does

  bool operator==(const GlassFace&) const = default;

  [[nodiscard]] bool isGlass() const { return facing > 0.0F; }

  /// Schlick's (1 - cos)^5.
  [[nodiscard]] static float edgeOf(float cosine) {
    const float x = std::clamp(1.0F - cosine, 0.0F, 1.0F);
    return x * x * x * x * x;
  }
  /// Of all light at this angle.
  [[nodiscard]] float reflectance(float edge) const { return isGlass() ? facing + (1.0F - facing) * edge : 0.0F; }
  /// Of the light at this angle that does not pass, where `entered` of what is not reflected passes.
  [[nodiscard]] float reflectanceOfStopped(float edge, float entered) const {
    const float reflected = reflectance(edge), stopped = 1.0F - entered * (1.0F - reflected);
    return stopped > reflected ? reflected / stopped : 1.0F;
  }
  /// Part of the light at this angle that a face stops which stops `straight` of the light straight at it: what enters
  /// passes in the same part, and (1 - R) / (1 - R straight on) is 1 - edge.
  [[nodiscard]] float stopped(float straight, float edge) const {
    return isGlass() ? 1.0F - (1.0F - straight) * (1.0F - edge) : straight;
  }
  /// The same for light from all around: the mean of edge, weighted by the cosine, is 1/21.
  [[nodiscard]] float meanStopped(float straight) const { return stopped(straight, 1.0F / 21.0F); }
};

}  // namespace radiosity::scene
