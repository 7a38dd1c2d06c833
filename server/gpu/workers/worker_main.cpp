// The body of a worker process: a context, a scene and accumulators in shared memory, and chunks of shots until the
// socket closes.
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <optional>

#include "common/log.h"
#include "common/task.h"
#include "server/gpu/run/shot_crew.h"
#include "server/gpu/workers/gpu_transport.h"
#include "server/gpu/workers/worker_protocol.h"

namespace radiosity::gpu {
namespace {

std::span<const std::byte> textBytes(const std::string& text) { return std::as_bytes(std::span(text)); }

class Worker {
 public:
  Worker(int socket, std::unique_ptr<ShotCrew> crew) : socket_(socket), crew_(std::move(crew)) {}

  /// Until the transport closes the socket (true) or something cannot go on (false).
  bool serve() {
    while (true) {
      auto message = receiveMessage(socket_);
      if (!message) return true;
      Result<void> done;
      if (message->kind == MessageKind::kScene) {
        done = takeScene(*message);
      } else if (message->kind == MessageKind::kChunk) {
        done = runChunk(*message);
      } else {
        done = fail(ErrorCode::kInternal, "unknown message");
      }
      if (!done) {
        (void)sendMessage(socket_, MessageKind::kFailed, textBytes(done.error().text()));
        return false;
      }
    }
  }

 private:
  Result<void> takeScene(Message& message) {
    const auto [nodes, hands, sight] = BodyReader(message.body).value<SceneBody>();
    auto packed = SharedMemory::map(std::move(message.fds[0]));
    if (!packed) return tl::unexpected(packed.error());
    auto flux = SharedMemory::map(std::move(message.fds[1]));
    if (!flux) return tl::unexpected(flux.error());
    auto scene = unpackScene(packed->bytes());
    if (!scene) return tl::unexpected(scene.error());
    if ((*scene)->nodeCount() != nodes || flux->bytes().size() < fluxRegionBytes(nodes)) {
      return fail(ErrorCode::kInternal, "accumulators do not fit the scene");
    }
    crew_->setHands(std::max<std::size_t>(hands, 1));
    crew_->setSight(static_cast<Sight>(sight));
    if (auto set = crew_->setScene(std::move(*scene)); !set) return set;
    flux_ = std::move(*flux);
    sink_ = fluxRegionSink(flux_.bytes(), nodes);
    return reply(MessageKind::kSceneDone, {});
  }

  Result<void> runChunk(const Message& message) {
    BodyReader from(message.body);
    const auto head = from.value<ChunkBody>();
    const auto scatter = from.values<solver::ScatterShot>(head.scatter);
    const auto gather = from.values<solver::GatherShot>(head.gather);
    const auto points = from.values<solver::HemicubeFrame>(head.points);
    const auto point_lights = from.values<solver::PointShot>(head.point_lights);
    const auto parallel = from.values<solver::ParallelShot>(head.parallel);
    const auto views = from.values<solver::ParallelView>(head.views);
    const auto receivers = from.values<solver::NodeRun>(head.receivers);
    const auto boxes = from.values<scene::ChangedBox>(head.boxes);
    const auto lamps = from.values<solver::LampShot>(head.lamps);
    const auto webs = from.values<float>(head.webs);
    if (!from.good() || !sink_) return fail(ErrorCode::kInternal, "a chunk is cut short or came before the scene");
    const auto mode = static_cast<solver::LinkMode>(head.mode);
    const ShotSpan shots{mode,     head.flux_scale, scatter,   gather, points, point_lights,
                         parallel, views,           receivers, boxes,  lamps,  webs};
    std::vector<std::byte> links;
    std::uint64_t taken = 0;
    const auto pack = [&](std::size_t, const solver::LinkSample& sample) {
      packLinks(links, sample);
      ++taken;
    };
    Task task(putOffMark(flux_.bytes()), head.batch);
    Result<solver::TransportCounters> counters;
    bool has_begun = false;
    try {
      const TaskScope scope(&task);
      interruptionPoint();
      has_begun = true;
      counters = head.measure != 0 ? crew_->measure(shots, pack) : crew_->run(shots, *sink_);
    } catch (const Interrupted&) {
      return replyDone({head.chunk, has_begun && crew_->keepsPlace() ? kKeepsPlace : 1, taken, {}}, links);
    }
    if (!counters) return tl::unexpected(counters.error());
    return replyDone({head.chunk, 0, taken, *counters}, links);
  }

  Result<void> replyDone(const ChunkDoneBody& body, std::span<const std::byte> links) const {
    std::vector<std::byte> report;
    appendValue(report, body);
    appendSpan(report, links);
    return reply(MessageKind::kChunkDone, report);
  }

  Result<void> reply(MessageKind kind, std::span<const std::byte> body) const {
    if (sendMessage(socket_, kind, body)) return {};
    return fail(ErrorCode::kUnavailable, "the transport is gone");
  }

  int socket_;
  std::unique_ptr<ShotCrew> crew_;
  SharedMemory flux_;
  std::optional<FluxSink> sink_;
};

}  // namespace

int workerMain(int argc, char** argv) {
  if (argc < 2) {
    log::error("a worker is started by radiosityd, not by hand");
    return 2;
  }
  const int socket = std::atoi(argv[0]);
  const auto parent = static_cast<pid_t>(std::atol(argv[1]));
  // A worker never outlives its server: the signal covers long driver calls, the closed socket everything else.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) return 1;
  std::signal(SIGINT, SIG_IGN);  // the terminal's Ctrl-C is the server's business
  // Workers are the parallelism: a second thread inside each rasteriser only gets in the way.
  setenv("LP_NUM_THREADS", "0", 1);

  auto crew = ShotCrew::create();
  if (!crew) {
    (void)sendMessage(socket, MessageKind::kFailed, textBytes(crew.error().text()));
    return 1;
  }
  std::vector<std::byte> ready;
  const auto& context = (*crew)->context();
  appendValue(ready, ReadyBody{static_cast<std::uint32_t>(context.software())});
  append(ready, context.renderer().data(), context.renderer().size());
  if (!sendMessage(socket, MessageKind::kReady, ready)) return 1;
  return Worker(socket, std::move(*crew)).serve() ? 0 : 1;
}

}  // namespace radiosity::gpu
