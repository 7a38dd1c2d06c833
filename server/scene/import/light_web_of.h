// The photometric web of a light, for those who show it. Pure functions; any thread.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <vector>

#include "common/result.h"
#include "server/scene/document/document.h"

namespace radiosity::scene {

/// A web with few enough directions to be drawn. Of directions left out the brightest neighbour's candela stay, so that
/// no beam is lost.
struct ShownWeb {
  double lumens = 0.0, most_candela = 0.0;  ///< of all of it
  glm::dvec3 axis{0.0}, across{0.0};        ///< in the lamp's space (WebAxes)
  std::vector<float> polar, azimuth;        ///< degrees, ascending; one azimuth alone stands for all
  std::vector<float> candela;               ///< azimuth by azimuth
};

inline constexpr std::size_t kMostShownPolar = 181, kMostShownAzimuths = 73;

/// Reads the photometric file of a light of EXT_lights_ies. kNotFound: there is no such light. Cost: parses the file.
[[nodiscard]] Result<ShownWeb> lightWebOf(const Document& document, std::size_t light);

}  // namespace radiosity::scene
