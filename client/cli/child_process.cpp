#include "client/cli/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <optional>
#include <utility>

#include "client/cli/interrupt.h"

namespace radiosity::cli {
namespace {

constexpr std::size_t kMostText = 4096;
constexpr std::chrono::minutes kMostTime{10};
constexpr int kTickMs = 50;

/// Both ends close when it goes.
class Pipe {
 public:
  Pipe() { is_open_ = pipe2(ends_.data(), O_CLOEXEC) == 0; }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    if (is_open_) close(ends_[0]);
    closeInput();
  }

  [[nodiscard]] bool isOpen() const { return is_open_; }
  [[nodiscard]] int output() const { return ends_[0]; }
  [[nodiscard]] int input() const { return ends_[1]; }
  void closeInput() {
    if (is_open_ && ends_[1] >= 0) close(std::exchange(ends_[1], -1));
  }

 private:
  std::array<int, 2> ends_{};
  bool is_open_ = false;
};

/// Runs in the child, between fork and exec: only async-signal-safe calls. `errors` gets errno if there is no program.
[[noreturn]] void become(const std::vector<char*>& arguments, int text, int errors) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXFSZ}) signal(number, SIG_DFL);
  // Of a group of its own, it would stop if it read from the terminal.
  if (const int nothing = open("/dev/null", O_RDONLY); nothing >= 0) dup2(nothing, STDIN_FILENO);
  dup2(text, STDERR_FILENO);
  dup2(text, STDOUT_FILENO);
  execvp(arguments[0], arguments.data());
  const int number = errno;
  (void)!write(errors, &number, sizeof number);
  _exit(1);
}

/// A program that was started, in a process group of its own. One that still runs is killed with its group.
class Child {
 public:
  explicit Child(pid_t process) : process_(process) {}
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    if (status_) return;
    kill(-process_, SIGKILL);
    while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) continue;
  }

  /// As of waitpid; none while it runs.
  std::optional<int> ended() {
    int status = 0;
    if (!status_ && waitpid(process_, &status, WNOHANG) == process_) status_ = status;
    return status_;
  }

 private:
  pid_t process_;
  std::optional<int> status_;
};

/// Appends what there is to read. False: nothing will come any more.
bool readSome(int from, std::string& text) {
  std::array<char, 1024> part{};
  const auto count = read(from, part.data(), part.size());
  if (count < 0 && errno == EINTR) return true;
  if (count <= 0) return false;
  text.append(part.data(), static_cast<std::size_t>(count));
  if (text.size() > kMostText) text.erase(0, text.size() - kMostText);
  return true;
}

/// What the child has printed by its end. Processes of its own that outlive it are not waited for.
Result<Ran> waitFor(Child& child, int output, const std::string& name) {
  std::string text;
  const auto end = std::chrono::steady_clock::now() + kMostTime;
  bool may_come = true;
  for (;;) {
    const auto status = child.ended();
    pollfd wait{output, POLLIN, 0};
    if (!may_come) wait.fd = -1;  // poll only sleeps
    if (poll(&wait, 1, status ? 0 : kTickMs) > 0) {
      may_come = readSome(output, text);
    } else if (status) {
      while (!text.empty() && text.back() == '\n') text.pop_back();
      return Ran{WIFEXITED(*status) ? WEXITSTATUS(*status) : 128 + WTERMSIG(*status), std::move(text)};
    }
    if (interrupted()) return fail(ErrorCode::kCancelled, "interrupted");
    if (std::chrono::steady_clock::now() > end)
      return fail(ErrorCode::kUnavailable, "has not ended after ten minutes, and was stopped", name);
  }
}

/// Why the program is not there; 0: it is. Returns when it has been started.
int startError(Pipe& errors) {
  errors.closeInput();
  int number = 0;
  for (;;) {
    const auto count = read(errors.output(), &number, sizeof number);
    if (count < 0 && errno == EINTR) continue;
    return count == sizeof number ? number : 0;
  }
}

}  // namespace

Result<Ran> runProgram(std::vector<std::string> command) {
  Pipe text, errors;
  if (!text.isOpen() || !errors.isOpen())
    return fail(ErrorCode::kUnavailable, std::string("cannot be started: ") + strerror(errno), command[0]);
  std::vector<char*> arguments;
  for (auto& word : command) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const pid_t process = fork();
  if (process == 0) become(arguments, text.input(), errors.input());
  if (process < 0)
    return fail(ErrorCode::kUnavailable, std::string("cannot be started: ") + strerror(errno), command[0]);
  Child child(process);
  text.closeInput();
  if (const int number = startError(errors); number != 0)
    return fail(number == ENOENT ? ErrorCode::kNotFound : ErrorCode::kUnavailable,
                std::string("cannot be started: ") + strerror(number), command[0]);
  return waitFor(child, text.output(), command[0]);
}

}  // namespace radiosity::cli
