// Which way of finding out what lights see is faster on a machine: both are tried on a furnished room of the program's
// own, before there is a scene.
#pragma once

#include <memory>

#include "common/result.h"
#include "server/gpu/sight.h"
#include "server/scene/patch_scene.h"
#include "server/solver/transport.h"

namespace radiosity::gpu {

/// A room of about 3,000 triangles and 8,000 texels, and lamps below its ceiling that look at all of it. The same on
/// every machine.
struct SightTrial {
  std::shared_ptr<const scene::PatchScene> room;
  solver::ShotBatch batch;
};

/// Takes some 50 ms.
[[nodiscard]] Result<SightTrial> makeSightTrial();

/// Seconds that the batch takes, the shortest of a few times. The transport's scene is the trial's room.
[[nodiscard]] Result<double> timeTrial(const SightTrial& trial, solver::Transport& transport);

/// What trials of both ways took, seconds.
struct SightTimes {
  double rays = 0.0, images = 0.0;
};

/// Images, which decide by pixels, have to be clearly faster.
[[nodiscard]] Sight fasterSight(const SightTimes& times);

}  // namespace radiosity::gpu
