// What worker processes take of a scene, made before it is their turn. A value; any thread.
#pragma once

#include <memory>

#include "server/gpu/workers/shared_memory.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

struct PreparedScene final : solver::Transport::Prepared {
  SharedMemory packed;      ///< packScene()
  Result<void> paper_fits;  ///< whether the scene can be lit in paper mode, and why not

  [[nodiscard]] static Result<std::unique_ptr<Prepared>> make(const scene::PatchScene& patches);
};

}  // namespace radiosity::gpu
