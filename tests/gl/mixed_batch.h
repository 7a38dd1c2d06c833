// Shots of several kinds for the tests of whoever carries them out.
#pragma once

#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/transport.h"

namespace radiosity::test {

/// So many scatter shots of two resolutions, and three gather shots, from the first 40 surfaces of a room.
[[nodiscard]] solver::ShotBatch mixedBatch(const scene::PatchScene& scene, std::uint32_t shots);

/// Adds lamps with a size, and two neighbours that share a web beside one with another.
void addLamps(solver::ShotBatch& batch);

/// Bit by bit.
void expectSame(const solver::FluxAccumulators& a, const solver::FluxAccumulators& b);

}  // namespace radiosity::test
