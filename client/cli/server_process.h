// A private radiosityd: started for one solve, on a free loopback port, stopped after it and never outliving us. Owned
// and used by one thread; never blocks longer than asked.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/lib/server_url.h"
#include "common/result.h"

namespace radiosity::cli {

/// A line of a log as common/log.h writes it: "2026-01-01T00:00:00.000 warning [radiosityd] text". Lines of any other
/// form have an empty level and are all text.
struct LogLine {
  std::string level;
  std::string text;

  [[nodiscard]] bool isWarning() const { return level == "warning"; }
  [[nodiscard]] bool isError() const { return level == "error" || level == "critical"; }
};
[[nodiscard]] LogLine parseLogLine(const std::string& line);

/// Beside our own executable, in the build tree, or in PATH. kUnavailable names the places.
[[nodiscard]] Result<std::string> findServerProgram();

class ServerProcess {
 public:
  struct Options {
    std::string program;
    std::vector<std::string> arguments;  ///< after our own
    std::function<bool()> keep_going;    ///< false abandons the start
    bool secret = true;                  ///< asks for a token; false: for others to join
  };

  /// Returns once the server listens. A server that exits first hands over its reason: kBadInput where it exited with
  /// 2, else kUnavailable.
  [[nodiscard]] static Result<ServerProcess> start(const Options& options);

  ServerProcess(ServerProcess&& other) noexcept;
  ServerProcess& operator=(ServerProcess&&) = delete;
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;
  ~ServerProcess() { stop(std::chrono::milliseconds(1000)); }

  [[nodiscard]] const client::ServerUrl& url() const { return url_; }
  /// What it asks of those who speak to it: it listens where every user of the machine could.
  [[nodiscard]] const std::string& token() const { return token_; }
  [[nodiscard]] pid_t pid() const { return pid_; }

  /// Lines of the server's log since the last call, oldest first. Never waits.
  [[nodiscard]] std::vector<LogLine> takeLog();

  /// False once it has ended.
  [[nodiscard]] bool running();
  /// Waits for its end, at most so long; true once it has ended.
  [[nodiscard]] bool endsWithin(std::chrono::milliseconds wait);
  /// Why it ended: its last error line, and its status or signal.
  [[nodiscard]] Error epitaph();

  /// SIGTERM, then SIGKILL after `grace`, to it and to whatever is left of its process group (its workers).
  void stop(std::chrono::milliseconds grace);

 private:
  ServerProcess() = default;
  [[nodiscard]] Result<void> waitUntilListening(const std::function<bool()>& keep_going);
  void readPipes(std::chrono::milliseconds wait);
  void closePipes();

  pid_t pid_ = -1;
  int stdout_ = -1, stderr_ = -1;
  std::optional<int> wait_status_;
  std::string stdout_text_, stderr_text_;
  std::vector<LogLine> log_;
  std::string last_error_, last_text_;
  client::ServerUrl url_;
  std::string token_;
};

}  // namespace radiosity::cli
