// One lamp as a probe sees it: estimates of its spherical harmonics by looks at some of its points, in rounds. Pure
// functions of immutable parts; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "server/solver/probes/spherical_harmonics.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// By round and coefficient, by channel.
template <std::uint32_t Rounds>
using RoundHarmonics = std::array<std::array<glm::dvec3, kHarmonics>, Rounds>;

/// Mean over rounds of independent estimates, and the variance of that.
template <std::uint32_t Rounds>
void addRounds(const RoundHarmonics<Rounds>& rounds, std::array<glm::dvec3, kHarmonics>& mean,
               std::array<glm::dvec3, kHarmonics>& variance) {
  constexpr double count = Rounds;
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    glm::dvec3 sum(0.0), squares(0.0);
    for (const auto& round : rounds) sum += round[h];
    const auto middle = sum / count;
    for (const auto& round : rounds) squares += (round[h] - middle) * (round[h] - middle);
    mean[h] += middle;
    variance[h] += squares / (count * (count - 1.0));
  }
}

/// One point of a lamp, seen from a place: for an emission or intensity of one.
struct LampGlimpse {
  glm::dvec3 point{0.0};   ///< unit box
  glm::dvec3 normal{0.0};  ///< of the face on which it lies; 0: on none
  glm::dvec3 way{0.0};     ///< towards it, unit length
  double weight = 0.0;     ///< what all of the lamp would bring across the way if all were like this; 0: nothing
};
[[nodiscard]] LampGlimpse glimpse(const LightPolygon& lamp, const glm::dvec3& place, const glm::dvec2& at);
[[nodiscard]] LampGlimpse glimpse(const PunctualLights::Source& source, const glm::dvec3& place, const glm::dvec2& at);

/// What all of a polygon brings for an emission of one where nothing hides it; all 0 behind it.
[[nodiscard]] std::array<double, kHarmonics> unhiddenHarmonics(const LightPolygon& lamp, const glm::dvec3& place);

}  // namespace radiosity::solver
