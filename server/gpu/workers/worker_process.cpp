#include "server/gpu/workers/worker_process.h"

#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <ctime>
#include <thread>

#include "common/check.h"

namespace radiosity::gpu {
namespace {

constexpr int kWorkerSocket = 3;  ///< the worker's only descriptor beside the standard three

/// posix_spawn's attributes: no inherited signal mask, own process group (so that Ctrl-C never reaches it).
class SpawnSetup {
 public:
  explicit SpawnSetup(int socket) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_adddup2(&actions_, socket, kWorkerSocket);
    // A server's sockets must not live on in a worker.
    posix_spawn_file_actions_addclosefrom_np(&actions_, kWorkerSocket + 1);
    posix_spawnattr_init(&attributes_);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes_, &none);
    sigset_t defaults;
    sigemptyset(&defaults);
    for (const int signal : {SIGTERM, SIGPIPE, SIGHUP}) sigaddset(&defaults, signal);
    posix_spawnattr_setsigdefault(&attributes_, &defaults);
    posix_spawnattr_setpgroup(&attributes_, 0);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~SpawnSetup() {
    posix_spawn_file_actions_destroy(&actions_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnSetup(const SpawnSetup&) = delete;
  SpawnSetup& operator=(const SpawnSetup&) = delete;

  [[nodiscard]] const posix_spawn_file_actions_t* actions() const { return &actions_; }
  [[nodiscard]] const posix_spawnattr_t* attributes() const { return &attributes_; }

 private:
  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
};

}  // namespace

Result<WorkerProcess> WorkerProcess::start(const std::string& executable) {
  std::array<int, 2> pair{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
    return fail(ErrorCode::kUnavailable, std::string("cannot make a socket pair: ") + std::strerror(errno));
  }
  WorkerProcess worker;
  worker.socket_ = FileDescriptor(pair[0]);
  const FileDescriptor theirs(pair[1]);
  const SpawnSetup setup(theirs.get());
  auto socket = std::to_string(kWorkerSocket);
  auto parent = std::to_string(getpid());
  std::string flag = "--worker";
  std::string program = executable;
  std::array<char*, 5> arguments{program.data(), flag.data(), socket.data(), parent.data(), nullptr};
  const int error =
      posix_spawn(&worker.pid_, program.c_str(), setup.actions(), setup.attributes(), arguments.data(), environ);
  if (error != 0) {
    worker.pid_ = -1;
    return fail(ErrorCode::kUnavailable, std::string("cannot start a worker process: ") + std::strerror(error),
                executable);
  }
  return worker;
}

WorkerProcess::WorkerProcess(WorkerProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      socket_(std::move(other.socket_)),
      renderer_(std::move(other.renderer_)),
      software_(other.software_),
      flux_(std::move(other.flux_)),
      nodes_(other.nodes_) {}

WorkerProcess& WorkerProcess::operator=(WorkerProcess&& other) noexcept {
  if (this != &other) {
    stop();
    pid_ = std::exchange(other.pid_, -1);
    socket_ = std::move(other.socket_);
    renderer_ = std::move(other.renderer_);
    software_ = other.software_;
    flux_ = std::move(other.flux_);
    nodes_ = other.nodes_;
  }
  return *this;
}

WorkerProcess::~WorkerProcess() { stop(); }

void WorkerProcess::kill() const {
  if (pid_ >= 0) ::kill(pid_, SIGKILL);
}

void WorkerProcess::stop() {
  if (pid_ < 0) return;
  // It holds nothing that would need an orderly end; waiting for a long draw call to finish would.
  kill();
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
}

std::chrono::nanoseconds WorkerProcess::processorTime() const {
  clockid_t clock{};
  timespec used{};
  if (clock_getcpuclockid(pid_, &clock) != 0 || clock_gettime(clock, &used) != 0) return {};
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec);
}

std::optional<Error> WorkerProcess::ending() const {
  siginfo_t info{};
  // WNOWAIT: stop() still reaps it.
  if (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT | WNOHANG) != 0)
    return Error{ErrorCode::kUnavailable, "a worker process is gone", {}};
  if (info.si_pid == 0) return std::nullopt;
  const auto* how = info.si_code == CLD_EXITED ? " ended with status " : " was killed by signal ";
  return Error{
      ErrorCode::kUnavailable, "worker process " + std::to_string(pid_) + how + std::to_string(info.si_status), {}};
}

std::string WorkerProcess::epitaph() const {
  // A closed socket means that it is ending; one that could not be used does not.
  constexpr int kTries = 300;  // of a large one, on a busy machine, it takes a while
  for (int i = 0; i < kTries; ++i) {
    if (i > 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (const auto ended = ending()) return ended->message;
  }
  return "worker process " + std::to_string(pid_) + " cannot be spoken to";
}

Error WorkerProcess::errorOf(Lapse lapse) const {
  const std::string name = "worker process " + std::to_string(pid_);
  switch (lapse) {
    case Lapse::kGone:
      return {ErrorCode::kUnavailable, epitaph()};
    case Lapse::kLate:
      return {ErrorCode::kUnavailable, name + " hangs"};
    case Lapse::kWoken:
      return {ErrorCode::kUnavailable, "interrupted"};
    case Lapse::kNonsense:
      break;
  }
  return {ErrorCode::kInternal, name + " sent too long a message"};
}

Result<void> WorkerProcess::send(MessageKind kind, std::span<const std::byte> body, const Patience& patience) const {
  if (const auto sent = sendMessage(socket_.get(), kind, body, {}, patience); !sent) {
    return tl::unexpected(errorOf(sent.error()));
  }
  return {};
}

Result<Message> WorkerProcess::receive(MessageKind kind, const Patience& patience) const {
  auto message = receiveMessage(socket_.get(), patience);
  if (!message) return tl::unexpected(errorOf(message.error()));
  if (message->kind == MessageKind::kFailed) {
    const auto* text = reinterpret_cast<const char*>(message->body.data());
    return fail(ErrorCode::kUnavailable, std::string(text, message->body.size()));
  }
  if (message->kind != kind) return fail(ErrorCode::kInternal, "a worker process answered out of turn");
  return std::move(*message);
}

Result<void> WorkerProcess::awaitReady(const Patience& patience) {
  const auto message = receive(MessageKind::kReady, patience);
  if (!message) return tl::unexpected(message.error());
  BodyReader from(message->body);
  software_ = from.value<ReadyBody>().software != 0;
  renderer_.assign(reinterpret_cast<const char*>(from.rest().data()), from.rest().size());
  return {};
}

Result<void> WorkerProcess::sendScene(const SharedMemory& packed, const SceneBody& body, const Patience& patience) {
  auto flux = SharedMemory::create("radiosity flux", fluxRegionBytes(body.nodes));
  if (!flux) return tl::unexpected(flux.error());
  flux_ = std::move(*flux);
  nodes_ = body.nodes;
  const std::array<int, 2> fds{packed.fd(), flux_.fd()};
  const auto bytes = std::as_bytes(std::span(&body, 1));
  if (const auto sent = sendMessage(socket_.get(), MessageKind::kScene, bytes, fds, patience); !sent) {
    return tl::unexpected(errorOf(sent.error()));
  }
  return {};
}

Result<void> WorkerProcess::awaitScene(const Patience& patience) {
  const auto message = receive(MessageKind::kSceneDone, patience);
  if (!message) return tl::unexpected(message.error());
  return {};
}

}  // namespace radiosity::gpu
