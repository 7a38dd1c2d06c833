// Which way of finding out what lights see is faster on a machine: both are tried on a furnished room
// (scene/charts/trial_room.h), before there is a scene.
#pragma once

#include "common/result.h"
#include "server/gpu/run/sight.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// Four lamps below the ceiling of a room, which look at all of it from eight points each.
[[nodiscard]] solver::ShotBatch trialBatch(const scene::PatchScene& room);

/// Seconds that the batch takes, the shorter of two times. The transport's scene is the room.
[[nodiscard]] Result<double> timeTrial(const solver::ShotBatch& batch, solver::Transport& transport);

/// What trials of both ways took, seconds.
struct SightTimes {
  double rays = 0.0, images = 0.0;
};

/// Images, which decide by pixels, have to be clearly faster.
[[nodiscard]] Sight fasterSight(const SightTimes& times);

}  // namespace radiosity::gpu
