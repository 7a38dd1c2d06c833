// From what leaves have on average to what their texels are to say, so that bilinear lookups come closest to the light
// there is. Pure functions of values; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// By node of level 0 (index = node id; other levels are ignored), irradiance, lux.
struct LeafLight {
  std::vector<glm::vec3> mean;
  /// Of two independent halves of the samples, the first less the second; empty: the mean has no noise.
  std::vector<glm::vec3> difference = {};
  bool is_shown_as_is = false;  ///< texels are to hold the mean
};

/// Values of texels whose lookups, averaged over the visible part of a leaf, come to the leaf's mean. With the mean
/// itself a lookup smooths twice, by the leaf and between texels, and says of the middle of a leaf what the visible
/// part has, wherever it lies. One step of the iteration of Van Cittert (1931) for that equation ("least squares" of
/// Kavan, Bargteil and Sloan 2011 needs samples within leaves): at the edge of a shadow as wide as a leaf the square of
/// the error falls to 0.72 of what it was, of wider ones to 0.5, of a step to 0.95.
///
/// Noise would grow likewise: a step counts as far as both halves agree on it (Wiener 1949). What lies beyond all
/// neighbours is taken back by half, since one sees a rim along a shadow. Never below zero. Cost: two passes over the
/// leaves, on all cores.
[[nodiscard]] std::vector<glm::vec3> fitTexels(const PatchScene& patches, const LeafLight& light);

}  // namespace radiosity::scene
