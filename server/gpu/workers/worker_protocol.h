// What a transport and its worker processes say to each other: small binary messages over a stream socket, big things
// in shared memory. Both ends are this same program, so the layout is that of the structs.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/result.h"
#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/run/shot_runner.h"
#include "server/gpu/workers/shared_memory.h"

namespace radiosity::gpu {

enum class MessageKind : std::uint32_t {
  kReady,      ///< worker: has a context; body: ReadyBody, renderer's name
  kFailed,     ///< worker: body: text. The worker ends
  kScene,      ///< transport: two descriptors follow (scene, flux); body: SceneBody
  kSceneDone,  ///< worker
  kChunk,      ///< transport: body: ChunkBody, then the arrays it counts
  kChunkDone,  ///< worker: body: ChunkDoneBody, then the links of each shot if they were wanted
};

struct Message {
  MessageKind kind{};
  std::vector<std::byte> body;
  std::array<FileDescriptor, 2> fds;
};

struct ReadyBody {
  std::uint32_t software = 0;
};
struct SceneBody {
  std::uint64_t nodes = 0, hands = 1;
  std::uint64_t sight = 0;  ///< Sight
};
struct ChunkBody {
  std::uint64_t chunk = 0;
  std::uint64_t batch = 0;  ///< counted from 1; see putOffMark()
  double flux_scale = 1.0;
  std::uint32_t mode = 0;
  std::uint32_t measure = 0;  ///< 1: links are wanted, shot by shot, with the report
  std::uint32_t scatter = 0, gather = 0, points = 0, point_lights = 0, parallel = 0, views = 0;
  std::uint32_t receivers = 0, boxes = 0, lamps = 0, webs = 0;
};
struct ChunkDoneBody {
  std::uint64_t chunk = 0;
  /// 1: links are those of its first `shots` alone, and of a run nothing came; 2: so, and the next shot goes on from
  /// where it is when it comes again.
  std::uint64_t put_off = 0;
  std::uint64_t shots = 0;
  solver::TransportCounters counters;
};

inline constexpr std::uint64_t kKeepsPlace = 2;  ///< ChunkDoneBody::put_off

/// Bound on a message's body; a longer one is a broken peer.
inline constexpr std::size_t kMaxBody = std::size_t{1} << 30;

/// Appends the bytes of a value or of a span.
void append(std::vector<std::byte>& to, const void* data, std::size_t bytes);
template <typename T>
void appendValue(std::vector<std::byte>& to, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  append(to, &value, sizeof(T));
}
template <typename T>
void appendSpan(std::vector<std::byte>& to, std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  append(to, values.data(), values.size_bytes());
}

/// Takes values from the front of a body. After taking too much, good() is false and values are zero.
class BodyReader {
 public:
  explicit BodyReader(std::span<const std::byte> body) : rest_(body) {}
  template <typename T>
  T value() {
    T value{};
    take(&value, sizeof(T));
    return value;
  }
  template <typename T>
  std::vector<T> values(std::uint64_t count) {
    std::vector<T> values;
    if (count > rest_.size() / sizeof(T)) {
      good_ = false;
      return values;
    }
    values.resize(count);
    take(values.data(), count * sizeof(T));
    return values;
  }
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] std::span<const std::byte> rest() const { return rest_; }

 private:
  void take(void* to, std::size_t bytes);

  std::span<const std::byte> rest_;
  bool good_ = true;
};

/// How long one process waits for the other. By default for ever, as a worker does: its transport may have nothing to
/// say for hours.
struct Patience {
  std::optional<std::chrono::steady_clock::time_point> deadline;
  int wake_fd = -1;  ///< ends the wait as soon as it can be read
};
/// Why there was no message.
enum class Lapse {
  kGone,      ///< the socket is closed
  kLate,      ///< the deadline passed; the peer may have stopped in the middle of a message
  kWoken,     ///< by wake_fd
  kNonsense,  ///< longer than kMaxBody
};

/// Blocks until all is sent. Never raises SIGPIPE.
[[nodiscard]] tl::expected<void, Lapse> sendMessage(int socket, MessageKind kind, std::span<const std::byte> body,
                                                    std::span<const int> fds = {}, const Patience& patience = {});
/// Blocks for a whole message.
[[nodiscard]] tl::expected<Message, Lapse> receiveMessage(int socket, const Patience& patience = {});

/// What the renderer needs of a scene, as one block of shared memory, and back.
[[nodiscard]] Result<SharedMemory> packScene(const scene::PatchScene& patches);
[[nodiscard]] Result<std::shared_ptr<const scene::PatchScene>> unpackScene(std::span<const std::byte> packed);

/// Links at the end of a report.
void packLinks(std::vector<std::byte>& to, const solver::LinkSample& links);
/// False when they are cut short, or name nodes from `nodes` on.
[[nodiscard]] bool unpackLinks(BodyReader& from, std::size_t nodes, solver::LinkSample& links);

/// Accumulators in shared memory.
[[nodiscard]] std::size_t fluxRegionBytes(std::size_t nodes);
[[nodiscard]] FluxSink fluxRegionSink(std::span<std::byte> region, std::size_t nodes);
/// Beside them: batches up to this number are of no use any more, whatever the worker is at.
[[nodiscard]] std::atomic<std::uint64_t>& putOffMark(std::span<std::byte> region);

}  // namespace radiosity::gpu
