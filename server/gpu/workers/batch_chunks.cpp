#include "server/gpu/workers/batch_chunks.h"

#include <algorithm>
#include <span>

#include "server/gpu/workers/worker_protocol.h"
#include "server/solver/transport/shot_cost.h"

namespace radiosity::gpu {
namespace {

/// A chunk costs a message there and back (about 50 us with the wake-up): it should take well over a millisecond.
constexpr double kMinChunkCost = 60'000.0;  // pixels
/// A chunk is at most this part of a worker's share of the batch, and of its share of what is left: the last ones are
/// small, so that all workers come to their end together.
constexpr double kLargestPart = 1.0 / 8.0;
constexpr double kPartOfRest = 1.0 / 3.0;
/// Of workers with many hands, who come to their end together by themselves: something for each to do, several times,
/// and so many chunks that the links of one can be taken in while the next is worked on.
constexpr double kLargestPartOfMany = 1.0 / 4.0;
constexpr std::size_t kShotsAHand = 4;
/// Links of so many shots fit into one report, in scenes where those of one shot are few.
constexpr std::size_t kMaxShots = 64;
constexpr std::size_t kMaxLinkBytes = std::size_t{16} << 20, kMaxLinkBytesOfMany = std::size_t{256} << 20;

/// A link is a float; at most every node has one.
std::size_t maxShots(std::size_t nodes, std::size_t hands) {
  const auto bytes = std::min(kMaxLinkBytes * hands, kMaxLinkBytesOfMany);
  return std::clamp<std::size_t>(bytes / (sizeof(float) * std::max<std::size_t>(nodes, 1)), 1, kMaxShots * hands);
}

/// What a batch is cut by.
struct Cutter {
  solver::ShotCost cost;
  std::size_t most;  ///< shots of a chunk
  double share;      ///< cost of a worker's share of the batch
  double left;       ///< what it costs to do what is not cut yet, a worker's share
  Workforce force;
  std::vector<Chunk> chunks;

  /// Small batches still give every worker something to do.
  [[nodiscard]] double target() const {
    if (force.hands > 1) return kLargestPartOfMany * share;
    return std::min(std::max(kMinChunkCost, std::min(kLargestPart * share, kPartOfRest * left)), share);
  }

  template <typename Shot>
  void cut(const std::vector<Shot>& shots, ShotKind kind) {
    double sum = 0.0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < shots.size(); ++i) {
      sum += cost(shots[i]);
      const std::size_t count = i + 1 - first;
      const bool full = count >= most || (sum >= target() && (force.hands == 1 || count >= kShotsAHand * force.hands));
      if (!full && i + 1 < shots.size()) continue;
      chunks.push_back({kind, first, count, sum});
      left -= sum / static_cast<double>(force.workers);
      first = i + 1;
      sum = 0.0;
    }
  }
};

/// What a chunk refers to, gathered into arrays of its own.
struct Packed {
  std::vector<solver::LampShot> lamps;
  std::vector<float> webs;
  std::vector<solver::GatherShot> gather;
  std::vector<solver::HemicubeFrame> points;
  std::vector<solver::ParallelShot> parallel;
  std::vector<solver::ParallelView> views;
  std::vector<solver::NodeRun> receivers;
  std::vector<scene::ChangedBox> boxes;
};

/// The directions of a sky come once, even where several shots of the chunk are parts of it.
void packParallel(const solver::ShotBatch& batch, const Chunk& chunk, Packed& packed) {
  std::uint32_t sky_from = 0, sky_to = 0;
  for (std::size_t i = chunk.first; i < chunk.first + chunk.count; ++i) {
    auto shot = batch.parallel[i];
    const bool sky = shot.sky_count > 0;
    const auto from = sky ? shot.first_of_sky : shot.first_view;
    const auto count = sky ? shot.sky_count : shot.view_count;
    const bool known = sky && i > chunk.first && packed.parallel.back().sky_count > 0 && from == sky_from;
    if (!known) {
      sky_from = from;
      sky_to = static_cast<std::uint32_t>(packed.views.size());
      packed.views.insert(packed.views.end(), batch.views.begin() + from, batch.views.begin() + from + count);
    }
    shot.first_view = shot.first_view - from + sky_to;
    if (sky) shot.first_of_sky = sky_to;
    packed.parallel.push_back(shot);
  }
}

void packGather(const solver::ShotBatch& batch, const Chunk& chunk, Packed& packed) {
  for (std::size_t i = chunk.first; i < chunk.first + chunk.count; ++i) {
    auto shot = batch.gather[i];
    const auto first = batch.points.begin() + shot.first_point;
    shot.first_point = static_cast<std::uint32_t>(packed.points.size());
    packed.points.insert(packed.points.end(), first, first + shot.point_count);
    const auto runs = batch.receivers.begin() + shot.first_run;
    const auto boxes = batch.boxes.begin() + shot.first_box;
    shot.first_run = static_cast<std::uint32_t>(packed.receivers.size());
    packed.receivers.insert(packed.receivers.end(), runs, runs + shot.run_count);
    // Nearly always all shots of a batch name the same boxes.
    const bool known = i > chunk.first && shot.box_count > 0 && batch.gather[i - 1].first_box == shot.first_box &&
                       batch.gather[i - 1].box_count == shot.box_count;
    shot.first_box = known ? packed.gather.back().first_box : static_cast<std::uint32_t>(packed.boxes.size());
    if (!known) packed.boxes.insert(packed.boxes.end(), boxes, boxes + shot.box_count);
    packed.gather.push_back(shot);
  }
}

/// Neighbours that share a web do so here, too.
void packLamps(const solver::ShotBatch& batch, const Chunk& chunk, Packed& packed) {
  for (std::size_t i = chunk.first; i < chunk.first + chunk.count; ++i) {
    auto shot = batch.lamps[i];
    const auto web = batch.webs.begin() + shot.first_web;
    const bool known = i > chunk.first && batch.lamps[i - 1].first_web == shot.first_web &&
                       batch.lamps[i - 1].web_size == shot.web_size;
    shot.first_web = known ? packed.lamps.back().first_web : static_cast<std::uint32_t>(packed.webs.size());
    if (!known) packed.webs.insert(packed.webs.end(), web, web + shot.web_size);
    packed.lamps.push_back(shot);
  }
}

}  // namespace

