// Which way of finding out what lights see is faster on a machine: both are tried on a furnished room
// (scene/charts/trial_room.h), before there is a scene.
#pragma once

#include <functional>
#include <memory>

#include "common/result.h"
#include "server/gpu/run/sight.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// Four lamps below the ceiling of a room, which look at all of it from eight points each.
[[nodiscard]] solver::ShotBatch trialBatch(const scene::PatchScene& room);

/// What trials of both ways took, seconds.
struct SightTimes {
  double rays = 0.0, images = 0.0;
};

/// Gives the transport the room, and lights it both ways. `see`: makes its lights see in a way from its next scene on.
[[nodiscard]] Result<SightTimes> timeBoth(const std::shared_ptr<const scene::PatchScene>& room,
                                          solver::Transport& transport, const std::function<void(Sight)>& see);

/// Images, which decide by pixels, have to be clearly faster.
[[nodiscard]] Sight fasterSight(const SightTimes& times);

}  // namespace radiosity::gpu
