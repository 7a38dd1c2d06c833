#include "server/service_notify.h"

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "common/log.h"

namespace radiosity {
namespace {

constexpr std::chrono::milliseconds kStatusInterval{2000};
/// For a manager that is busy. The event loop, which tells of the end, has less time.
constexpr std::chrono::milliseconds kPatience{5000}, kPatienceAtEnd{500};

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

std::optional<std::uint64_t> number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// WATCHDOG_USEC, where it is meant for this process.
std::optional<std::chrono::microseconds> watchdogTime() {
  const auto time_us = number(environment("WATCHDOG_USEC"));
  const auto pid = environment("WATCHDOG_PID");
  if (!time_us || *time_us == 0) return std::nullopt;
  if (!pid.empty() && number(pid) != static_cast<std::uint64_t>(getpid())) return std::nullopt;
  return std::chrono::microseconds(*time_us);
}

}  // namespace

bool isAlive(const Vitals& vitals) {
  return vitals.event_loop_silent_s() < kEventLoopPatienceS && vitals.solver_busy_s() < kSolverPatienceS;
}

Result<void> notifyService(const std::string& socket, const std::string& state, std::chrono::milliseconds patience) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const bool form_is_good = socket.size() > 1 && (socket[0] == '/' || socket[0] == '@');
  if (!form_is_good || socket.size() >= sizeof(address.sun_path))
    return fail(ErrorCode::kUnavailable, "is neither a path nor an abstract socket", "NOTIFY_SOCKET");
  std::copy(socket.begin(), socket.end(), address.sun_path);
  if (socket[0] == '@') address.sun_path[0] = '\0';
  const int descriptor = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return fail(ErrorCode::kUnavailable, std::strerror(errno), "NOTIFY_SOCKET");
  const auto whole_s = std::chrono::duration_cast<std::chrono::seconds>(patience);
  const timeval most{whole_s.count(), std::chrono::microseconds(patience - whole_s).count()};
  (void)setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &most, sizeof(most));
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket.size());
  const auto sent =
      sendto(descriptor, state.data(), state.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address), length);
  const int error = errno;
  close(descriptor);
  if (sent == static_cast<ssize_t>(state.size())) return {};
  return fail(ErrorCode::kUnavailable, error == EAGAIN ? "nobody reads it" : std::strerror(error),
              "NOTIFY_SOCKET " + socket);
}

ServiceNotifier::ServiceNotifier(Vitals vitals)
    : socket_(environment("NOTIFY_SOCKET")), vitals_(std::move(vitals)), interval_(kStatusInterval) {
  if (socket_.empty()) return;
  if (const auto time = watchdogTime()) {
    watched_ = true;
    constexpr int kTimesInEach = 3;
    interval_ = std::min(interval_, std::chrono::duration_cast<std::chrono::milliseconds>(*time / kTimesInEach));
    interval_ = std::max(interval_, std::chrono::milliseconds(1));
  }
  tell("READY=1", kPatience);
  thread_ = std::thread([this] { run(); });
}

ServiceNotifier::~ServiceNotifier() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void ServiceNotifier::stopping() {
  if (!socket_.empty()) tell("STOPPING=1\nSTATUS=draining", kPatienceAtEnd);
}

void ServiceNotifier::run() {
  std::string told;
  bool was_alive = true;
  for (std::unique_lock lock(mutex_); !ended_; wake_.wait_for(lock, interval_)) {
    lock.unlock();
    const bool alive = isAlive(vitals_);
    if (watched_ && alive) tell("WATCHDOG=1", kPatience);
    if (was_alive && !alive)
      log::error("the {} hangs; the watchdog is not told any more that all is well",
                 vitals_.solver_busy_s() < kSolverPatienceS ? "event loop" : "solve thread");
    was_alive = alive;
    auto status = "STATUS=" + vitals_.status();
    std::replace(status.begin(), status.end(), '\n', ' ');
    if (status != told) tell(status, kPatience);
    told = std::move(status);
    lock.lock();
  }
}

/// A manager that is not there is named once.
void ServiceNotifier::tell(const std::string& state, std::chrono::milliseconds patience) {
  const auto told = notifyService(socket_, state, patience);
  const std::lock_guard lock(mutex_);
  if (!told && !std::exchange(failed_, true)) log::warn("{}", told.error().text());
}

}  // namespace radiosity