std::vector<Chunk> cutBatch(const solver::ShotBatch& batch, const SceneSize& scene, const Workforce& force) {
  const solver::ShotCost cost{static_cast<double>(scene.triangles), static_cast<double>(scene.nodes)};
  const std::size_t most = maxShots(scene.nodes, force.hands);
  double total = 0.0;
  for (const auto& shot : batch.scatter) total += cost(shot);
  for (const auto& shot : batch.gather) total += cost(shot);
  for (const auto& shot : batch.point_lights) total += cost(shot);
  for (const auto& shot : batch.parallel) total += cost(shot);
  for (const auto& shot : batch.lamps) total += cost(shot);
  const double share = total / static_cast<double>(force.workers);
  Cutter cutter{cost, most, share, share, force, {}};
  cutter.cut(batch.gather, ShotKind::kGather);
  cutter.cut(batch.parallel, ShotKind::kParallel);
  cutter.cut(batch.point_lights, ShotKind::kPoint);
  cutter.cut(batch.lamps, ShotKind::kLamp);
  cutter.cut(batch.scatter, ShotKind::kScatter);
  return std::move(cutter.chunks);
}

std::vector<std::byte> packChunk(const solver::ShotBatch& batch, const Chunk& chunk, const ChunkId& id, bool measure) {
  Packed packed;
  std::span<const solver::ScatterShot> scatter;
  std::span<const solver::PointShot> point_lights;
  if (chunk.kind == ShotKind::kScatter) scatter = std::span(batch.scatter).subspan(chunk.first, chunk.count);
  if (chunk.kind == ShotKind::kPoint) point_lights = std::span(batch.point_lights).subspan(chunk.first, chunk.count);
  if (chunk.kind == ShotKind::kGather) packGather(batch, chunk, packed);
  if (chunk.kind == ShotKind::kParallel) packParallel(batch, chunk, packed);
  if (chunk.kind == ShotKind::kLamp) packLamps(batch, chunk, packed);
  ChunkBody head;
  head.chunk = id.chunk;
  head.batch = id.batch;
  head.flux_scale = batch.flux_scale;
  head.mode = static_cast<std::uint32_t>(batch.mode);
  head.measure = measure ? 1 : 0;
  head.scatter = static_cast<std::uint32_t>(scatter.size());
  head.gather = static_cast<std::uint32_t>(packed.gather.size());
  head.points = static_cast<std::uint32_t>(packed.points.size());
  head.point_lights = static_cast<std::uint32_t>(point_lights.size());
  head.parallel = static_cast<std::uint32_t>(packed.parallel.size());
  head.views = static_cast<std::uint32_t>(packed.views.size());
  head.receivers = static_cast<std::uint32_t>(packed.receivers.size());
  head.boxes = static_cast<std::uint32_t>(packed.boxes.size());
  head.lamps = static_cast<std::uint32_t>(packed.lamps.size());
  head.webs = static_cast<std::uint32_t>(packed.webs.size());
  std::vector<std::byte> body;
  appendValue(body, head);
  appendSpan(body, scatter);
  appendSpan(body, std::span<const solver::GatherShot>(packed.gather));
  appendSpan(body, std::span<const solver::HemicubeFrame>(packed.points));
  appendSpan(body, point_lights);
  appendSpan(body, std::span<const solver::ParallelShot>(packed.parallel));
  appendSpan(body, std::span<const solver::ParallelView>(packed.views));
  appendSpan(body, std::span<const solver::NodeRun>(packed.receivers));
  appendSpan(body, std::span<const scene::ChangedBox>(packed.boxes));
  appendSpan(body, std::span<const solver::LampShot>(packed.lamps));
  appendSpan(body, std::span<const float>(packed.webs));
  return body;
}

}  // namespace radiosity::gpu
