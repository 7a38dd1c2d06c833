// One worker process as its transport sees it. Owned and used by the transport's thread.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "server/gpu/workers/worker_protocol.h"

namespace radiosity::gpu {

class WorkerProcess {
 public:
  /// Starts `executable --worker ...`. It is not ready until awaitReady().
  [[nodiscard]] static Result<WorkerProcess> start(const std::string& executable);

  /// Kills and reaps the process: no zombie, nothing left running.
  ~WorkerProcess();
  WorkerProcess(WorkerProcess&& other) noexcept;
  WorkerProcess& operator=(WorkerProcess&& other) noexcept;
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  // Each blocks as long as `patience` allows; after an error (the worker's own message, where it sent one; how it
  // ended; that it hangs) the worker is of no more use.

  /// Until the worker has a context.
  [[nodiscard]] Result<void> awaitReady(const Patience& patience);
  /// Gives it the scene, fresh accumulators for its nodes, and what else goes with it; answer with awaitScene().
  [[nodiscard]] Result<void> sendScene(const SharedMemory& packed, const SceneBody& body, const Patience& patience);
  [[nodiscard]] Result<void> awaitScene(const Patience& patience);
  [[nodiscard]] Result<void> send(MessageKind kind, std::span<const std::byte> body, const Patience& patience) const;
  /// Its next message, which must be of this kind.
  [[nodiscard]] Result<Message> receive(MessageKind kind, const Patience& patience) const;

  /// How the process ended; nothing while it runs. Does not wait.
  [[nodiscard]] std::optional<Error> ending() const;

  /// Starts its end; the destructor waits for it. For several to end at the same time.
  void kill() const;

  [[nodiscard]] int socket() const { return socket_.get(); }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] const std::string& renderer() const { return renderer_; }
  [[nodiscard]] bool software() const { return software_; }
  /// That it has used so far, of all its threads; zero where the system does not tell.
  [[nodiscard]] std::chrono::nanoseconds processorTime() const;
  /// After sendScene(): it is to leave what it has of batches up to this one, and says so soon.
  void putOff(std::uint64_t batch) { putOffMark(flux_.bytes()).store(batch, std::memory_order_relaxed); }
  [[nodiscard]] FluxSink sink() { return fluxRegionSink(flux_.bytes(), nodes_); }

 private:
  WorkerProcess() = default;
  /// "worker 4711 was killed by signal 9" after its socket closed.
  [[nodiscard]] std::string epitaph() const;
  [[nodiscard]] Error errorOf(Lapse lapse) const;
  void stop();

  pid_t pid_ = -1;
  FileDescriptor socket_;
  std::string renderer_;
  bool software_ = false;
  SharedMemory flux_;
  std::size_t nodes_ = 0;
};

}  // namespace radiosity::gpu
