// Tells systemd (or whoever set NOTIFY_SOCKET) how the service is: ready, stopping, what it does, and that it is alive.
// Owned by main; a thread of its own.
//
// The datagram protocol of sd_notify(3) is a line of text to a Unix socket, which systemd promises to keep; libsystemd
// would bring four compression libraries and a cryptographic one into a process that listens to the network.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "common/result.h"

namespace radiosity {

/// What a watchdog wants to know. All may be called from any thread.
struct Vitals {
  std::function<double()> event_loop_silent_s;  ///< since it last came round; about a second at most when well
  std::function<double()> solver_busy_s;        ///< at one slice or command; 0 when idle
  std::function<std::string()> status;          ///< one line for people
};

/// The longest that one command may keep the solve thread: loading a scene of many millions of triangles.
inline constexpr double kSolverPatienceS = 600.0;
/// An event loop that is silent for so long hangs.
inline constexpr double kEventLoopPatienceS = 10.0;

/// Whether the service does its work; a watchdog that hears nothing restarts it.
[[nodiscard]] bool isAlive(const Vitals& vitals);

/// The state a service tells; see sd_notify(3). kUnavailable: the socket cannot be reached, or nobody has read it for
/// as long as `patience`. Any thread; blocks for that time at most.
[[nodiscard]] Result<void> notifyService(const std::string& socket, const std::string& state,
                                         std::chrono::milliseconds patience);

class ServiceNotifier {
 public:
  /// Does nothing where NOTIFY_SOCKET is not set. Says READY=1 at once, STATUS= when it changes, and WATCHDOG=1 three
  /// times in each WATCHDOG_USEC, as long as isAlive().
  explicit ServiceNotifier(Vitals vitals);
  ~ServiceNotifier();
  ServiceNotifier(const ServiceNotifier&) = delete;
  ServiceNotifier& operator=(const ServiceNotifier&) = delete;

  /// STOPPING=1; the watchdog goes on until the end. Any thread.
  void stopping();

 private:
  void run();
  void tell(const std::string& state, std::chrono::milliseconds patience);

  std::string socket_;
  Vitals vitals_;
  std::chrono::milliseconds interval_;  ///< between two visits
  bool watched_ = false;                ///< WATCHDOG_USEC is ours
  std::mutex mutex_;
  std::condition_variable wake_;
  bool ended_ = false, failed_ = false;
  std::thread thread_;
};

}  // namespace radiosity
