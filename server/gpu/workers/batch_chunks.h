// Cuts a batch into chunks of similar cost that workers take one after another. Pure values.
#pragma once

#include <cstdint>
#include <vector>

#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

enum class ShotKind { kScatter, kGather, kPoint, kParallel, kLamp };

/// Consecutive shots of one kind.
struct Chunk {
  ShotKind kind = ShotKind::kScatter;
  std::size_t first = 0, count = 0;
  double cost = 0.0;  ///< pixels, and what takes as long as so many
};

/// Of the scene: what decides how many shots go into a chunk.
struct SceneSize {
  std::size_t triangles = 0, nodes = 0;
};

/// Who shares a batch: processes, and the threads of each.
struct Workforce {
  std::size_t workers = 1, hands = 1;
};

/// Gather shots first: they are the longest. Cost of a shot: its pixels and, for each hemicube, the scene's triangles
/// and the receivers that look. The links of a chunk, which travel and wait for their turn, take some 16 MiB a worker's
/// hand at most (and 256 MiB in all), or are those of one shot.
[[nodiscard]] std::vector<Chunk> cutBatch(const solver::ShotBatch& batch, const SceneSize& scene,
                                          const Workforce& force);

struct ChunkId {
  std::uint64_t batch = 0, chunk = 0;
};
/// The chunk as the body of a message; `measure`: links are wanted, shot by shot.
[[nodiscard]] std::vector<std::byte> packChunk(const solver::ShotBatch& batch, const Chunk& chunk, const ChunkId& id,
                                               bool measure);

}  // namespace radiosity::gpu
