#include "server/gpu/workers/prepared_scene.h"

#include <utility>

#include "server/gpu/draw/paper_ids.h"
#include "server/gpu/workers/worker_protocol.h"

namespace radiosity::gpu {

Result<std::unique_ptr<solver::Transport::Prepared>> PreparedScene::make(const scene::PatchScene& patches) {
  auto packed = packScene(patches);
  if (!packed) return tl::unexpected(packed.error());
  auto prepared = std::make_unique<PreparedScene>();
  prepared->packed = std::move(*packed);
  if (const auto paper = PaperIds::fits(patches); !paper) prepared->paper_fits = tl::unexpected(paper.error());
  return prepared;
}

}  // namespace radiosity::gpu
