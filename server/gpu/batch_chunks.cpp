#include "server/gpu/batch_chunks.h"

#include <algorithm>
#include <span>

#include "server/gpu/worker_protocol.h"
#include "server/solver/shot_cost.h"

namespace radiosity::gpu {
namespace {

/// A chunk costs a message there and back (about 50 us with the wake-up): it should take well over a millisecond.
constexpr double kMinChunkCost = 500'000.0;  // pixels
/// So many chunks for each worker even out the differences between them.
constexpr double kChunksPerWorker = 8.0;
/// Links of so many shots fit into one report.
constexpr std::size_t kMaxShots = 64;

template <typename Shot>
void cut(const std::vector<Shot>& shots, bool gather, double target, const solver::ShotCost& cost,
         std::vector<Chunk>& chunks) {
  double sum = 0.0;
  std::size_t first = 0;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    sum += cost(shots[i]);
    if (sum < target && i + 1 < shots.size() && i + 1 - first < kMaxShots) continue;
    chunks.push_back({gather, first, i + 1 - first, sum});
    first = i + 1;
    sum = 0.0;
  }
}

}  // namespace

std::vector<Chunk> cutBatch(const solver::ShotBatch& batch, std::size_t triangles, std::size_t workers) {
  const solver::ShotCost cost{static_cast<double>(triangles)};
  double total = 0.0;
  for (const auto& shot : batch.scatter) total += cost(shot);
  for (const auto& shot : batch.gather) total += cost(shot);
  // Small batches still give every worker something to do.
  const double share = total / static_cast<double>(workers);
  const double target = std::min(std::max(kMinChunkCost, share / kChunksPerWorker), share);
  std::vector<Chunk> chunks;
  cut(batch.gather, true, target, cost, chunks);
  cut(batch.scatter, false, target, cost, chunks);
  return chunks;
}

std::vector<std::byte> packChunk(const solver::ShotBatch& batch, const Chunk& chunk, std::uint64_t id,
                                 bool measure) {
  std::vector<solver::GatherShot> gather;
  std::vector<solver::HemicubeFrame> points;
  std::span<const solver::ScatterShot> scatter;
  if (chunk.gather) {
    for (std::size_t i = chunk.first; i < chunk.first + chunk.count; ++i) {
      auto shot = batch.gather[i];
      const auto first = batch.points.begin() + shot.first_point;
      shot.first_point = static_cast<std::uint32_t>(points.size());
      points.insert(points.end(), first, first + shot.point_count);
      gather.push_back(shot);
    }
  } else {
    scatter = std::span(batch.scatter).subspan(chunk.first, chunk.count);
  }
  ChunkBody head;
  head.chunk = id;
  head.flux_scale = batch.flux_scale;
  head.mode = static_cast<std::uint32_t>(batch.mode);
  head.measure = measure ? 1 : 0;
  head.scatter = static_cast<std::uint32_t>(scatter.size());
  head.gather = static_cast<std::uint32_t>(gather.size());
  head.points = static_cast<std::uint32_t>(points.size());
  std::vector<std::byte> body;
  appendValue(body, head);
  appendSpan(body, scatter);
  appendSpan(body, std::span<const solver::GatherShot>(gather));
  appendSpan(body, std::span<const solver::HemicubeFrame>(points));
  return body;
}

}  // namespace radiosity::gpu
